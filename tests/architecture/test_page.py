# SPDX-License-Identifier: Apache-2.0
"""ARCHITECTURE.md says what is there: its tree are the folders, its orders of layers are those of the imports."""

import ast
import graphlib
import pathlib
import re
import subprocess

import pytest
from source_texts import imports, layers_of_simsense

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
PACKAGE = ROOT / "python/activestereo"
BESIDE_THE_LAYERS = {"__init__", "__main__"}


def tree_of_page() -> list[str]:
    """Folders of the page's tree, two levels, as paths."""
    block = re.search(r"^```tree\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    assert block, "ARCHITECTURE.md has no tree"
    folders, top = [], ""
    for line in block.group(1).splitlines():
        name = line.split()[0]
        assert len(line.split()) > 2, f"'{line}' says nothing about {name}"
        top = name if not line.startswith(" ") else top
        folders.append(name if name == top else f"{top}/{name}")
    return folders


def tracked_folders() -> set[str]:
    """First and second level, of what git tracks or would track."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if listing.returncode:
        pytest.skip("not a git checkout: the tree is not compared with the files")
    paths = [pathlib.PurePosixPath(line) for line in listing.stdout.splitlines()]
    paths = [p for p in paths if (ROOT / p).is_file() and not p.parts[0].startswith(".")]
    return {"/".join(p.parts[:depth]) for p in paths for depth in (1, 2) if len(p.parts) > depth}


def parts_of_page() -> dict[str, tuple[int, set[str]]]:
    """{part of activestereo: (its floor, the parts that it imports)}, as the page says."""
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \| ([^|]*) \| [^|]+ \|$", PAGE, re.MULTILINE)
    assert len(rows) > 3, "ARCHITECTURE.md has no table of packages"
    return {name: (int(floor), set(re.findall(r"`(\w+)`", imports))) for floor, name, imports in rows}


def files_of_package() -> dict[str, pathlib.Path]:
    """{module without `activestereo.`: its file}, packages by their __init__.py; the face and __main__ are no parts."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        name = ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")
        if "__pycache__" not in path.parts and name not in BESIDE_THE_LAYERS:
            found[name] = path
    return found


FILES = files_of_package()


def imports_of(path: pathlib.Path) -> set[str]:
    """Modules of activestereo that a file imports, wherever in the file, for type checkers too."""
    found = set()
    for module, name in imports(path):
        if f"{module}.".startswith("activestereo."):
            inside = f"{module}.".removeprefix("activestereo.")
            assert inside or not name or name in FILES, f"{path} imports from the package's face"
            found.add(n if (n := inside + name) in FILES else inside[:-1])
    return found & set(FILES)


IMPORTS = {name: imports_of(path) for name, path in FILES.items()}


def part(module: str) -> str:
    return module.split(".")[0]


def test_tree_of_the_page_is_the_tree_of_folders():
    assert sorted(tree_of_page()) == sorted(tracked_folders())


def test_every_part_has_its_row_with_what_it_imports():
    uses: dict[str, set[str]] = {part(name): set() for name in FILES}
    for name, others in IMPORTS.items():
        uses[part(name)] |= {part(other) for other in others} - {part(name)}
    assert {name: imports for name, (_, imports) in parts_of_page().items()} == uses


def test_a_part_stands_on_the_floor_above_what_it_imports():
    parts = parts_of_page()
    expected = {name: 1 + max((parts[i][0] for i in used), default=0) for name, (_, used) in parts.items()}
    assert {name: floor for name, (floor, _) in parts.items()} == expected


def test_parts_are_few():
    packages = {name for name in parts_of_page() if (PACKAGE / name / "__init__.py").exists()}
    assert len(packages) <= 14
    assert len(parts_of_page()) - len(packages) <= 4
    assert max(floor for floor, _ in parts_of_page().values()) <= 10


def test_only_the_command_line_and_realsense_import_integrations_and_benchmarks():
    found = {name for name, (_, imports) in parts_of_page().items() if imports & {"integrations", "benchmarks"}}
    assert found <= {"cli", "realsense"}


def test_one_page_names_all_that_users_import():
    face = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    homes = next(n.value for n in face.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "_HOMES")
    page = (ROOT / "examples/guide/python_api.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (`[^|]+) \|", page, re.MULTILINE)
    assert sorted(re.findall(r"`(\w+)`", " ".join(cells))) == sorted(ast.literal_eval(homes))


def test_no_file_imports_itself_through_others():
    graphlib.TopologicalSorter(IMPORTS).prepare()  # CycleError names the circle


def places(name: str) -> list[str]:
    """The paths of a name such as `a/{b,c}.h`; of one with a <new> part, the folder that it goes into."""
    if "<" in name:
        return [name.partition("<")[0].rpartition("/")[0]]
    before, brace, rest = name.partition("{")
    inner, _, after = rest.partition("}")
    return [path for part in inner.split(",") for path in places(before + part + after)] if brace else [name]


def test_recipes_name_what_exists():
    recipes = PAGE[PAGE.index("## Recipes") :]
    names = [path for name in re.findall(r"`([\w.{][\w./{},<>-]*/[\w./{},<>-]+)`", recipes) for path in places(name)]
    assert len(names) > 200 and places("a/{b,c/d}.h") == ["a/b.h", "a/c/d.h"] and places("a/b/<c>.h") == ["a/b"]
    assert not [name for name in names if not any((base / name).exists() for base in (ROOT, PACKAGE))]


def test_a_name_without_folder_stands_in_the_last_path_s_folder():
    rows = re.findall(r"^\| [^|]+ \| ([^|]+) \|$", PAGE[PAGE.index("## Recipes") :], re.MULTILINE)
    found = []
    for row in rows:
        folder = ""
        for name in re.findall(r"`([\w./{},<>-]+)`", row):
            if "/" in name:
                last = places(name)[-1]
                folder = last if "<" in name else last.rpartition("/")[0]
            elif folder and re.fullmatch(r"[\w{},]+\.(\w+|{[\w,]+})", name):
                found += [f"{folder}/{path}" for path in places(name)]
    assert len(rows) > 40 and len(found) > 30
    assert not [path for path in found if not any((base / path).exists() for base in (ROOT, PACKAGE))]


def described_folders(root: str) -> list[str]:
    """Folders under `root` that a table of the page describes, in its order."""
    rows = re.findall(r"^\| ((?:`[^`]+`(?:, )?)+) \| [^|]+ \|$", PAGE, re.MULTILINE)
    names = [name for row in rows for name in re.findall(r"`([^`]+)`", row)]
    return [name.removeprefix(root) for name in names if name.startswith(root)]


def test_folders_of_kuafu_stand_in_the_order_of_its_layers():
    layers = (ROOT / "kuafu/README.md").read_text(encoding="utf-8")
    order = re.findall(r"^\| `(\w+)` \| [^|]+ \|[^|]*\|$", layers, re.MULTILINE)
    assert described_folders("kuafu/src/") == order


def test_folders_of_simsense_stand_in_the_order_of_its_layers():
    described = described_folders("simsense/src/")
    rank = {name: number for number, layer in enumerate(layers_of_simsense(ROOT)) for name in layer}
    assert sorted(described) == sorted(rank)
    assert [rank[name] for name in described] == sorted(rank[name] for name in described)


def test_every_subpackage_is_described():
    files = [path.relative_to(PACKAGE) for path in PACKAGE.rglob("*") if path.is_file()]
    inner = {str(f.parent) for f in files if len(f.parts) > 2 and "__pycache__" not in f.parts}
    packages = {name.split("/")[0] for name in inner}
    described = {name for name in described_folders("") if name.split("/")[0] in packages and "/" in name}
    assert described == inner
