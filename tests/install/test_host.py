# SPDX-License-Identifier: Apache-2.0
"""A host that exports every function that another library exports, each ending the program, disturbs neither kuafu nor
simsense, opened with RTLD_LOCAL: its functions may have the names of those in the libraries' own dependencies."""

import os
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build"))

# A wall at z = 2 m that faces the camera, in a format that tinygltf does not read.
WALL = "v -9 -9 2\nv 9 -9 2\nv 9 9 2\nv -9 9 2\nf 1 3 2\nf 1 4 3\n"


def run(*command: object) -> str:
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


def library_path(name: str) -> str:
    lines = [line for line in run("/sbin/ldconfig", "-p").splitlines() if line.strip().startswith(f"{name}.so")]
    if not lines:
        pytest.skip(f"lib {name} is not installed")
    return lines[0].split("=> ")[1]


def exported_functions(name: str) -> list[str]:
    lines = [line.split() for line in run("nm", "-D", "--defined-only", library_path(name)).splitlines()]
    return sorted(
        {
            line[2].split("@")[0]
            for line in lines
            if len(line) == 3 and line[1] == "T" and not line[2].startswith("_ZNSt")
        }
    )


def stubs(names: list[str]) -> str:
    """Assembler text: each name loads its own text as the argument of taken_over and jumps there."""
    lines = [".text"]
    for number, name in enumerate(names):
        lines += [
            f".globl {name}",
            f".type {name},@function",
            f"{name}: lea text{number}(%rip), %rdi",
            "jmp taken_over@PLT",
        ]
    lines.append(".section .rodata")
    lines += [f'text{number}: .asciz "{name}"' for number, name in enumerate(names)]
    return "\n".join([*lines, '.section .note.GNU-stack,"",@progbits', ""])


def in_host(folder: pathlib.Path, names: list[str]) -> subprocess.CompletedProcess:
    (folder / "stubs.s").write_text(stubs(names))
    (folder / "wall.obj").write_text(WALL)
    sources = [ROOT / "tests/install/host.c", folder / "stubs.s"]
    run("cc", "-std=c99", "-rdynamic", *sources, "-I", ROOT / "capi/include", "-ldl", "-lm", "-o", folder / "host")
    libraries = [BUILD / "lib" / f"lib{name}.so.1" for name in ("kuafu", "simsense")]
    return subprocess.run([folder / "host", *libraries, folder / "wall.obj"], capture_output=True, text=True)


@pytest.mark.parametrize(
    "other", ["libembree3", "libassimp", "libpng16", "libjpeg", "libopencv_core", "libopencv_calib3d"]
)
def test_a_host_with_names_of_other_libraries_is_not_disturbed(other, tmp_path):
    if os.uname().machine != "x86_64":
        pytest.skip("the stubs are written in x86-64 assembler")
    names = exported_functions(other)
    assert len(names) > 50, "too few names: the test looks at the wrong library"
    said = in_host(tmp_path, names)
    assert (said.returncode, said.stdout) == (0, "undisturbed\n"), said.stderr
