"""One name and one default per parameter of the engine: in C, Python, a sensor's configuration and the command line."""

import argparse

import pytest

import simsense
from activestereo import StereoDepthSensorConfig
from activestereo.cli import make_parser
from activestereo.cli.arguments import given_matching
from activestereo.matcher_table import MATCHER
from activestereo.matching import matcher_parameters
from activestereo.presets import SAPIEN_DEFAULTS, SAPIEN_NAMES, sapien_name

OF_THE_SENSOR = {"noise_seed", "frame_index"}  # what a sensor counts itself
COMMANDS = {"depth": "l.png r.png --k 1,2,3,4 --baseline 0.05 --out x", "simulate": "scene.gltf --out x"}


def parse(command: str, *options: str) -> argparse.Namespace:
    return make_parser().parse_args([command, *COMMANDS[command].split(), *options])


def test_every_parameter_of_the_engine_is_in_the_configuration() -> None:
    assert {p.name for p in MATCHER} == set(simsense.default_parameters()) - OF_THE_SENSOR


def test_defaults_are_those_of_the_library() -> None:
    library = simsense.default_parameters()
    for p in MATCHER:
        assert library[p.name] == (p.choices.index(p.default) if p.choices else p.default), p.name


def test_a_configuration_has_the_defaults_but_for_those_of_sapien() -> None:
    config = StereoDepthSensorConfig()
    assert matcher_parameters(config) == {p.name: SAPIEN_DEFAULTS.get(p.name, p.default) for p in MATCHER}
    assert {name for name in SAPIEN_NAMES if hasattr(config, name)} == set(), "one name each"


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("parameter", MATCHER, ids=lambda p: p.name)
def test_every_parameter_has_an_option(command: str, parameter) -> None:
    if parameter.kind is bool:
        assert given_matching(parse(command, parameter.option)) == {parameter.name: True}
        return
    text, value = (parameter.choices[-1],) * 2 if parameter.choices else ("3", parameter.kind(3))
    assert given_matching(parse(command, f"{parameter.option}={text}")) == {parameter.name: value}


def test_a_pair_option_sets_width_and_height() -> None:
    assert given_matching(parse("depth", "--census", "5x3")) == {"census_width": 5, "census_height": 3}


def test_an_option_reaches_the_configuration_under_its_name_there() -> None:
    from activestereo.cli.simulate import make_config

    config = make_config(parse("simulate", "--max-disparity", "64", "--subpixel", "parabola", "--path-count", "8", "--no-depth-dilation"))
    assert (config.max_disp, config.subpixel, config.path_count, config.depth_dilation) == (64, "parabola", 8, False)


def test_the_engines_place_memory_and_faults_are_options_too() -> None:
    from activestereo.cli.simulate import make_config

    config = make_config(parse("simulate", "--back-end", "cpu", "--low-memory", "--fault", "splat_invalid", "--fault", "remap_nearest"))
    assert (config.back_end, config.low_memory, config.faults) == ("cpu", True, ("splat_invalid", "remap_nearest"))


@pytest.mark.parametrize("foreign", [{"lr_max_diff": 255}, {"uniqueness_ratio": 255}])
def test_sapiens_ways_to_switch_off_stay_in_the_configuration(foreign: dict[str, int]) -> None:
    config = StereoDepthSensorConfig()
    for name, value in foreign.items():
        setattr(config, sapien_name(name), value)
        assert matcher_parameters(config)[name] == {"lr_max_diff": -1, "uniqueness_ratio": 100}[name]
