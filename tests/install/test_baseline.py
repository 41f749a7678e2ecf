# SPDX-License-Identifier: Apache-2.0
"""Programs that were compiled against the headers of an earlier version run on today's libraries, and the headers then
and now agree on every field that both have."""

import os
import pathlib
import re
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build"))
BASELINES = sorted(path.parent for path in (ROOT / "tests/capi/baseline").glob("*/client.c"))
RENAMED = {"ks_buffer_create": "ks_buffer_create_desc"}  # structs: names of the source, not of what was compiled

LAYOUT = """\
#include <stddef.h>
#include <stdio.h>
#include "ks/effect.h"
#include "kuafu/kuafu.h"
#include "simsense/simsense.h"
int main(void) {{
{lines}
  return 0;
}}
"""


def run(*command: object) -> str:
    said = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert said.returncode == 0, f"{' '.join(map(str, command))}\n{said.stdout}{said.stderr}"
    return said.stdout


CXX = ["c++", "-std=c++17", "-xc++", "-include", "kuafu/kuafu.hpp", "-include", "simsense/simsense.hpp"]


@pytest.mark.parametrize("compiler", [["cc", "-std=c99"], CXX], ids=["C99", "C++17"])
@pytest.mark.parametrize("baseline", BASELINES, ids=lambda path: path.name)
def test_a_client_of_the_baseline_runs_on_todays_libraries(
    baseline: pathlib.Path, compiler: list[str], tmp_path: pathlib.Path
) -> None:
    link = ["-L", BUILD / "lib", f"-Wl,-rpath,{BUILD / 'lib'}", "-lkuafu", "-lsimsense", "-lm"]
    run(*compiler, "-Werror", "-I", baseline / "include", baseline / "client.c", *link, "-o", tmp_path / "client")
    assert "wall 1" in run(tmp_path / "client")


def fields(include: pathlib.Path) -> set[tuple[str, str]]:
    """(struct, field) of every public struct."""
    found = set()
    for header in include.glob("*/*.h"):
        text = re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.DOTALL)
        for body, name in re.findall(r"typedef struct \w+ \{([^{}]*)\} (\w+);", text):
            if not name.endswith("_api"):
                found |= {(name, field) for field in re.findall(r"(\w+)\s*(?:\[[^;]*\])?;", body)}
    return found


def layout(include: pathlib.Path, wanted: set[tuple[str, str]], folder: pathlib.Path) -> dict[str, str]:
    """{struct.field: offset and size} as a compiler sees it."""
    line = '  printf("{0}.{1} %zu %zu\\n", offsetof({0}, {1}), sizeof((({0}*)0)->{1}));'
    (folder / "layout.c").write_text(LAYOUT.format(lines="\n".join(line.format(*field) for field in sorted(wanted))))
    run("cc", "-std=c99", "-I", include, folder / "layout.c", "-lm", "-o", folder / "layout")
    return dict(line.split(" ", 1) for line in run(folder / "layout").splitlines())


@pytest.mark.parametrize("baseline", BASELINES, ids=lambda path: path.name)
def test_no_field_has_moved_or_gone(baseline: pathlib.Path, tmp_path: pathlib.Path) -> None:
    # A reserved field may become another one of its size, or lengthen the array that ends where it begins.
    there = fields(baseline / "include")
    wanted = {(struct, field) for struct, field in there if not field.startswith("reserved")}
    assert len(wanted) > 200
    then = {name: tuple(map(int, text.split())) for name, text in layout(baseline / "include", there, tmp_path).items()}
    spare = {(name.split(".")[0], at): size for name, (at, size) in then.items() if ".reserved" in name}
    old_names = {new: old for old, new in RENAMED.items()}
    today_wanted = {(RENAMED.get(struct, struct), field) for struct, field in wanted}
    for new_name, text in layout(ROOT / "capi/include", today_wanted, tmp_path).items():
        struct, field = new_name.split(".")
        name = f"{old_names.get(struct, struct)}.{field}"
        (at, size), today = then[name], tuple(map(int, text.split()))
        assert today in ((at, size), (at, size + spare.get((name.split(".")[0], at + size), 0))), name


@pytest.mark.parametrize("baseline", BASELINES, ids=lambda path: path.name)
@pytest.mark.parametrize("library", ["kuafu", "simsense"])
def test_the_table_of_functions_grew_at_its_end_alone(baseline: pathlib.Path, library: str) -> None:
    def entries(include: pathlib.Path) -> list[str]:
        return re.findall(r"^  .*\(\*\w+\)\(.*;$", (include / library / "api.h").read_text(), flags=re.MULTILINE)

    then = [re.sub(r"ks_\w+", lambda old: RENAMED.get(old[0], old[0]), line) for line in entries(baseline / "include")]
    assert len(then) > 10
    assert entries(ROOT / "capi/include")[: len(then)] == then
