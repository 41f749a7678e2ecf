# SPDX-License-Identifier: Apache-2.0
"""Programs compiled against earlier headers run on today's libraries; both headers agree on all that both have."""

import os
import pathlib
import re
import subprocess
from collections.abc import Iterable

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build"))
FROZEN = ROOT / "tests/capi/baseline"
TODAY = {name: ROOT / "capi/include" for name in ("ks/effect.h", "kuafu/kuafu.h", "simsense/simsense.h")}
# Names of the source, not of what was compiled.
RENAMED = {"ks_buffer_create": "ks_buffer_create_desc", "KS_TYPE_BUFFER_CREATE": "KS_TYPE_BUFFER_CREATE_DESC"}
MAY_GROW = {"SIMSENSE_FAULTS_PUBLISHED"}

baselines = pytest.mark.parametrize("baseline", sorted(FROZEN.glob("*.h")), ids=lambda path: path.stem)


def run(*command: object) -> str:
    said = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert said.returncode == 0, f"{' '.join(map(str, command))}\n{said.stdout}{said.stderr}"
    return said.stdout


@pytest.mark.parametrize("compiler", [["cc", "-std=c99"], ["c++", "-std=c++17", "-xc++"]], ids=["C99", "C++17"])
@baselines
def test_a_client_of_the_baseline_runs_on_todays_libraries(
    baseline: pathlib.Path, compiler: list[str], tmp_path: pathlib.Path
) -> None:
    link = ["-L", BUILD / "lib", f"-Wl,-rpath,{BUILD / 'lib'}", "-lkuafu", "-lsimsense", "-lm"]
    run(*compiler, "-Werror", baseline.with_suffix(".c"), *link, "-o", tmp_path / "client")
    assert "wall 1" in run(tmp_path / "client")


def printed(headers: Iterable[str], expressions: dict[str, str], folder: pathlib.Path) -> dict[str, tuple[int, ...]]:
    """{name: values} of C expressions, as a compiler sees them behind these headers."""
    lines = [f'#include "{header}"' for header in ("stddef.h", "stdio.h", *headers)]
    lines += ["int main(void) {"]
    for name, values in expressions.items():
        lines += [f'  printf("{name} %lld %lld\\n", (long long)({values.replace(";", "), (long long)(")}));']
    (folder / "printed.c").write_text("\n".join([*lines, "  return 0;", "}"]))
    includes = ["-I", ROOT / "capi/include", "-I", FROZEN]
    run("cc", "-std=c99", *includes, folder / "printed.c", "-lm", "-o", folder / "printed")
    said = [line.split() for line in run(folder / "printed").splitlines()]
    return {name: tuple(map(int, values)) for name, *values in said}


def place(struct: str, field: str) -> str:
    return f"offsetof({struct}, {field}); sizeof((({struct}*)0)->{field})"


@baselines
def test_no_field_has_moved_or_gone(baseline: pathlib.Path, tmp_path: pathlib.Path) -> None:
    # A reserved field may become another one of its size, or lengthen the array that ends where it begins.
    structs = re.findall(r"^typedef struct \w+ \{([^{}]*)\} (\w+);", baseline.read_text(), flags=re.MULTILINE)
    fields = {
        (name, field)
        for body, name in structs
        if not name.endswith("_api")
        for field in re.findall(r"(\w+)\s*(?:\[[^;]*\])?;", body)
    }
    then = printed([baseline.name], {f"{struct}.{field}": place(struct, field) for struct, field in fields}, tmp_path)
    spare = {(name.split(".")[0], at): size for name, (at, size) in then.items() if ".reserved" in name}
    wanted = {(struct, field) for struct, field in fields if not field.startswith("reserved")}
    assert len(wanted) > 200
    today = {f"{struct}.{field}": place(RENAMED.get(struct, struct), field) for struct, field in wanted}
    for name, now in printed(TODAY, today, tmp_path).items():
        at, size = then[name]
        assert now in ((at, size), (at, size + spare.get((name.split(".")[0], at + size), 0))), name


@baselines
def test_no_constant_has_another_value(baseline: pathlib.Path, tmp_path: pathlib.Path) -> None:
    names = set(re.findall(r"\b([A-Z]\w+) = ", baseline.read_text())) - MAY_GROW
    assert len(names) > 150
    then = printed([baseline.name], {name: f"{name}; 0" for name in names}, tmp_path)
    assert printed(TODAY, {name: f"{RENAMED.get(name, name)}; 0" for name in names}, tmp_path) == then


@baselines
@pytest.mark.parametrize("library", ["kuafu", "simsense"])
def test_the_table_of_functions_grew_at_its_end_alone(baseline: pathlib.Path, library: str) -> None:
    def entries(header: pathlib.Path) -> list[str]:
        table = re.search(rf"typedef struct {library}_api \{{([^}}]*)\}}", header.read_text())
        assert table
        text = re.sub(r"/\*.*?\*/", "", table[1])
        return [" ".join(entry.split()) for entry in text.split(";") if "(*" in entry]

    then = [re.sub(r"ks_\w+", lambda old: RENAMED.get(old[0], old[0]), entry) for entry in entries(baseline)]
    assert len(then) > 10
    assert entries(ROOT / "capi/include" / library / "api.h")[: len(then)] == then
