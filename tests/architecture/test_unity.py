# SPDX-License-Identifier: Apache-2.0
"""Sources of the product may be compiled as one (ACTIVESTEREO_UNITY): they share no name, no macro changes a header.
All sources of a target, as the build folder has them ($ACTIVESTEREO_BUILD, else build/), are held against each other,
since each new source shifts what is compiled with what."""

import collections
import json
import os
import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build")).resolve()
APART = re.compile(
    r"set_source_files_properties\(([^)]*?) PROPERTIES[^)]*(?:SKIP_UNITY_BUILD_INCLUSION|COMPILE_OPTIONS)"
)
UNNAMED = re.compile(r"^namespace \{$(.*?)^\}  // namespace$", re.MULTILINE | re.DOTALL)
# A definition begins in the first column; its parameters tell a function from others of its name.
DEFINITION = re.compile(
    r"^(?!\s|//|#|template|\}|using|static_assert)[^\n;{(=]*?\b(\w+)(?:\[[^\]\n]*\])*(?: final)?"
    r"(?: = |;|\{| \{| : |\(([^{;]*?)\)[^{;]*\{)",
    re.MULTILINE,
)
MACRO_OF_A_HEADER = re.compile(r"^#define (\w+)(?:.*\n)+?#include .*(?<!\.inc\")$", re.MULTILINE)


def united_sources() -> dict[str, list[pathlib.Path]]:
    """Each target's sources but for those that are compiled apart; tests are not united."""
    apart = set()
    for script in [*ROOT.glob("[cks]*/CMakeLists.txt"), *ROOT.glob("kuafu/import/CMakeLists.txt")]:
        for names in APART.findall(script.read_text()):
            apart |= {script.parent / name for name in names.split()}
    targets = collections.defaultdict(list)
    for command in json.loads((BUILD / "compile_commands.json").read_text()):
        compiled = pathlib.Path(command["file"])
        sources = [compiled]
        if compiled.name.startswith("unity_") and compiled.exists():
            sources = [pathlib.Path(name) for name in re.findall(r'#include "(.+)"', compiled.read_text())]
        for source in sources:
            folder = source.relative_to(ROOT).parts[0] if ROOT in source.parents else "build"
            is_product = source.suffix == ".cpp" and folder in ("capi", "kuafu", "simsense", "python")
            if is_product and source not in apart and source.exists():  # a build folder may be older than the sources
                targets[re.search(r" -o \S*CMakeFiles/(\w[\w-]*)\.dir/", command["command"])[1]].append(source)
    return targets


SOURCES = united_sources()


def test_sources_are_found() -> None:
    assert {"ks_device", "kuafu_core", "kuafu_import_gltf", "simsense_core"} <= set(SOURCES)


@pytest.mark.parametrize("target", SOURCES)
def test_no_two_sources_define_one_name(target: str) -> None:
    places = collections.defaultdict(set)
    for source in SOURCES[target]:
        text = source.read_text()
        namespace = re.search(r"^namespace ([\w:]+) \{", text, re.MULTILINE)
        for body in UNNAMED.findall(text):
            for name, parameters in DEFINITION.findall(body):
                places[namespace and namespace[1], name, " ".join(parameters.split())].add(source.name)
    assert not {name: found for name, found in places.items() if len(found) > 1}


@pytest.mark.parametrize("target", SOURCES)
def test_a_macro_that_changes_a_header_is_in_a_source_apart(target: str) -> None:
    """Where the header was read before, the macro does nothing: tiny_gltf.h's functions came from another library."""
    found = [(path.name, macro) for path in SOURCES[target] for macro in MACRO_OF_A_HEADER.findall(path.read_text())]
    assert not found, "SKIP_UNITY_BUILD_INCLUSION in the target's CMakeLists.txt compiles a source apart"
