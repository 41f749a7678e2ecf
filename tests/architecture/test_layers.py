"""The folders of kuafu include one another in one direction only: the order and the edges are those of kuafu/README.md."""

import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCES = ROOT / "kuafu" / "src"
SHADERS = ROOT / "kuafu" / "shaders"
SHADER_ORDER = ("shared", "lib", "stage", "entry")
ROW = re.compile(r"^\| `(\w+)` \| [^|]+ \|([^|]*)\|$", re.MULTILINE)


def documented_layers() -> dict[str, list[str]]:
    """Folders in the page's order, each with those that it includes."""
    page = (ROOT / "kuafu" / "README.md").read_text()
    return {folder: re.findall(r"`(\w+)`", included) for folder, included in ROW.findall(page)}


def folders_of(root: pathlib.Path) -> set[str]:
    return {path.name for path in root.iterdir() if path.is_dir()}


def included_folders(root: pathlib.Path, folder: str) -> dict[str, list[str]]:
    """Other folders of `root` that files of `folder` include, with the lines that do."""
    others = folders_of(root) - {folder}
    found: dict[str, list[str]] = {}
    for path in sorted((root / folder).rglob("*")):
        if not path.is_file():
            continue
        for included in re.findall(r'^\s*#\s*include\s*"([^"]+)"', path.read_text(), re.MULTILINE):
            other = included.split("/")[0]
            if other in others:
                found.setdefault(other, []).append(f"{path.relative_to(ROOT)} includes {included}")
    return found


LAYERS = documented_layers()


def test_the_page_names_every_folder() -> None:
    assert set(LAYERS) == folders_of(SOURCES)


def test_layers_point_one_way() -> None:
    order = list(LAYERS)
    upwards = [f"{folder} -> {other}" for folder in order for other in LAYERS[folder] if order.index(other) >= order.index(folder)]
    assert not upwards


@pytest.mark.parametrize("folder", LAYERS)
def test_a_folder_includes_what_the_page_says(folder: str) -> None:
    found = included_folders(SOURCES, folder)
    unknown = [line for other, lines in found.items() if other not in LAYERS[folder] for line in lines]
    assert not unknown
    assert set(LAYERS[folder]) == set(found), "the page names a folder that is not included"


@pytest.mark.parametrize("folder", SHADER_ORDER)
def test_shaders_point_one_way(folder: str) -> None:
    assert set(SHADER_ORDER) == folders_of(SHADERS)
    below = SHADER_ORDER[: SHADER_ORDER.index(folder)]
    assert not [line for other, lines in included_folders(SHADERS, folder).items() if other not in below for line in lines]


def test_shaders_know_no_infrared_fields() -> None:
    """The band is resolved where records are made (frame/band.h): a record has one value of each quantity."""
    assert not [path.name for path in SHADERS.rglob("*.*") if re.search(r"\bir_[a-z]", path.read_text())]


def test_no_class_opens_its_private_parts_to_another() -> None:
    assert not [path.name for path in SOURCES.rglob("*.*") if re.search(r"^\s*friend\s", path.read_text(), re.MULTILINE)]
