# SPDX-License-Identifier: Apache-2.0
"""ARCHITECTURE.md says what is there: its tree are the folders, its orders of layers are those of the imports."""

import ast
import pathlib
import re
import subprocess

import pytest

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
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True
    )
    if listing.returncode:
        pytest.skip("not a git checkout: the tree is not compared with the files")
    paths = [pathlib.PurePosixPath(line) for line in listing.stdout.splitlines()]
    paths = [p for p in paths if (ROOT / p).is_file() and not p.parts[0].startswith(".")]
    return {"/".join(p.parts[:depth]) for p in paths for depth in (1, 2) if len(p.parts) > depth}


def rows_of_page() -> list[list[str]]:
    """Modules of activestereo by row, lowest first."""
    rows = re.findall(r"^\| \d+ \| ([^|]+) \|", PAGE, re.MULTILINE)
    assert len(rows) > 3, "ARCHITECTURE.md has no rows of modules"
    return [re.findall(r"`(\w+)`", row) for row in rows]


def modules_of_package() -> set[str]:
    files = [path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py") if "__pycache__" not in path.parts]
    return {path.parts[0].removesuffix(".py") for path in files} - BESIDE_THE_LAYERS


class WithoutTypes(ast.NodeTransformer):
    """Drops what only a type checker imports."""

    def visit_If(self, node: ast.If) -> ast.AST | None:
        return None if "TYPE_CHECKING" in ast.unparse(node.test) else self.generic_visit(node)


def imports_of(path: pathlib.Path) -> set[str]:
    """Modules and packages of activestereo that a file imports when it runs, wherever in the file."""
    found = set()
    for node in ast.walk(WithoutTypes().visit(ast.parse(path.read_text(encoding="utf-8"), filename=str(path)))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module == "activestereo":
            names = [f"activestereo.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = [node.module]
        found |= {name.split(".")[1] for name in names if name.startswith("activestereo.")}
    return found


def test_tree_of_the_page_is_the_tree_of_folders():
    assert sorted(tree_of_page()) == sorted(tracked_folders())


def test_every_module_has_its_row():
    assert sorted(name for names in rows_of_page() for name in names) == sorted(modules_of_package())


def test_every_module_imports_only_from_rows_above():
    row_of = {name: number for number, names in enumerate(rows_of_page(), start=1) for name in names}
    seen = []
    for path in PACKAGE.rglob("*.py"):
        own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        for other in imports_of(path) - {own}:
            if own in row_of and row_of[other] >= row_of[own]:
                seen.append(f"{path.relative_to(ROOT)} (row {row_of[own]}) imports {other} (row {row_of[other]})")
    assert not seen


def test_recipes_name_what_exists():
    recipes = PAGE[PAGE.index("## Recipes") :]
    names = re.findall(r"`([\w./]+/[\w./]*\w)`", recipes)
    assert names
    assert not [name for name in names if not any((base / name).exists() for base in (ROOT, PACKAGE))]


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
    readme = (ROOT / "simsense/README.md").read_text(encoding="utf-8")
    block = re.search(r"```layers\n(.*?)```", readme, re.DOTALL)
    assert block, "simsense/README.md has no fenced block called layers"
    layers = [set(re.findall(r"\w+", line.split(":")[0])) for line in block.group(1).splitlines() if line.strip()]
    described = described_folders("simsense/src/")
    rank = {name: number for number, layer in enumerate(layers) for name in layer}
    assert sorted(described) == sorted(rank)
    assert [rank[name] for name in described] == sorted(rank[name] for name in described)


def test_every_subpackage_is_described():
    files = [path.relative_to(PACKAGE) for path in PACKAGE.rglob("*") if path.is_file()]
    inner = {str(f.parent) for f in files if len(f.parts) > 2 and "__pycache__" not in f.parts}
    packages = {name.split("/")[0] for name in inner}
    described = {name for name in described_folders("") if name.split("/")[0] in packages and "/" in name}
    assert described == inner
