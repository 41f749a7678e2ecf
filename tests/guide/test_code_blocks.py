# SPDX-License-Identifier: Apache-2.0
"""Every code block on every page of the documentation site is run, in a folder that looks like the repository's root.

A block in `sh`, `python`, `c`, `cpp`, `rust` or `cmake` is a program. `toml` and `json` must parse. `text`, `tree`
and `layers` are pictures. Commands that build or test the whole project, need other machines, or take hours are
looked at instead: SPECIAL says how each is, and the test prints it (-rP).
"""

import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tomllib

import pytest

from contexts import FILES, NAMES

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples/guide"))
import gather  # noqa: E402

BUILD = pathlib.Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build")).resolve()
DATA = pathlib.Path(os.environ.get("ACTIVESTEREO_DATA", ROOT.parent / "shared")) / "data"
PAGES = gather.page_names(gather.CONFIG.read_text())
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PICTURES = {"text", "tree", "layers"}
PARSED = "from activestereo.cli import make_parser; import sys; make_parser().parse_args(sys.argv[1:])"

# Beginning of a command: what is run instead of it, given its words, and why.
SPECIAL: dict[str, tuple[str, str]] = {
    r"bash (tests|examples|capi|python)/": ("bash -n {1}", "it builds or tests it all; its syntax is checked"),
    r"ninja |ctest |cmake --build|cpack": ("true", "it builds or tests the whole project"),
    r"cmake -S|pip wheel": ("true", "it builds the whole project; tests/static_embree.sh does the same from a build"),
    r"build/bin/fuzz_\w+": ("test -n {0}", "ctest runs the fuzzing programs"),
    r"build/bin/kuafu_\w+_tests": ("test -n {0}", "it is a test of its own"),
    r"python3 tests/benchmark_suite/hide_in_images.py": ("test -f {1}", "it needs a capture; its own test runs it"),
    r"/usr/bin/python3 -m pytest": ("test -f {4}", "it is a test of its own; its file is there"),
    r"bench_\w+": ("test -x build/bin/{0}", "benchmarks are run by hand; the program is there"),
    r"/usr/bin/python3 \S+/((bench|run|train)_\w+|noisy_planes).py": ("test -f {1}", "it is run by hand; it is there"),
    r"pip install|pre-commit|sudo|apt-get": ("true", "it installs packages; tests/wheel.sh tries the wheel"),
    r"python3 -m venv|out/clean/bin/": ("true", "it needs a wheel; python/wheels.sh runs the same lines"),
    r"python3 examples/(gbuffers|mani_skill_depth|mujoco_wrist|sapien_sensor)/":
        ("test -f {1}", "it needs a package that Debian lacks; tests/guide/test_examples.py runs it where it is"),
    r"/usr/bin/python3 examples/notebooks/run.py": ("test -f {1}", "it runs the pages of the notebooks, as tests do"),
    r"rs-enumerate-devices": ("true", "it needs a RealSense camera"),
    r"/usr/bin/python3 examples/real_camera/":
        ("test -f {1}", "it renders for minutes; tests/python/calibrate/test_afternoon.py runs the page"),
    r"activestereo (simulate|model show|pair) out/(desk|model|practice)":
        (f"/usr/bin/python3 -c '{PARSED}' {{1:}}", "tests/python/calibrate/test_afternoon.py runs the page"),
    r"activestereo simulate": ("{0} {1:} --spp 1", "as few samples as possible"),
    r"activestereo (calibrate|import|compare|diagnose|view)":
        (f"/usr/bin/python3 -c '{PARSED}' {{1:}}", "it needs a capture; its options are parsed"),
    r"activestereo generate":
        (f"/usr/bin/python3 -c '{PARSED}' {{1:}}", "it needs files of things; its options are parsed"),
    r"/usr/bin/python3 examples/gallery/gallery.py":
        ("{0} {1} --only lambert --spp 1 --out out", "it renders every picture; here it renders one"),
}  # fmt: skip
SLOW = "examples/hidden_effect/README.md"


def blocks_of(page: str) -> list[tuple[str, str]]:
    """Language and text of each block, with the included ones."""
    return BLOCK.findall(gather.with_includes(ROOT / page))


def programs(language: str) -> list[str]:
    """The pages with programs in a language; the first page's Python is run by tests/python/cli/test_readme.py."""
    pages = [page for page in PAGES if (language, page) != ("python", "README.md")]
    return [page for page in pages if any(kind == language for kind, _ in blocks_of(page))]


@pytest.fixture
def root(tmp_path: pathlib.Path, request: pytest.FixtureRequest) -> pathlib.Path:
    """A folder that looks like the repository's root, with what the page takes for granted."""
    for name in ("capi", "examples", "kuafu", "python", "simsense", "tests", "CMakeLists.txt"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / "build").symlink_to(BUILD)
    (tmp_path / "wall_and_board.obj").symlink_to(ROOT / "examples/clients/wall_and_board.obj")
    for name in ("interface.py", "interface.rs"):
        (tmp_path / name).symlink_to(BUILD / "generated/clients" / name)
    (tmp_path / "out").mkdir()
    if DATA.is_dir():
        (tmp_path / "DATA").symlink_to(DATA)
    page = request.getfixturevalue("page")
    if page == SLOW and not os.environ.get("ACTIVESTEREO_FULL"):
        pytest.skip("it takes minutes: ACTIVESTEREO_FULL=1 runs it")
    if page in FILES:
        FILES[page](tmp_path)
    return tmp_path


def run(command: list[str], folder: pathlib.Path) -> str:
    variables = {"PYTHONPATH": str(BUILD / "python"), "LD_LIBRARY_PATH": str(BUILD / "lib"), "MPLBACKEND": "Agg",
                 "PATH": f"{BUILD / 'bin'}:{os.environ['PATH']}"}  # fmt: skip
    said = subprocess.run(command, cwd=folder, env=os.environ | variables, capture_output=True, text=True, timeout=600)
    assert said.returncode == 0, f"{' '.join(command)[:2000]}\n{said.stdout}{said.stderr}"
    return said.stdout


def as_run_here(line: str) -> str:
    """A line of shell, or what is run in its place."""
    assignments = re.match(r"(?:[A-Z_]+=\S+ )*", line)
    assert assignments is not None
    command = line[assignments.end() :]
    for pattern, (instead, reason) in SPECIAL.items():
        if re.match(pattern, command):
            words = shlex.split(command, comments=True)
            print(f"{command}: {reason}")
            return instead.replace("{1:}", shlex.join(words[1:])).format(*words)
    return line


def assert_depths_are_right(said: str) -> None:
    """The wall at 1.5 m and the board at 0.8 m are measured within 3 %: a step of a tenth of a pixel and its noise."""
    found = re.fullmatch(r"wall ([\d.]+) m, board ([\d.]+) m\n", said)
    assert found, said
    assert [float(text) for text in found.groups()] == pytest.approx([1.5, 0.8], rel=0.03)


def test_first_programs_have_80_lines() -> None:
    programs = list((ROOT / "examples/clients").glob("first_depth.*"))
    assert {path.suffix for path in programs} == {".c", ".cpp", ".py", ".rs"}
    assert not [path.name for path in programs if len(path.read_text().splitlines()) > 80]


def test_every_block_says_its_language() -> None:
    known = PICTURES | {"sh", "python", "c", "cpp", "rust", "cmake", "toml", "json"}
    assert len(PAGES) > 20
    assert not [(page, text[:80]) for page in PAGES for kind, text in blocks_of(page) if kind not in known]


@pytest.mark.parametrize("page", programs("json"))
def test_json(page: str) -> None:
    assert all(json.loads(text) for kind, text in blocks_of(page) if kind == "json")


@pytest.mark.parametrize("page", programs("toml"))
def test_toml(page: str) -> None:
    assert all(tomllib.loads(text) for kind, text in blocks_of(page) if kind == "toml")


@pytest.mark.parametrize("page", programs("python"))
def test_python(page: str, root: pathlib.Path) -> None:
    """The blocks of a page follow each other in one program; a whole program that a page includes runs by itself."""
    texts = [text for kind, text in blocks_of(page) if kind == "python"]
    texts = [re.sub(r"samples_per_pixel=\d\d+", "samples_per_pixel=2", text) for text in texts]
    for number, text in enumerate(texts):
        if "__main__" in text:
            (root / "program.py").write_text(text)
            assert_depths_are_right(run(["/usr/bin/python3", "program.py"], root))
            texts[number] = ""
    (root / "blocks.py").write_text("\n".join([NAMES.get(page, ""), *texts]))
    run(["/usr/bin/python3", "blocks.py"], root)


@pytest.mark.parametrize("page", programs("sh"))
def test_sh(page: str, root: pathlib.Path) -> None:
    text = "\n".join(text for kind, text in blocks_of(page) if kind == "sh").replace("\\\n", " ")
    if "DATA/d435-real" in text and not (root / "DATA/d435-real").is_dir():
        pytest.skip(f"no real D435 pair at {DATA}; set ACTIVESTEREO_DATA to the folder that holds data/d435-real")
    if "cmake --install" in text and not (BUILD / "cmake_install.cmake").exists():
        pytest.skip(f"{BUILD} is no CMake build")
    lines = [as_run_here(line) for line in text.splitlines() if line.strip()]
    run(["bash", "-euc", "\n".join(lines)], root)


@pytest.mark.parametrize("page", sorted({*programs("c"), *programs("cpp")}))
def test_c_and_cpp(page: str, root: pathlib.Path) -> None:
    for kind, text in blocks_of(page):
        if kind in ("c", "cpp"):
            (root / f"program.{kind}").write_text(text)
            compiler = ["cc", "-std=c99"] if kind == "c" else ["c++", "-std=c++17"]
            libraries = ["-Icapi/include", "-Lbuild/lib", "-lkuafu", "-lsimsense", "-lm"]
            strict = ["-Wall", "-Wextra", "-Werror", "-pedantic"]
            run([*compiler, *strict, f"program.{kind}", *libraries, "-o", "program"], root)
            assert_depths_are_right(run(["./program"], root))


@pytest.mark.parametrize("page", programs("rust"))
def test_rust(page: str, root: pathlib.Path) -> None:
    rustc = shutil.which("rustc")
    if rustc is None:
        pytest.skip("rustc is not installed: apt-get install rustc")
    for kind, text in blocks_of(page):
        if kind == "rust":
            (root / "program.rs").write_text(text)
            run([rustc, "--edition", "2021", "-D", "warnings", "-L", "build/lib", "program.rs"], root)
            assert_depths_are_right(run(["./program"], root))


@pytest.mark.parametrize("page", programs("cmake"))
def test_cmake(page: str, root: pathlib.Path) -> None:
    """The block is configured against an installed tree, as lines of a project that has one program."""
    if not (BUILD / "cmake_install.cmake").exists():
        pytest.skip(f"{BUILD} is no CMake build")
    run(["cmake", "--install", str(BUILD), "--prefix", "out/prefix"], root)
    for number, (kind, text) in enumerate(blocks_of(page)):
        if kind == "cmake":
            project = root / f"project{number}"
            project.mkdir()
            shutil.copy(ROOT / "examples/clients/first_depth.cpp", project / "app.cpp")
            head = (
                ""
                if "project(" in text
                else "cmake_minimum_required(VERSION 3.16)\nproject(app LANGUAGES CXX)\nadd_executable(app app.cpp)\n"
            )
            (project / "CMakeLists.txt").write_text(head + text.replace("first_depth.cpp", "app.cpp"))
            run(
                ["cmake", "-S", str(project), "-B", str(project / "b"), f"-DCMAKE_PREFIX_PATH={root / 'out/prefix'}"],
                root,
            )
