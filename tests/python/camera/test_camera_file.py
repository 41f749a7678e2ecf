# SPDX-License-Identifier: Apache-2.0
"""Cameras' data: every file is complete and checked, every figure has a source, and what is wrong is named."""

import pytest

from activestereo import StereoDepthSensorConfig
from activestereo.camera.plan import pattern_of
from activestereo.camera.camera_file import BASES, FIELDS, FOLDER, camera_names, read_camera
from command_line import refused, run_here

BASE = 'name = "mine"\ntitle = "My camera"\nbased_on = "d435"\n'


@pytest.mark.parametrize("name", camera_names())
def test_every_figure_of_a_camera_has_a_basis_and_a_source(name):
    camera = read_camera(name)
    assert set(camera.figures) == set(FIELDS)
    for section in ("rig", "projector", "exposure", "imager", "room", "matcher"):
        assert camera.figures[section], section
    for section in camera.figures.values():
        for figure in section.values():
            assert figure.basis in BASES and len(figure.source) > 3


def test_the_asked_cameras_are_there_and_make_configurations():
    asked = {"D415", "D435", "D435i", "D455", "D405", "generic", "sapien-D415", "sapien-D435"}
    assert asked <= set(StereoDepthSensorConfig.SUPPORTED_MODELS)
    blacks = {name: StereoDepthSensorConfig(name).ir_black_level_dn for name in ("D415", "D435i")}
    assert 3 <= blacks["D415"] <= 5 and blacks["D435i"] == 17
    assert pattern_of(StereoDepthSensorConfig("d405")) is None
    for name, baseline_m in {"D415": 0.055, "D435": 0.05, "D455": 0.095, "D405": 0.018}.items():
        config = StereoDepthSensorConfig(name)
        assert config.focal_baseline_px_m / config.ir_intrinsic[0, 0] == pytest.approx(baseline_m, rel=0.01)
    sizes = {name: StereoDepthSensorConfig(name).median_size for name in ("sapien-D415", "D415", "D435")}
    assert sizes == {"sapien-D415": 3, "D415": 7, "D435": 7}
    steps = {name: StereoDepthSensorConfig(name).edge_step_px for name in sizes}
    assert steps == {"sapien-D415": 0, "D415": 1.75, "D435": 1.75}


@pytest.mark.parametrize("based", [BASE, BASE.replace("d435", "D435")], ids=["lower case", "as listed"])
def test_a_file_of_ones_own_changes_what_it_tells_and_keeps_the_rest(tmp_path, based):
    path = tmp_path / "mine.toml"
    path.write_text(based + '[imager]\nblack_level_dn = { value = 30, basis = "measured", source = "lens covered" }\n')
    mine, base = StereoDepthSensorConfig(path), StereoDepthSensorConfig("D435")
    assert (mine.model, mine.ir_black_level_dn) == ("mine", 30)
    assert mine.ir_signal == base.ir_signal and mine.ir_resolution == base.ir_resolution


HERE = 'basis = "measured", source = "here"'
IMAGER = BASE + "[imager]\nprnu = { value = "
WRONG = {
    "no TOML": ("[imager", "is no TOML file"),
    "section": (BASE + "[imagers]\n", "'imagers' is no section; did you mean 'imager'"),
    "figure": (BASE + f"[imager]\nblack_level = {{ value = 1, {HERE} }}\n", "did you mean 'black_level_dn'"),
    "no source": (BASE + "[imager]\nblack_level_dn = 5\n", "imager.black_level_dn: expected { value"),
    "empty source": (IMAGER + '1, basis = "measured", source = " " }\n', "source is empty"),
    "basis": (IMAGER + '1, basis = "felt", source = "here" }\n', "basis is 'felt'"),
    "range": (IMAGER + f"2, {HERE} }}\n", "is 2, expected 0 to 1"),
    "number": (IMAGER + f'"a", {HERE} }}\n', "is 'a', expected"),
    "digits": (IMAGER + f"1{'0' * 400}, {HERE} }}\n", "expected a finite number"),
    "nan": (IMAGER + f"nan, {HERE} }}\n", "is nan, expected"),
    "count": (BASE + f"[rig]\nir_resolution = {{ value = [1], {HERE} }}\n", "expected 2 numbers"),
    "choice": (BASE + f'[exposure]\nmode = {{ value = "auto", {HERE} }}\n', "'auto', expected one of 'fixed'"),
    "name": ('title = "x"\nbased_on = "d435"\n', "name: is None"),
    "base": ('name = "x"\ntitle = "x"\nbased_on = "d999"\n', "mine.toml: based_on: unknown sensor 'd999' (known: D405"),
    "long base": (f'based_on = "{1_000_000 * "x"}"\n', "based_on: unknown sensor 'xxx"),
    "long section": (BASE + f"[{1_000_000 * 'x'}]\n", "xxx' is no section"),
    "circle": ('name = "x"\ntitle = "x"\nbased_on = "mine"\n', "in a circle"),
    "incomplete": ('name = "x"\ntitle = "x"\n', "rig.rgb_resolution is missing"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_with_a_file_is_told(case, tmp_path):
    text, message = WRONG[case]
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ValueError) as error:
        StereoDepthSensorConfig(path)
    assert message in str(error.value) and "\n" not in str(error.value) and len(str(error.value)) < 500


def test_the_command_prints_all_cameras_and_one(capsys):
    lines = run_here(capsys, "presets").stdout.splitlines()
    assert len(lines) == 1 + len(list(FOLDER.glob("*.toml")))
    assert any(line.startswith("D435i ") and "17 DN" in line for line in lines)
    text = run_here(capsys, "presets", "d415").stdout
    assert "black_level_dn = 4 DN" in text
    assert "measured: least counts of D415 recordings" in text
    assert "figures are estimated" in text
    assert "unknown sensor 'd1'" in refused(["presets", "d1"], capsys)
