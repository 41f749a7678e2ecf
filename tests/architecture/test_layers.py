# SPDX-License-Identifier: Apache-2.0
"""The folders of kuafu include one another in one direction only: kuafu/README.md has the order and the edges."""

import pathlib
import re

import pytest
from source_texts import includes

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCES = ROOT / "kuafu" / "src"
SHADERS = ROOT / "kuafu" / "shaders"
IMPORT = ROOT / "kuafu" / "import"
SHADER_ORDER = ("shared", "lib", "stage", "entry")
ROW = re.compile(r"^\| `(\w+)` \| [^|]+ \|([^|]*)\|$", re.MULTILINE)


def documented_layers() -> dict[str, list[str]]:
    """Folders in the page's order, each with those that it includes."""
    page = (ROOT / "kuafu" / "README.md").read_text()
    return {folder: re.findall(r"`(\w+)`", included) for folder, included in ROW.findall(page)}


def folders_of(root: pathlib.Path) -> set[str]:
    return {path.name for path in root.iterdir() if path.is_dir()}


def included_folders(folder: pathlib.Path, others: set[str]) -> dict[str, list[str]]:
    """Those of `others` that files of `folder` include, with the lines that do."""
    found: dict[str, list[str]] = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        for included in includes(path):
            other = included.split("/")[0]
            if other in others:
                found.setdefault(other, []).append(f"{path.relative_to(ROOT)} includes {included}")
    return found


def sources_with(pattern: str, root: pathlib.Path) -> list[str]:
    return [path.name for path in root.rglob("*.*") if re.search(pattern, path.read_text(), re.MULTILINE)]


LAYERS = documented_layers()


def test_the_page_names_every_folder() -> None:
    assert set(LAYERS) == folders_of(SOURCES)


def test_layers_point_one_way() -> None:
    order = list(LAYERS)
    edges = [(order.index(folder), order.index(other)) for folder in order for other in LAYERS[folder]]
    assert not [f"{order[lower]} -> {order[upper]}" for lower, upper in edges if upper >= lower]


@pytest.mark.parametrize("folder", LAYERS)
def test_a_folder_includes_what_the_page_says(folder: str) -> None:
    found = included_folders(SOURCES / folder, folders_of(SOURCES) - {folder})
    assert not [line for other, lines in found.items() if other not in LAYERS[folder] for line in lines]
    assert set(LAYERS[folder]) == set(found), "the page names a folder that is not included"


def test_helper_programs_know_the_scene_and_its_files_alone() -> None:
    assert set(included_folders(IMPORT, folders_of(SOURCES))) == {"scene", "io"}


@pytest.mark.parametrize("folder", SHADER_ORDER)
def test_shaders_point_one_way(folder: str) -> None:
    assert set(SHADER_ORDER) == folders_of(SHADERS)
    above = set(SHADER_ORDER[SHADER_ORDER.index(folder) + 1 :])
    assert not [line for lines in included_folders(SHADERS / folder, above).values() for line in lines]


def test_shaders_know_no_infrared_fields() -> None:
    """The band is resolved where records are made (frame/band.h): a record has one value of each quantity."""
    assert not sources_with(r"\bir_[a-z]", SHADERS)


def test_no_class_opens_its_private_parts_to_another() -> None:
    assert not sources_with(r"^\s*friend\s", SOURCES)
