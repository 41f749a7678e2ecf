# SPDX-License-Identifier: Apache-2.0
"""The installation works where it lies: pkg-config, find_package, after a move, add_subdirectory, FetchContent."""

import os
import pathlib
import re
import shutil
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build"))
CLIENTS = ROOT / "examples/clients"
STRICT = ("-Wall", "-Wextra", "-Werror", "-pedantic")


def run(*command: object, **variables: object) -> str:
    environment = os.environ | {name: str(value) for name, value in variables.items()}
    said = subprocess.run([str(word) for word in command], capture_output=True, text=True, env=environment)
    assert said.returncode == 0, f"{' '.join(map(str, command))}\n{said.stdout}{said.stderr}"
    return said.stdout


@pytest.fixture(scope="module")
def moved_prefix(tmp_path_factory):
    """An installed tree that was moved after cmake --install."""
    first = tmp_path_factory.mktemp("installed") / "first"
    run("cmake", "--install", BUILD, "--prefix", first)
    return pathlib.Path(shutil.move(first, first.with_name("moved")))


def pkg_config(prefix: pathlib.Path) -> list[str]:
    return run(
        "pkg-config", "--cflags", "--libs", "kuafu", "simsense", PKG_CONFIG_PATH=prefix / "lib/pkgconfig"
    ).split()


@pytest.mark.parametrize("language", ["c99", "c++17"])
def test_headers_please_clang_with_every_cast_visible(tmp_path: pathlib.Path, language: str) -> None:
    """GCC says nothing about C's casts inside extern "C"; clang does."""
    if shutil.which("clang++") is None:
        pytest.skip("clang is not installed: apt-get install clang")
    endings = (".h",) if language == "c99" else (".h", ".hpp")
    headers = sorted(p for p in (ROOT / "capi/include").rglob("*") if p.suffix in endings)
    assert len(headers) > 15
    all_of_them = tmp_path / ("all.c" if language == "c99" else "all.cpp")
    all_of_them.write_text("".join(f'#include "{p.relative_to(ROOT / "capi/include")}"\n' for p in headers))
    casts = ["-Wold-style-cast"] if language == "c++17" else []
    compiler = "clang" if language == "c99" else "clang++"
    run(
        compiler, f"-std={language}", *STRICT, *casts, "-Wno-unused-function", f"-I{ROOT}/capi/include",
        "-fsyntax-only", all_of_them,
    )  # fmt: skip


def test_components_hold_what_they_are_named_for(tmp_path):
    expected = {
        "kuafu": {"lib/libkuafu.so.1", "lib/kuafu/kuafu-import-gltf"},
        "simsense": {"lib/libsimsense.so.1"},
        "dev": {
            "lib/libkuafu.so",
            "include/ks/header.h",
            "include/simsense/simsense.h",
            "lib/cmake/kuafu/kuafu-config.cmake",
        },
    }
    for component, names in expected.items():
        run("cmake", "--install", BUILD, "--prefix", tmp_path / component, "--component", component)
        held = {path.relative_to(tmp_path / component).as_posix() for path in (tmp_path / component).rglob("*")}
        assert names <= held
        assert not any(held & others for other, others in expected.items() if other != component)


def test_nothing_installed_knows_where_it_was_built(moved_prefix):
    text_files = [p for p in moved_prefix.rglob("*") if p.suffix in (".cmake", ".pc", ".h", ".hpp")]
    assert len(text_files) > 20
    assert not [p for p in text_files if str(ROOT) in p.read_text() or "/first" in p.read_text()]
    for library in moved_prefix.glob("lib/*.so"):
        assert "RUNPATH" not in run("readelf", "-d", library)


SCENE = CLIENTS / "wall_and_board.obj"


@pytest.mark.parametrize("name, said", [("first_depth", "wall 1."), ("zero_copy", "wall 1")])
def test_c99_client_by_pkg_config(moved_prefix, tmp_path, name, said):
    run("cc", "-std=c99", *STRICT, CLIENTS / f"{name}.c", *pkg_config(moved_prefix), "-lm", "-o", tmp_path / "client")
    assert said in run(tmp_path / "client", SCENE, LD_LIBRARY_PATH=moved_prefix / "lib")


def test_cpp17_client_by_find_package(moved_prefix, tmp_path):
    run(
        "cmake", "-S", CLIENTS, "-B", tmp_path, f"-DCMAKE_PREFIX_PATH={moved_prefix}",
        f"-DCMAKE_CXX_FLAGS={' '.join(STRICT)}",
    )  # fmt: skip
    run("cmake", "--build", tmp_path)
    assert "wall 1." in run(tmp_path / "first_depth", SCENE)


@pytest.mark.parametrize("library, older", [("kuafu", "0.1"), ("simsense", "0.3")])
def test_other_versions_are_refused(moved_prefix, tmp_path, library, older):
    (tmp_path / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.16)\nproject(p NONE)\nfind_package({library} {older} REQUIRED)\n"
    )
    said = subprocess.run(
        ["cmake", "-S", tmp_path, "-B", tmp_path / "b", f"-DCMAKE_PREFIX_PATH={moved_prefix}"],
        capture_output=True,
        text=True,
    )
    assert said.returncode != 0
    assert "0.2.0" in said.stderr


def test_project_that_takes_this_one_in(tmp_path):
    """Configures all and compiles a file of each library; ACTIVESTEREO_FULL=1 builds and runs a program."""
    launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    run(
        "cmake", "-S", ROOT / "tests/install/subdirectory", "-B", tmp_path, "-G", "Ninja",
        f"-DACTIVESTEREO_SOURCE={ROOT}", *launcher, "-DCMAKE_BUILD_TYPE=Debug", "-DCMAKE_CXX_FLAGS=-O0 -g0",
    )  # fmt: skip
    assert "libkuafu.so" in run("ninja", "-C", tmp_path, "-t", "commands", "kuafu")
    for library in ("kuafu", "simsense"):
        made = tmp_path / f"activestereo/{library}/CMakeFiles/{library}.dir/src/api/device.cpp.o"
        made.parent.mkdir(parents=True, exist_ok=True)
        compiles = run("ninja", "-C", tmp_path, "-t", "commands", made.relative_to(tmp_path)).splitlines()[-1]
        subprocess.run(compiles, shell=True, cwd=tmp_path, check=True)
        assert made.exists()
    if os.environ.get("ACTIVESTEREO_FULL"):
        run("cmake", "--build", tmp_path, "--target", "client")
        assert run(tmp_path / "client") == "simsense 100\n"


def test_project_that_fetches_this_one(tmp_path: pathlib.Path) -> None:
    """FetchContent makes the same targets; what they build to is shown by the test above."""
    run("cmake", "-S", ROOT / "tests/install/subdirectory", "-B", tmp_path, "-G", "Ninja", "-DBY_FETCH_CONTENT=ON",
        f"-DACTIVESTEREO_SOURCE={ROOT}")  # fmt: skip
    commands = run("ninja", "-C", tmp_path, "-t", "commands", "client")
    assert "libsimsense.so" in commands
    assert f"-I{ROOT}/capi/include" in commands


def test_debian_packages_name_what_they_need(tmp_path):
    if shutil.which("dpkg-shlibdeps") is None:
        pytest.skip("dpkg-shlibdeps is not installed: apt-get install dpkg-dev")
    run("cpack", "--config", BUILD / "CPackConfig.cmake", "-G", "DEB", "-B", tmp_path)
    needs = {path.name.split("_")[0]: run("dpkg-deb", "-f", path, "Depends").strip() for path in tmp_path.glob("*.deb")}
    # Debian policy, 8.1: libkuafu.so.1 is in libkuafu1.
    names = {library: run("objdump", "-p", BUILD / f"lib/lib{library}.so") for library in ("kuafu", "simsense")}
    names = {library: re.search(r"SONAME\s+(\S+)", said)[1].replace(".so.", "") for library, said in names.items()}
    assert set(needs) == {*names.values(), "libactivestereo-dev"}
    assert "libembree3-3" in needs[names["kuafu"]]
    assert "libhwy1" in needs[names["simsense"]]
    assert needs["libactivestereo-dev"] == ", ".join(f"{name} (= 0.2.0)" for name in names.values())
    for library, name in names.items():
        package = next(tmp_path.glob(f"{name}_*.deb"))
        held = run("dpkg-deb", "-c", package)
        assert f"./usr/lib/lib{library}.so.{name[-1]}" in held and f"./usr/share/doc/{name}/copyright" in held
        for field in ("Replaces", "Breaks"):
            assert run("dpkg-deb", "-f", package, field).strip() == f"lib{library}0"


def test_rust_client(moved_prefix, tmp_path):
    rustc = shutil.which("rustc")
    if rustc is None:
        pytest.skip("rustc is not installed: apt-get install rustc")
    library, program = moved_prefix / "lib", tmp_path / "first_depth.rs"
    shutil.copy(moved_prefix / "share/activestereo/interface.rs", tmp_path)
    shutil.copy(CLIENTS / program.name, program)
    run(rustc, "--edition", "2021", "-D", "warnings", "-L", library, program, "-o", tmp_path / "client")
    assert "wall 1." in run(tmp_path / "client", SCENE, LD_LIBRARY_PATH=library)


def test_ctypes_client(moved_prefix):
    found = {"LD_LIBRARY_PATH": moved_prefix / "lib", "PYTHONPATH": moved_prefix / "share/activestereo"}
    assert "wall 1." in run("/usr/bin/python3", CLIENTS / "first_depth.py", SCENE, **found)
