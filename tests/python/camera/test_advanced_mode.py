# SPDX-License-Identifier: Apache-2.0
"""The D400's advanced-mode JSON: what is read, what is refused, and that each key sets what its page says."""

import json
import pathlib

import pytest

import activestereo.camera.advanced_mode as advanced_mode
from activestereo.camera.advanced_mode.settings import AdvancedSettings, camera_fields, depth_table, keys
from activestereo.camera.advanced_mode.settings import matcher_parameters, parse_settings, read_settings
from activestereo.camera.plan import matcher_parameters as of_config
from advanced_mode_page import page
from activestereo.camera.presets import StereoDepthSensorConfig

BASE = of_config(StereoDepthSensorConfig("D415"))


def everything(values):
    settings = AdvancedSettings(values)
    table, names = depth_table(settings), ("unit_m", "min_depth_m", "max_depth_m", "is_disparity")
    of_depth = {name: getattr(table, name) for name in names}
    return {**matcher_parameters(settings, BASE), **camera_fields(settings), **of_depth}


def others(key):
    """Values beside the default."""
    if key.words is not None:
        return [word for word in key.words if word != key.default]
    low, high = key.range
    return [low + share * (high - low) for share in (0.02, 0.3, 0.9)]


def test_the_camera_s_defaults_leave_the_preset_s_matcher_as_it_is():
    settings = parse_settings({name: key.default for name, key in keys().items() if key.default != ""}, "defaults")
    assert matcher_parameters(settings, BASE) == BASE
    assert settings.unmapped() == []


@pytest.mark.parametrize("name", [name for name, key in keys().items() if key.to])
def test_a_key_sets_what_its_row_says_and_nothing_else(name):
    together = {"param-texturecountthresh": 9.0, "param-texturedifferencethresh": 400.0}
    given = {other: value for other, value in together.items() if name in together and other != name}
    before, moved = everything(given), set()
    for value in others(keys()[name]):
        after = everything({**given, name: value})
        moved |= {field for field, value in after.items() if before.get(field) != value}
    allowed = set(keys()[name].to)
    if name == "param-depthunits":
        allowed |= {"min_depth_m", "max_depth_m"}  # which are counted in units
    if name == "param-scanlinep2":
        allowed |= {"p1"}  # which stays below p2
    assert set(keys()[name].to) <= moved <= allowed


def test_at_least_twenty_settings_are_mapped_and_the_page_is_what_the_table_says():
    assert sum(bool(key.to) for key in keys().values()) >= 20
    readme = pathlib.Path(advanced_mode.__file__).resolve().parent / "README.md"
    assert readme.read_text(encoding="utf-8") == page()


def test_what_is_written_reads_back_and_old_names_are_the_same_setting(tmp_path):
    given = {"param-zunits": "100", "param-depthunits": 100, "controls-laserstate": "off"}
    given |= {"param-rsmdiffthreshold": "1.2"}
    settings = parse_settings(given, "x")
    text = {"param-depthunits": "100", "controls-laserstate": "off", "param-rsmdiffthreshold": "1.2"}
    assert settings.as_text().items() >= text.items()
    (tmp_path / "a.json").write_text(json.dumps(text))
    assert read_settings(tmp_path / "a.json") == settings
    assert depth_table(settings).unit_m == pytest.approx(1e-4)
    assert parse_settings({"device": {}, "schema version": 1, "parameters": text}, "x") == settings


@pytest.mark.parametrize(
    "content, told",
    [
        ({"param-secondpeakdelt": 3}, "param-secondpeakdelt is unknown; did you mean 'param-secondpeakdelta'?"),
        ({"param-secondpeakdelta": "4000"}, "param-secondpeakdelta is '4000', expected 0 to 1023"),
        ({"param-secondpeakdelta": "much"}, "param-secondpeakdelta is 'much', expected 0 to 1023"),
        ({"param-scanlinep1": float("nan")}, "expected 0 to 1023"),
        ({"controls-laserstate": "dim"}, "controls-laserstate is 'dim', expected off or on or auto"),
        ({"param-zunits": 100, "param-depthunits": 1000}, "are one setting and differ"),
        ({"parameters": {}}, "has no keys of the advanced mode"),
    ],
)
def test_what_a_file_must_not_hold_is_told_in_one_line(content, told):
    with pytest.raises(ValueError, match="^some.json: ") as error:
        parse_settings(content, "some.json")
    assert told in str(error.value) and "\n" not in str(error.value)


def test_clamps_that_exclude_all_are_refused():
    with pytest.raises(ValueError, match="expected below"):
        depth_table(AdvancedSettings({"aux-param-depthclampmin": 900.0, "aux-param-depthclampmax": 900.0}))
