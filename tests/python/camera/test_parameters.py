# SPDX-License-Identifier: Apache-2.0
"""One name and one default per option of the engines: in C, Python, a sensor's configuration and the command line."""

import argparse
from typing import Any

import numpy as np
import pytest

import kuafu
import simsense
from activestereo import StereoDepthSensorConfig
from depth_engines import depth_engine
from activestereo.cli import make_parser
from activestereo.cli.arguments import CommandError
from activestereo.cli.sensor_options import given_parameters
from activestereo.cli.simulate import make_config
from activestereo.common.parameter import MATCHER, RENDER, RENDERER, RIG, Parameter
from activestereo.camera.plan import matcher_parameters, parameters, signal_parameters
from activestereo.camera.presets import OF_THE_CAMERA, SAPIEN_DEFAULTS, SAPIEN_NAMES

OF_THE_SENSOR = {"noise_seed", "frame_index"}  # what a sensor counts itself
COMMANDS = {"depth": "l.png r.png --k 1,2,3,4 --baseline 0.05 --out x", "simulate": "scene.gltf --out x"}


def a_value(p: Parameter) -> Any:
    """Some value that the parameter may have."""
    if p.choices:
        return p.choices[-1]
    low, high = (p.allowed[0],) * 2 if p.allowed else p.range or (3, 3)
    return "x.so" if p.kind is str else p.kind(max(low, min(3, high)))


def parse(command: str, *options: str) -> argparse.Namespace:
    return make_parser().parse_args([command, *COMMANDS[command].split(), *options])


def test_every_parameter_of_the_engine_is_in_the_configuration_with_its_default() -> None:
    library = simsense.default_parameters()
    assert {p.name for p in MATCHER} == set(library) - OF_THE_SENSOR
    for p in MATCHER:
        assert library[p.name] == (p.choices.index(p.default) if p.choices else p.default), p.name


def test_a_configuration_has_the_defaults_but_for_those_of_sapien() -> None:
    config = StereoDepthSensorConfig()
    of_the_imager = {"noise_dn2", "noise_dn2_per_dn"}
    known = {p.name: SAPIEN_DEFAULTS.get(p.name, p.default) for p in MATCHER if p.name not in OF_THE_CAMERA}
    found = {name: value for name, value in matcher_parameters(config).items() if name in known}
    assert {name for name in known if found[name] != known[name]} == of_the_imager
    assert set(SAPIEN_NAMES) <= set(vars(config)) and not set(SAPIEN_NAMES.values()) & set(vars(config))
    for own, sapien in SAPIEN_NAMES.items():
        assert getattr(config, sapien) == getattr(config, own)
        value = 70 if own == "max_disparity" else 7
        setattr(config, sapien, value)
        assert getattr(config, own) == value


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("parameter", MATCHER, ids=lambda p: p.name)
def test_every_parameter_has_an_option(command: str, parameter) -> None:
    if parameter.kind is bool:
        assert given_parameters(parse(command, parameter.option), MATCHER) == {parameter.name: True}
        return
    value = a_value(parameter)
    assert given_parameters(parse(command, f"{parameter.option}={value}"), MATCHER) == {parameter.name: value}


def test_an_option_reaches_the_configuration_under_its_name_there_and_a_pair_sets_width_and_height() -> None:
    options = "--max-disparity 64 --subpixel parabola --path-count 8 --no-depth-dilation --census 5x3"
    config = make_config(parse("simulate", *options.split()))
    assert (config.max_disparity, config.subpixel, config.path_count) == (64, "parabola", 8)
    assert config.depth_dilation is False and (config.census_width, config.census_height) == (5, 3)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_engines_place_memory_and_faults_are_options_too(command: str) -> None:
    args = parse(command, "--back-end", "cpu", "--low-memory", "--fault", "splat_invalid", "--fault", "remap_nearest")
    expected = {"back_end": "cpu", "low_memory": True, "faults": ("splat_invalid", "remap_nearest")}
    assert given_parameters(args, RIG) == expected and {p.name for p in RIG} == set(expected)
    if command == "simulate":
        assert parameters(make_config(args), RIG) == expected


def test_names_of_faults_and_back_ends_are_those_of_the_library() -> None:
    table = {p.name: p for p in RIG}
    assert table["faults"].choices == simsense.FAULTS
    with pytest.raises(simsense.ArgumentError, match=", ".join(table["back_end"].choices)):
        depth_engine((64, 48), 50, back_end="gpu")


@pytest.mark.parametrize("parameter", [*RENDERER, *RENDER], ids=lambda p: p.name)
def test_every_option_of_a_render_is_in_the_configuration_and_on_the_command_line(parameter) -> None:
    config = StereoDepthSensorConfig()
    assert parameter.name in OF_THE_CAMERA or getattr(config, parameter.name) == parameter.default
    if not parameter.on_command_line:
        # a command renders one frame, and blurs by --resolution
        assert parameter.name in ("temporal_weight", "pixel_blur_px")
        return
    value = a_value(parameter)
    for option in filter(None, (parameter.option, parameter.short and f"--{parameter.short}")):
        config = make_config(parse("simulate", f"{option}={value}"))
        assert getattr(config, parameter.name) == value


def test_what_a_render_is_told_are_all_options_that_a_sensor_does_not_decide_itself() -> None:
    device = kuafu.Device("cpu")
    renderer = kuafu.Renderer(device, **parameters(StereoDepthSensorConfig(), RENDERER))
    camera = kuafu.Camera(4, 4, [[4, 0, 2], [0, 4, 2], [0, 0, 1]])
    config = make_config(parse("simulate", "--spp", "3", "--ir-ambient-radiance", "0.5", "--max-bounces", "0"))
    image = renderer.render(kuafu.Scene(device), camera, **parameters(config, RENDER))["radiance"]
    assert renderer.summary.samples_per_pixel == 3
    np.testing.assert_allclose(image, 0.5, rtol=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--spp", "0"), "samples_per_pixel"), (("--max-bounces", "1025"), "0..1024"),
        (("--fault", "none"), "remap_nearest"),
    ],
)  # fmt: skip
def test_an_option_out_of_range_is_refused_before_any_work(
    options: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parse("simulate", *options)
    assert words in capsys.readouterr().err


def test_fields_of_optics_and_imagers_are_options() -> None:
    options = "--ir-optics psf_sigma_px=0.7 --ir-optics vignetting_polynomial=-0.3,0.1,0 "
    options += "--rgb-optics vignetting_exponent=4 --ir-signal d435 --ir-signal read_noise_e=2 --ir-signal bit_depth=10"
    config, own = make_config(parse("simulate", *options.split())), StereoDepthSensorConfig().ir_optics or {}
    assert config.ir_optics == own | {"psf_sigma_px": 0.7, "vignetting_polynomial": [-0.3, 0.1, 0]}
    assert config.rgb_optics == {"vignetting_exponent": 4}
    assert config.ir_signal == simsense.signal_preset("d435") | {"read_noise_e": 2, "bit_depth": 10}


@pytest.mark.parametrize("sensor", ["D435", "sapien-D435"])
def test_a_field_of_an_imager_leaves_the_others_as_they_are(sensor: str) -> None:
    usual = signal_parameters(StereoDepthSensorConfig(sensor))
    assert usual["speckle_shape"] > 0.0
    config = make_config(parse("simulate", "--sensor", sensor, "--ir-signal", "read_noise_e=2"))
    assert signal_parameters(config) == usual | {"read_noise_e": 2}


@pytest.mark.parametrize("preset", [(), ("--ir-signal", "paper-d415")])
def test_a_stated_black_level_is_that_of_the_images(preset: tuple[str, ...]) -> None:
    config = make_config(parse("simulate", *preset, "--ir-signal", "black_level_dn=40"))
    assert signal_parameters(config)["black_level_dn"] == pytest.approx(40.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--ir-optics", "psf=1"), "psf_sigma_px"),
        (("--ir-optics", "vignetting_polynomial=1"), "3 numbers"),
        (("--rgb-optics", "psf_sigma_px=1,2"), "expected a finite number"),
        (("--ir-signal", "read_noise=2"), "read_noise_e"),
        (("--ir-signal", "d400"), "d435"),
        (("--ir-signal", "exposure_s=0.01"), "--ir-exposure states it"),
        (("--ir-signal", "black_level_dn=80"), "expected more than the black level, 80"),
    ],
)
def test_a_field_that_no_record_has_is_refused(options: tuple[str, ...], words: str) -> None:
    with pytest.raises((CommandError, ValueError), match=words):
        make_config(parse("simulate", *options))


@pytest.mark.parametrize("name", OF_THE_CAMERA)
def test_help_of_simulate_leaves_to_the_camera_what_is_its_own(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse("simulate", "--help-all")
    option = next(p.option for p in (*MATCHER, *RENDERER, *RENDER) if p.name == name)
    text = " ".join(capsys.readouterr().out.split(f"{option} ")[-1].split("--")[0].split())
    assert "default: the camera's" in text
