# SPDX-License-Identifier: Apache-2.0
"""Which folder may include or import which, what a library exports, what an engine never does.

Reads #include and import lines of the sources, and the symbol tables of the built libraries (build folder:
$ACTIVESTEREO_BUILD, else build/).
"""

import os
import pathlib
import re
import subprocess
import sys

import pytest
from source_texts import NATIVE_SUFFIXES, imported_packages, includes

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build"))
LIBRARIES = ("kuafu", "simsense")
ENGINE_FOLDERS = ("capi", "kuafu", "simsense")
PRODUCT_FOLDERS = (*ENGINE_FOLDERS, "python")
SOURCE_SUFFIXES = NATIVE_SUFFIXES | {".py", ".pyi", ".sh", ".cmake"}
MAX_LINES = 500
C99_HEADERS = {"stdint.h", "stddef.h", "string.h", "math.h"}

# Written once, when the Vulkan loader or Embree is opened, or when the program's end takes Embree apart.
LOADER_STATE = {
    "open_loader()::opened",
    "embree_library()::opened",
    "::has_ended",
    "new_device()::registered",
    "load_instance_functions(VkInstance_T*)::once",
    "shared_instance(VkInstanceCreateInfo const&)::first",
    "Builders::get()::builders",
}

# Memory of released handles, behind a mutex: it has to outlive every object, or a handle could not be recognised as
# released.
HANDLE_MEMORY = {"Blocks::blocks()::all"}


def sources(folder, suffixes):
    found = [p for p in (ROOT / folder).rglob("*") if p.suffix in suffixes and "__pycache__" not in p.parts]
    assert found, f"no sources under {folder}: the test looks at the wrong place"
    return found


def name_of(path):
    return path.relative_to(ROOT).as_posix()


def code_of(path):
    """The C++ text without comments, string literals and attributes."""
    text = path.read_text()
    text = re.sub(r'"(?:\\.|[^"\\\n])*"', '""', text)
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)
    return re.sub(r"__attribute__\s*\(\(.*?\)\)", "", text)


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def needed_by(path):
    """Names of the shared libraries that a library is linked with."""
    needed = re.findall(r"NEEDED.*\[(.+)\]", run("readelf", "-d", str(path)))
    assert needed
    return needed


@pytest.fixture(params=LIBRARIES)
def library(request):
    path = BUILD / "lib" / f"lib{request.param}.so"
    if not path.exists():
        pytest.skip(f"{path} is not built: set ACTIVESTEREO_BUILD or build into {ROOT / 'build'}")
    return request.param, path


@pytest.mark.parametrize("folder", ["ks", *LIBRARIES])
def test_public_headers_include_only_c99_ks_and_their_own(folder):
    seen = []
    allowed = ("ks/", f"{folder}/")
    for path in sources(f"capi/include/{folder}", {".h"}):
        seen += [f"{name_of(path)}: {i}" for i in includes(path) if i not in C99_HEADERS and not i.startswith(allowed)]
    assert not seen


def test_public_ks_headers_declare_no_function():
    # There is no libks: whatever stands there is static inline.
    prototype = re.compile(r"^(?!typedef|static|#)[\w\s*]+\bks_\w+\s*\([^;{]*\)\s*;", re.MULTILINE)
    assert not [name_of(p) for p in sources("capi/include/ks", {".h"}) if prototype.search(code_of(p))]


def test_bindings_use_only_the_public_headers():
    allowed_folders = {"ks", *LIBRARIES, "pybind11"}
    others = C99_HEADERS | {"cxxabi.h", "unistd.h", "docs.h", "fields.h", "options.h"}  # three by capi/generation
    seen = []
    for path in sources("python", NATIVE_SUFFIXES):
        for include in includes(path):
            parts = pathlib.PurePosixPath(include).parts
            standard = len(parts) == 1 and "." not in include
            own = any((base / include).exists() for base in (path.parent, ROOT / "python"))
            if not (standard or own or parts[0] in allowed_folders or include in others):
                seen.append(f"{name_of(path)}: {include}")
    assert not seen


@pytest.mark.parametrize("folder", PRODUCT_FOLDERS)
def test_product_code_includes_and_imports_no_test_and_no_example(folder):
    closed = {"tests", "examples", "gtest", "gmock", "benchmark", "pytest", "hypothesis", "conftest"}
    seen = []
    for path in sources(folder, NATIVE_SUFFIXES | {".py"}):
        used = (
            imported_packages(path) if path.suffix == ".py" else {part for i in includes(path) for part in i.split("/")}
        )
        seen += [f"{name_of(path)}: {other}" for other in used & closed]
    assert not seen


def test_one_class_renders_captures():
    package = ROOT / "python/activestereo"
    lab = [p for name in ("effects", "compare", "diagnose") for p in (package / name).rglob("*.py")]
    found = {call: [p.stem for p in lab if call in p.read_text()] for call in ("kuafu.Renderer(", "= LoadedScene(")}
    assert found == {"kuafu.Renderer(": ["loaded_scene"], "= LoadedScene(": ["capture_renderer"]}


@pytest.mark.parametrize("folder, other", [("kuafu", "simsense"), ("simsense", "kuafu")])
def test_python_modules_of_the_engines_do_not_import_each_other(folder, other):
    closed = {other, "activestereo"}
    files = sources(f"python/{folder}", {".py"})
    assert not [f"{name_of(p)}: {m}" for p in files for m in imported_packages(p) & closed]


@pytest.mark.parametrize("folder", ENGINE_FOLDERS)
def test_engines_never_print_abort_or_exit(folder):
    forbidden = re.compile(
        r"\b(?:std::)?(printf|fprintf|vprintf|puts|putchar|perror|abort|_?exit|quick_exit|terminate)\s*\("
        r"|\bstd::(cout|cerr|clog)\b"
    )
    seen = []
    for path in sources(folder, {".h", ".cpp", ".inc", ".c"}):
        seen += [f"{name_of(path)}: {match.group().strip()}" for match in forbidden.finditer(code_of(path))]
    assert not seen


def is_generated(text):
    """Files that a script writes from sources that are checked themselves say so below the licence's line."""
    return any("Generated by capi/generation/generate.py" in line for line in text.split("\n", 2)[:2])


def test_no_source_is_longer_than_the_limit():
    folders = [f for f in (*PRODUCT_FOLDERS, "tests", "examples") if (ROOT / f).exists()]
    texts = {name_of(p): p.read_text() for f in folders for p in sources(f, SOURCE_SUFFIXES)}
    lengths = {name: text.count("\n") for name, text in texts.items() if not is_generated(text)}
    assert not {name: length for name, length in lengths.items() if length > MAX_LINES}


def test_libraries_export_exactly_what_their_header_declares(library):
    name, path = library
    symbols = map(str.split, run("nm", "-D", "--defined-only", str(path)).splitlines())
    exported = {symbol.split("@")[0] for _, kind, symbol in symbols if kind != "A"}
    headers = "\n".join(code_of(p) for p in sources(f"capi/include/{name}", {".h"}))
    declared = set(re.findall(rf"{name.upper()}_API[^;(]*?\b({name}_\w+)\s*\(", headers))
    assert declared, "no declaration found: the test reads the header wrongly"
    assert exported == declared


@pytest.mark.parametrize("generator", ["capi/generation/generate.py", "third_party_notes/make_notice.py"])
def test_generated_files_are_up_to_date(generator):
    said = subprocess.run([sys.executable, str(ROOT / generator), "--check"], capture_output=True, text=True)
    assert said.returncode == 0, said.stdout + said.stderr


def test_libraries_export_what_the_frozen_headers_declare_under_its_version(library):
    name, path = library
    frozen = re.search(rf"struct {name}_api \{{([^}}]*)", (ROOT / "tests/capi/baseline/1.0.h").read_text())[1]
    promised = {f"{name}_{entry}" for entry in re.findall(r"\(\*(\w+)\)", frozen)}
    table = run("nm", "-D", "--defined-only", "--with-symbol-versions", str(path))
    exported = dict(re.findall(r" [TR] (\w+)@@(\w+\.\w+)", table.replace(f"{name.upper()}_", "")))
    assert len(promised) > 10 and promised <= {symbol for symbol, version in exported.items() if version == "1.0"}


def test_libraries_link_neither_vulkan_nor_each_other_and_simsense_highway_alone(library):
    name, path = library
    closed = ("libvulkan", "libcuda", *(f"lib{other}." for other in LIBRARIES if other != name))
    assert not [n for n in needed_by(path) if n.startswith(closed)]
    runtime = ("libhwy.", "libstdc++.", "libm.", "libgcc_s.", "libc.", "ld-linux")
    assert name != "simsense" or not [n for n in needed_by(path) if not n.startswith(runtime)]


def test_readers_of_untrusted_files_stay_out_of_the_libraries(library):
    # They run in helper programs (kuafu/import), so that neither their faults nor their symbols reach the host.
    _, path = library
    readers = ("libassimp", "libpng", "libjpeg", "libz.", "libturbojpeg", "libwebp", "libdraco", "libmeshoptimizer")
    assert not [n for n in needed_by(path) if n.startswith(readers)]
    names = run("nm", "--demangle", str(path)) + run("nm", "-D", "--demangle", str(path))
    theirs = r"Assimp::|\bai[A-Z]\w+|\bpng_\w+|\bjpeg_\w+|\bstbi_\w+|tinygltf::|\bWebP\w+|draco::|meshopt_\w+"
    seen = re.search(theirs, names)
    assert not seen, seen.group()


def test_libraries_hold_no_mutable_global_state(library):
    name, path = library
    text = "\n".join(code_of(p) for folder in ("capi/device", name) for p in sources(folder, {".h", ".cpp"}))
    # GCC 12 puts some constexpr arrays of pointers into .data.
    constants = set(re.findall(r"\bconstexpr\b[^;={(]*?\b(\w+)(?:\[\w*\])?\s*[={]", text))
    seen = []
    for line in run("objdump", "--syms", "--demangle", str(path)).splitlines():
        match = re.search(r"\sO (\.data|\.bss)\s+[0-9a-f]+\s+(?:\.hidden )?(.+)$", line)
        if not match or not re.match(r"(ks|kuafu|simsense)::", match.group(2).removeprefix("guard variable for ")):
            continue
        symbol = match.group(2)
        if symbol.split("::")[-1] not in constants and not symbol.endswith(tuple(LOADER_STATE | HANDLE_MEMORY)):
            seen.append(symbol)
    assert not seen
