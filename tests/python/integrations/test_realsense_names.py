# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's names on a simulated camera: its own baseline, its options, software devices of NumPy frames."""

import numpy as np
import pytest

import activestereo.realsense as rs
from activestereo.camera.presets import StereoDepthSensorConfig

WIDTH, HEIGHT, FX, UNIT_M = 64, 48, 50.0, 0.001


@pytest.mark.parametrize("model", ["D405", "D415", "D435", "D455"])
def test_disparities_have_the_cameras_own_baseline(model):
    config = StereoDepthSensorConfig(model)
    baseline_m = config.focal_baseline_px_m / config.ir_intrinsic[0, 0]
    rs.simulate(rs.World(sensor=model))
    device = rs.device()
    rs.simulate(rs.World())
    assert device.first_depth_sensor().get_option(rs.option.stereo_baseline) == pytest.approx(1e3 * baseline_m)
    profile = next(p for p in device.first_depth_sensor().get_stream_profiles() if p.stream_type() == rs.stream.depth)
    depth = rs.depth_frame(np.full((2, 3), 1000, np.uint16), profile, 1, 0.0)
    disparity = rs.disparity_transform().process(depth)
    assert disparity.get_data()[0, 0] == pytest.approx(32 * profile.get_intrinsics().fx * baseline_m / 1.0, rel=1e-6)
    assert disparity.get_baseline() == pytest.approx(1e3 * baseline_m)
    assert (rs.disparity_transform(False).process(disparity).get_data() == 1000).all()


@pytest.mark.parametrize("call", [
    lambda s, o: s.set_option(o, 1), lambda s, o: s.get_option(o), lambda s, o: s.get_option_range(o),
    lambda s, o: s.get_option_description(o),
])  # fmt: skip
def test_every_option_that_is_not_supported_is_the_cameras_own_error(call):
    sensor = rs.device().first_depth_sensor()
    denied = [o for o in rs.option if not sensor.supports(o)]
    assert rs.option.inter_cam_sync_mode in denied and len(denied) > 90
    for which in denied:
        with pytest.raises(RuntimeError, match=f"object doesn't support option {which.name.replace('_', ' ').title()}"):
            call(sensor, which)


def test_each_stream_has_one_default_as_lerobot_looks_for():
    for sensor in rs.device().query_sensors():
        profiles = [p for p in sensor.get_stream_profiles() if p.is_video_stream_profile() and p.is_default()]
        assert [p.stream_name() for p in profiles] == list(dict.fromkeys(p.stream_name() for p in profiles))
        assert {p.stream_name() for p in profiles} == {p.stream_name() for p in sensor.get_stream_profiles()}


def test_a_name_that_is_not_there_is_told():
    with pytest.raises(AttributeError, match="has no pyrealsense2.playback"):
        getattr(rs, "playback")  # noqa: B009  (mypy knows that it is not there)


def software(rs, kinds=("depth", "color"), baseline_mm=None):
    """(sensor, {kind: profile}, frames) of a software device of `rs`, which may be the real package."""
    device, frames = rs.software_device(), rs.syncer()
    sensor = device.add_sensor("Stereo Module")
    lens = rs.intrinsics()
    for name, value in (("width", WIDTH), ("height", HEIGHT), ("ppx", 31.5), ("ppy", 23.5), ("fx", FX), ("fy", FX)):
        setattr(lens, name, value)
    profiles = {}
    for index, kind in enumerate(kinds):
        made = rs.video_stream()
        made.type, made.uid, made.width, made.height, made.fps = getattr(rs.stream, kind), index, WIDTH, HEIGHT, 30
        made.bpp, made.fmt = (2, rs.format.z16) if kind == "depth" else (3, rs.format.bgr8)
        made.intrinsics = lens
        profiles[kind] = sensor.add_video_stream(made)
    sensor.add_read_only_option(rs.option.depth_units, UNIT_M)
    if baseline_mm is not None:
        sensor.add_read_only_option(rs.option.stereo_baseline, baseline_mm)
    sensor.open(list(profiles.values()))
    sensor.start(frames)
    return sensor, profiles, frames


def images():
    rng = np.random.default_rng(1)
    return {
        "depth": rng.integers(0, 2000, (HEIGHT, WIDTH), np.uint16),
        "color": rng.integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8),
    }


def sent(rs, sensor, stream, pixels, number=1, **fields):
    one = rs.software_video_frame()
    one.pixels, one.stride, one.bpp, one.timestamp, one.frame_number = (
        pixels,
        pixels[0].nbytes,
        pixels[0, 0].nbytes,
        33.0,
        number,
    )
    one.profile = stream.as_video_stream_profile()
    for name, value in fields.items():
        setattr(one, name, value)
    sensor.on_video_frame(one)


@pytest.mark.parametrize(
    "as_given", [lambda a: a, lambda a: a[::-1][::-1], lambda a: a.reshape(-1), lambda a: a.view(np.uint8)]
)
def test_numpy_frames_go_through_a_software_device(as_given):
    sensor, profiles, frames = software(rs, baseline_mm=95.0)
    for kind, pixels in images().items():
        sent(rs, sensor, profiles[kind], pixels)
    whole = frames.wait_for_frames()
    depth, color = whole.get_depth_frame(), whole.get_color_frame()
    np.testing.assert_array_equal(depth.get_data(), images()["depth"])
    np.testing.assert_array_equal(color.get_data(), images()["color"])
    assert depth.get_distance(3, 2) == pytest.approx(UNIT_M * images()["depth"][2, 3])
    one = rs.software_video_frame()
    one.pixels, one.frame_number, one.profile = as_given(images()["depth"]), 2, profiles["depth"]
    sensor.on_video_frame(one)
    assert frames.poll_for_frames() is None, "its colour is not there yet"
    disparity = rs.disparity_transform().process(depth).get_data()
    np.testing.assert_allclose(disparity[2, 3], 32 * 0.095 * FX / depth.get_distance(3, 2), rtol=1e-6)
    assert rs.align(rs.stream.color).process(whole).get_depth_frame().get_data().shape == (HEIGHT, WIDTH)


def test_frames_go_to_a_queue_or_a_function_one_by_one():
    for target in (rs.frame_queue(), []):
        sensor, profiles, _ = software(rs, kinds=("depth",))
        sensor.start(target if isinstance(target, rs.frame_queue) else target.append)
        sent(rs, sensor, profiles["depth"], images()["depth"])
        found = target.wait_for_frame() if isinstance(target, rs.frame_queue) else target[0]
        np.testing.assert_array_equal(found.get_data(), images()["depth"])


def test_frames_need_no_lens():
    sensor, queue = rs.software_device().add_sensor("Depth"), rs.frame_queue(100)
    profile = sensor.add_video_stream(rs.video_stream(rs.stream.depth, width=WIDTH, height=HEIGHT, fmt=rs.format.z16))
    sensor.open(profile)
    sensor.start(queue)
    sent(rs, sensor, profile, images()["depth"])
    np.testing.assert_array_equal(queue.wait_for_frame().as_depth_frame().get_data(), images()["depth"])


@pytest.mark.parametrize(
    ("pixels", "fields", "said"),
    [
        (
            np.zeros((HEIGHT, WIDTH - 1), np.uint16),
            {},
            "the pixels have 6048 bytes and the stride 126, expected 6144 bytes",
        ),
        (np.zeros((HEIGHT, WIDTH), np.uint8), {"stride": 0}, "expected 6144 bytes of 64x48 z16"),
        (np.zeros((HEIGHT, WIDTH), np.uint16), {"profile": None}, "a software frame needs a profile"),
    ],
)
def test_pixels_that_do_not_fit_are_told(pixels, fields, said):
    sensor, profiles, _ = software(rs, kinds=("depth",))
    with pytest.raises(RuntimeError, match=said):
        sent(rs, sensor, profiles["depth"], pixels, **fields)


@pytest.mark.parametrize("baseline_mm", [50.0, 95.0, None])
def test_disparities_are_the_real_ones(baseline_mm):
    reason = "the package pyrealsense2 is not installed (pip install pyrealsense2)"
    real = pytest.importorskip("pyrealsense2", reason=reason)
    found = []
    for module in (rs, real):
        sensor, profiles, frames = software(module, ("depth",), baseline_mm)
        sent(module, sensor, profiles["depth"], images()["depth"])
        depth = frames.wait_for_frames(2000).get_depth_frame() if module is real else frames.wait_for_frames()
        found.append(np.asanyarray(module.disparity_transform().process(depth).get_data()))
    np.testing.assert_allclose(found[0], found[1].view(found[0].dtype), rtol=1e-6)
