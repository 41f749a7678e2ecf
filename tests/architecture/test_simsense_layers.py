# SPDX-License-Identifier: Apache-2.0
"""simsense's layers, in the order of simsense/README.md, point one way; both back ends show the same stages."""

import pathlib
import re

import pytest
from source_texts import includes, layers_of_simsense

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCES = ROOT / "simsense" / "src"
STAGES = {"signal", "rectify", "census", "cost", "sgm", "winner", "checks", "refine", "detection"}
STAGES |= {"depth", "registration"}
BACK_ENDS = ("cpu", "vulkan")


def folder_of(path: pathlib.Path) -> str:
    return path.relative_to(SOURCES).parts[0]


def sources() -> list[pathlib.Path]:
    found = [p for p in SOURCES.rglob("*") if p.suffix in {".h", ".cpp"}]
    assert len(found) > 80, "the test looks at the wrong place"
    return found


def included_folders(path: pathlib.Path) -> set[str]:
    """The folders of simsense/src that a source includes."""
    seen = {name.split("/")[0] for name in includes(path) if "/" in name}
    return {folder for folder in seen if (SOURCES / folder).is_dir()}


def test_the_readme_names_every_folder_once() -> None:
    named = [folder for layer in layers_of_simsense(ROOT) for folder in layer]
    assert sorted(named) == sorted({folder_of(p) for p in sources()})


def test_layers_include_only_lower_ones() -> None:
    level = {folder: i for i, layer in enumerate(layers_of_simsense(ROOT)) for folder in layer}
    seen = []
    for path in sources():
        own = folder_of(path)
        above = {f for f in included_folders(path) - {own} if level[f] >= level[own]}
        seen += [f"{path.relative_to(SOURCES)} includes {folder}/" for folder in sorted(above)]
    assert not seen


@pytest.mark.parametrize("back_end", BACK_ENDS)
def test_a_back_end_has_a_folder_for_every_stage(back_end: str) -> None:
    assert STAGES <= {p.name for p in (SOURCES / back_end).iterdir() if p.is_dir()}


def test_back_ends_have_the_same_stems_beside_their_stages() -> None:
    stems = [{p.stem for p in (SOURCES / back_end).glob("*.h")} for back_end in BACK_ENDS]
    assert {"calls", "stages", "matcher", "frame"} <= stems[0] & stems[1]


def test_the_order_of_stages_is_written_in_one_file() -> None:
    """Every stage of the interface stands in one of the lists, and only both back ends run them."""
    interface = (SOURCES / "stages" / "stages.h").read_text()
    order = (SOURCES / "stages" / "stages.cpp").read_text()
    stages = set(re.findall(r"virtual void (\w+)\(\) = 0;", interface))
    assert len(stages) > 8
    assert stages == set(re.findall(r"&Stages::(\w+)", order))
    callers = [p.relative_to(SOURCES).as_posix() for p in sources() if "run_stages(*this" in p.read_text()]
    assert sorted(callers) == ["cpu/stages.cpp", "vulkan/stages.cpp"]


def test_shaders_name_their_choices() -> None:
    """No shader defines by itself a number that C++ has a name for."""
    own = re.compile(r"const uint \w*(?:reason|format|dimension|holes|census_kind)_\w+ = \d+u")
    shaders = [p for p in (ROOT / "simsense" / "shaders").rglob("*") if p.suffix in {".glsl", ".comp"}]
    assert not [p.name for p in shaders if own.search(p.read_text())]
