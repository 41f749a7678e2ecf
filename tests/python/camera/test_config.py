# SPDX-License-Identifier: Apache-2.0
"""Presets keep SAPIEN's names, and those called after it its values."""

import numpy as np
import pytest

from activestereo import Pose, StereoDepthSensor, StereoDepthSensorConfig
from activestereo.camera.plan import plan_of
from activestereo.camera.presets import own_config
from activestereo.common.pose import camera_to_camera

BOTH = {
    "ir_camera_exposure": 0.01, "min_depth": 0.2, "max_depth": 10.0, "ir_noise_seed": 0, "ir_speckle_noise": 1.0,
    "ir_thermal_noise": 1.0, "rectified": True, "census_width": 7, "census_height": 7, "max_disp": 128,
    "block_width": 7, "block_height": 7, "p1_penalty": 8, "p2_penalty": 32, "uniqueness_ratio": 15, "lr_max_diff": 1,
    "median_filter_size": 3, "depth_dilation": True,
}  # fmt: skip


@pytest.mark.parametrize("model", ["sapien-D415", "sapien-D435"])
def test_defaults_of_both_models(model):
    config = StereoDepthSensorConfig(model)
    assert {name: getattr(config, name) for name in BOTH} == BOTH


def test_d435_is_the_default():
    config = StereoDepthSensorConfig()
    assert config.model == "D435"
    assert config.rgb_resolution == (848, 480) and config.ir_resolution == (848, 480)
    assert config.rgb_intrinsic[0, 0] == 605.12158203125 and config.rgb_intrinsic[1, 1] == 604.905517578125
    assert config.ir_intrinsic[0, 0] == config.ir_intrinsic[1, 1] == 430.139801025391
    assert config.active_light_fov == pytest.approx(np.deg2rad(102.0))
    assert config.focal_baseline_px_m == pytest.approx(430.14 * 0.05016, rel=1e-3)


def test_d415():
    config = StereoDepthSensorConfig("sapien-d415")
    assert config.rgb_resolution == (1920, 1080) and config.ir_resolution == (1280, 720)
    assert config.rgb_intrinsic[0, 0] == 1380.0 and config.ir_intrinsic[0, 0] == 920.0
    assert config.trans_pose_l.p[1] == -0.0175 and config.trans_pose_r.p[1] == -0.0720
    assert config.focal_baseline_px_m == pytest.approx(920.0 * 0.0545)


@pytest.mark.parametrize("model", StereoDepthSensorConfig.SUPPORTED_MODELS)
def test_ir_pair_is_row_aligned(model):
    """The right camera lies on the left one's own x axis, turned the same way."""
    config = StereoDepthSensorConfig(model)
    left_to_right = camera_to_camera(config.trans_pose_l, config.trans_pose_r)
    np.testing.assert_allclose(left_to_right[:3, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(left_to_right[1:3, 3], 0.0, atol=2e-6)
    assert left_to_right[0, 3] < (-0.015 if model == "D405" else -0.04)


@pytest.mark.parametrize("factor", [0, -1, float("nan"), float("inf"), 1e9])
def test_no_sensor_is_scaled_to_nothing_or_beyond_measure(factor):
    with pytest.raises(ValueError, match="factor"):
        StereoDepthSensorConfig("D435").scaled(factor)


def test_scaled_keeps_what_a_camera_sees():
    config = StereoDepthSensorConfig("D435")
    half = config.scaled(0.5)
    assert half.ir_resolution == (424, 240) and half.max_disp == 64
    assert half.pixel_blur_px == 0 and config.scaled(0.4).pixel_blur_px == 0.5
    assert config.scaled(0.6).scaled(0.6).pixel_blur_px == 0.5 and config.scaled(0.4).scaled(2.0).pixel_blur_px == 0
    for camera, size in (("ir", config.ir_resolution), ("rgb", config.rgb_resolution)):
        for corner in (np.array([-0.5, -0.5]), np.array(size) - 0.5):
            ray = np.linalg.inv(getattr(config, f"{camera}_intrinsic")) @ [*corner, 1.0]
            seen = getattr(half, f"{camera}_intrinsic") @ ray
            np.testing.assert_allclose(seen[:2], (corner + 0.5) / 2 - 0.5, atol=1e-9)


@pytest.mark.parametrize("model", StereoDepthSensorConfig.SUPPORTED_MODELS)
def test_every_sensor_can_be_small(model):
    whole = StereoDepthSensorConfig(model)
    config = whole.scaled(0.125)
    if config.ir_signal:
        assert plan_of(config).signal["speckle_psf_sigma_px"] == 0.0
        assert config.ir_optics["psf_sigma_px"] == pytest.approx(whole.ir_optics["psf_sigma_px"] / 8)


def test_config_of_one_sensor_does_not_change_another():
    first = StereoDepthSensorConfig()
    first.ir_intrinsic[0, 0] = 1.0
    first.trans_pose_l = Pose()
    assert StereoDepthSensorConfig().ir_intrinsic[0, 0] == 430.139801025391


def test_a_misspelt_field_is_refused():
    config = StereoDepthSensorConfig()
    with pytest.raises(AttributeError, match="no field 'max_disparty'; did you mean 'max_disparity'"):
        config.max_disparty = 64
    with pytest.raises(AttributeError, match="no field 'zzz'$"):
        config.scaled(0.5).zzz = 1
    config.max_disp = 64
    assert config.scaled(1).max_disp == 64


def test_every_number_of_a_configuration_has_a_finite_range():
    config = StereoDepthSensorConfig()
    numbers = [name for name in config._FIELDS if type(getattr(config, name)) in (int, float)]
    assert len(numbers) > 40
    for name in numbers:
        for value in (1e300, -1e300, float("nan"), 10**400):
            with pytest.raises(ValueError, match=name):
                setattr(config, name, value)


def test_a_matrix_of_another_resolution_is_refused_with_what_to_do():
    with pytest.raises(ValueError, match=r"640x480, but ir_intrinsic is still 848x480's: take config.scaled"):
        changed(ir_resolution=(640, 480)).check()
    with pytest.raises(ValueError, match=r"rgb_resolution is 640x360, but rgb_intrinsic"):
        changed(rgb_resolution=(640, 360)).check()
    half = StereoDepthSensorConfig().scaled(0.5)
    half.check()
    half.ir_resolution = (848, 480)
    with pytest.raises(ValueError, match="still 424x240's"):
        half.scaled(2.0)
    k = np.array([[912.0, 0.0, 639.5], [0.0, 912.0, 359.5], [0.0, 0.0, 1.0]])
    changed(ir_resolution=(1280, 720), ir_intrinsic=k).check()
    with pytest.raises(ValueError, match=r"ir_intrinsic has its principal point at \(639.5, 359.5\).*set ir_resol"):
        changed(ir_intrinsic=k)


def changed(**fields):
    config = StereoDepthSensorConfig()
    for name, value in fields.items():
        setattr(config, name, value)
    return config


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("denoise", "off", "known: none, atrous, oidn"),
        ("emitter", "blinking", "known: on, off, alternating"),
        ("ir_camera_exposure", 1e9, "1e-09 to 2 s"),
        ("max_disp", float("nan"), "expected a whole number"),
        ("median_filter_size", 4, "expected 1, 3, 5 or 7"),
        ("samples_per_pixel", 0, r"expected 1\.\.4294967295"),
        ("ir_ambient_scale", float("inf"), "expected a finite number"),
        ("min_depth", 1e300, r"1e\+30 m"),
        ("render_seed", 2**64, "0 to 4294967295"),
        ("ir_resolution", (0, 480), "1 to 65535 px"),
        ("ir_intrinsic", np.diag([1e300, 1e300, 1.0]), r"fx is 1e\+300, expected 0\.001 to 1e\+06 px"),
        ("ir_distortion", (0.0, 1e9, 0.0, 0.0, 0.0), r"\[1\] is 1e\+09"),
        ("depth_dilation", "yes", "True or False"),
        ("faults", ("none such",), "known: rectified_shrunk"),
        ("block_width", 4, "block_width is 4, expected an odd number, 1 to 255 px"),
        ("census_height", 0, "census_height is 0, expected 1 to 65 px"),
        ("p1", 224, "p1 is 224, expected 1 to 223"),
        ("max_disparity", "x", "max_disparity is 'x', expected a whole number, 16..1024 px"),
        ("ir_signal", {"read_noise": 1.0}, "ir_signal has no parameter 'read_noise': did you mean 'read_noise_e'"),
        ("ir_signal", {"read_noise_e": float("nan")}, r"ir_signal \['read_noise_e'\] is nan"),
        ("ir_signal", 3.0, "ir_signal is 3, expected"),
        ("ir_optics", {"vignetting_exponent": 65.0}, r"ir_optics \['vignetting_exponent'\] is 65"),
        ("rgb_optics", {"vignette": 1.0}, "rgb_optics has no parameter 'vignette'"),
        ("light_dots", [[1.0, 2.0]], r"light_dots has the shape \[1, 2\]"),
        ("light_dots", [[1.0, 2.0, 1.0], [1.0, 2.0, float("nan")]], r"light_dots \[1\] is"),
        ("light_dots", [[1.0, 2.0, -1.0]], "a power of 0 or more"),
        ("ir_intrinsic", np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]]), "set ir_resolution first"),
        ("ir_signal", "d453", "no signal preset 'd453' .known: .*d435"),
        ("depth_maps", ("confidense",), "depth_maps has 'confidense' .*; did you mean 'confidence'"),
        ("depth_maps", "confidence", "depth_maps is 'confidence', expected names out of"),
        ("rectified", "x", "rectified is 'x', expected True or False"),
        ("trans_pose_l", np.eye(4), "trans_pose_l is a ndarray, expected a Pose"),
        ("pattern_design", 5, "pattern_design is 5, expected a PatternDesign"),
        ("light_pattern", np.zeros((2, 2, 3), np.uint8), r"light_pattern is uint8 \[2, 2, 3\], expected uint8"),
        ("light_pattern", 5, "light_pattern is 5, expected 'generated', an image"),
        ("ir_optics", {1_000_000 * "x": 1.0}, r"ir_optics has no parameter 'xxx.{0,50}$"),
        ("depth_maps", (1_000_000 * "x",), r"depth_maps has 'xxx.{0,50} .known: .{0,99}$"),
        ("ir_signal", 1_000_000 * "x", r"no signal preset 'xxx.{0,50} .known: .{0,99}$"),
        ("emitter", 1_000_000 * "x", r"emitter is 'xxx.{0,50} .known: .{0,99}$"),
    ],
)
def test_a_field_refuses_what_it_cannot_be_when_it_is_set(name, value, words):
    config = StereoDepthSensorConfig("D435")
    before = getattr(config, name)
    with pytest.raises(ValueError, match=words):
        setattr(config, name, value)
    assert getattr(config, name) is before


def test_resized_keeps_the_field_of_view_or_takes_the_given_one():
    config = StereoDepthSensorConfig("D435")
    same = config.resized(128, 128)
    assert same.ir_resolution == same.rgb_resolution == (128, 128)
    own, k = config.ir_intrinsic, same.ir_intrinsic
    assert k[0, 0] == pytest.approx(own[0, 0] * 128 / config.ir_resolution[0])
    assert k[0, 0] / k[1, 1] == pytest.approx(own[0, 0] / own[1, 1])
    given = config.resized(320, 200, fov=90.0)
    assert [given.ir_intrinsic[0, 0], given.rgb_intrinsic[0, 0]] == pytest.approx([160.0, 160.0])
    same.check()
    given.check()


@pytest.mark.parametrize(
    ("size", "words"),
    [((0, 8), "width is 0"), ((64, 2.5), "height is 2.5"), ((64, 64, 175.0), "fov is 175.*1 to 170 degrees")],
)
def test_resized_refuses_what_is_no_image(size, words):
    with pytest.raises(ValueError, match=words):
        StereoDepthSensorConfig().resized(*size)


def test_configurations_compare_by_value_and_show_what_was_changed():
    one, other = StereoDepthSensorConfig("D435"), StereoDepthSensorConfig("D435")
    assert one == other
    assert repr(one) == "StereoDepthSensorConfig('D435')"
    other.max_disparity = 64
    assert one != other
    assert repr(other) == "StereoDepthSensorConfig('D435', max_disparity=64)"
    moved = StereoDepthSensorConfig("D435")
    moved.ir_intrinsic = moved.ir_intrinsic + [[0, 0, 1], [0, 0, 0], [0, 0, 0]]
    assert one != moved
    assert one != "D435"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"p1": 40, "p2": 40}, "p1 is 40 and p2 is 40, expected a larger p2"),
        ({"block_width": 17, "block_height": 17}, "block is 17x17 pixels, expected 1 to 256 pixels in all"),
        ({"census_width": 9, "census_height": 9}, "census is 9x9 pixels, expected 3 to 65"),
        ({"min_depth_m": 2.0, "max_depth_m": 1.0}, "min_depth_m is 2, expected less than max_depth_m, 1"),
        ({"ir_speckle_noise": 0.0}, "ir_speckle_noise is 0 and ir_thermal_noise 1, but ir_signal states the noise"),
    ],
)
def test_fields_go_together(changes, words):
    config = StereoDepthSensorConfig("D435")
    for name, value in changes.items():
        setattr(config, name, value)
    with pytest.raises(ValueError, match=words):
        config.check()


def test_an_unknown_name_suggests_the_nearest():
    with pytest.raises(ValueError, match="unknown sensor 'd436' .*D415.*D435.*did you mean 'D43.'"):
        StereoDepthSensorConfig("d436")
    with pytest.raises(ValueError, match="^unknown sensor 'x{9}.{0,50} .known: .{0,200}$"):
        StereoDepthSensorConfig(1_000_000 * "x")
    with pytest.raises(AttributeError, match="did you mean 'p1'"):
        _ = StereoDepthSensorConfig().p11


def test_a_sensor_takes_a_configuration_or_a_cameras_name(table_top):
    config = StereoDepthSensorConfig("D415")
    assert own_config("D415") == own_config(config) == config and own_config(config) is not config
    with pytest.raises(ValueError, match="did you mean 'D43.'"):
        StereoDepthSensor("d436", table_top)
    with pytest.raises(TypeError, match="config is {'fov': 1}, expected a StereoDepthSensorConfig or the name"):
        StereoDepthSensor({"fov": 1}, table_top)
