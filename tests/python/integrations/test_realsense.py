# SPDX-License-Identifier: Apache-2.0
"""A script for a RealSense camera runs on a simulated one: frames, options, geometry, filters."""

import json

import numpy as np
import pytest

import activestereo.realsense as rs
from realsense_frames import frameset, profiles
from activestereo.camera.presets import StereoDepthSensorConfig

_SIZE = (96, 72)


@pytest.fixture
def camera():
    """A pipeline of all four streams, and its profile."""
    rs.simulate(rs.World(frames=40, samples_per_pixel=1, device="cpu"))
    pipeline, config = rs.pipeline(), rs.config()
    config.enable_stream(rs.stream.depth, *_SIZE, rs.format.z16, 30)
    config.enable_stream(rs.stream.infrared, 1, *_SIZE, rs.format.y8, 30)
    config.enable_stream(rs.stream.infrared, 2)
    config.enable_stream(rs.stream.color, 48, 36, rs.format.bgr8, 30)
    profile = pipeline.start(config)
    yield pipeline, profile
    pipeline.stop()
    rs.simulate(rs.World())


def test_a_frameset_has_the_streams_of_the_config_and_its_options_act(camera):
    pipeline, profile = camera
    frames = pipeline.wait_for_frames()
    depth, color = frames.get_depth_frame(), frames.get_color_frame()
    assert np.asanyarray(depth.get_data()).shape == (72, 96) and depth.get_data().dtype == np.uint16
    assert np.asanyarray(color.get_data()).shape == (36, 48, 3) and len(frames) == 4
    y, x = np.argwhere(depth.get_data() > 0)[0]
    assert depth.get_distance(int(x), int(y)) == pytest.approx(1e-3 * depth.get_data()[y, x])
    late = [f.get_frame_metadata(rs.frame_metadata_value.time_of_arrival) for f in (depth, color)]
    assert late == [9, 66]
    sensor = profile.get_device().first_depth_sensor()
    assert sensor.get_option_range(rs.option.laser_power).max == 360
    sensor.set_option(rs.option.laser_power, 360)
    for which, value in ((rs.option.exposure, 4000), (rs.option.depth_units, 0.0005), (rs.option.emitter_on_off, 1)):
        sensor.set_option(which, value)
    assert sensor.get_option(rs.option.enable_auto_exposure) == 0
    pair = [pipeline.wait_for_frames() for _ in range(2)]
    mode = rs.frame_metadata_value.frame_laser_power_mode
    lit, dark = sorted(pair, key=lambda f: -f.get_depth_frame().get_frame_metadata(mode))
    assert [f.get_infrared_frame(2).get_frame_metadata(mode) for f in (lit, dark)] == [1, 0]
    means = [f.get_infrared_frame(1).get_data().mean() for f in (dark, lit)]
    assert means[1] > means[0] + 0.5
    assert lit.get_infrared_frame(1).get_frame_metadata(rs.frame_metadata_value.actual_exposure) == 4000
    assert sensor.get_depth_scale() == lit.get_depth_frame().get_units() == 0.0005
    medians = [np.median(f.get_depth_frame().get_data()[f.get_depth_frame().get_data() > 0]) for f in (frames, lit)]
    assert medians[1] == pytest.approx(2.0 * medians[0], rel=0.1)


def test_presets_and_advanced_settings_reach_the_matcher(camera):
    _, profile = camera
    device = profile.get_device()
    before = device.camera.config()
    device.first_depth_sensor().set_option(rs.option.visual_preset, rs.rs400_visual_preset.high_accuracy)
    assert device.camera.config().uniqueness_ratio > before.uniqueness_ratio
    advanced = rs.rs400_advanced_mode(device)
    advanced.load_json(json.dumps({"param-secondpeakdelta": "10", "controls-laserpower": "30"}))
    assert device.camera.config().uniqueness_ratio < before.uniqueness_ratio
    assert device.camera.config().laser_power_mw == 30
    assert float(json.loads(advanced.serialize_json())["param-secondpeakdelta"]) == 10
    with pytest.raises(RuntimeError, match="param-nothing is unknown"):
        advanced.load_json('{"param-nothing": 1}')


def test_groups_of_controls_are_the_json_s_keys():
    device = rs.device()
    advanced = rs.rs400_advanced_mode(device)
    table = advanced.get_depth_table()
    assert (table.depthUnits, table.disparityShift) == (1000, 0)
    assert advanced.get_depth_control(2).deepSeaSecondPeakThreshold == 1023
    rsm = advanced.get_rsm()
    assert (rsm.rsmBypass, rsm.removeThresh) == (0, 63)
    table.depthClampMax, rsm.rsmBypass = 1200, 1
    advanced.set_depth_table(table)
    advanced.set_rsm(rsm)
    written = json.loads(advanced.serialize_json())
    assert (written["aux-param-depthclampmax"], written["param-usersm"]) == ("1200", "0")
    assert device.camera.config().speckle_max_size == 0
    with pytest.raises(RuntimeError, match="aux-param-depthclampmax is 70000"):
        table.depthClampMax = 70000
        advanced.set_depth_table(table)
    fresh = rs.device()
    before, default = fresh.camera.config(), rs.rs400_advanced_mode(fresh).serialize_json()
    rs.rs400_advanced_mode(fresh).load_json(default)
    assert fresh.camera.config() == before, "the camera's defaults change nothing"
    fresh.first_depth_sensor().set_option(rs.option.depth_units, 0.0005)
    assert fresh.first_depth_sensor().get_depth_scale() == 0.0005
    with pytest.raises(AttributeError, match="get_nothing"):
        advanced.get_nothing()


def test_frames_end_and_drop_by_seed():
    def numbers(seed, arrival=False, **delivery):
        rs.simulate(rs.World(frames=9, seed=seed, **({"drop_share": 0.4} | delivery)))
        pipeline = rs.pipeline()
        pipeline.device().camera.take_picture = lambda time_s, with_color: None
        pipeline.device().camera.depth = lambda: np.zeros((4, 4), np.uint16)
        pipeline.device().camera.light = dict
        config = rs.config()
        config.enable_stream(rs.stream.depth)
        queue = rs.frame_queue(10)
        pipeline.start(config, queue)
        found = []
        with pytest.raises(RuntimeError, match="didn't arrive"):
            while True:
                frames = queue.wait_for_frame()
                late_ms = frames.get_depth_frame().get_frame_metadata(rs.frame_metadata_value.time_of_arrival)
                found.append(late_ms - round(frames.get_timestamp()) if arrival else frames.get_frame_number())
        return found

    assert numbers(3) == numbers(3) != numbers(4)
    assert 0 < len(numbers(3)) < 9
    late_ms = numbers(3, True, drop_share=0.0, jitter_ms=20.0)
    assert len(late_ms) == 9 and np.std(late_ms) > 3.0 and min(late_ms) >= -1
    assert set(numbers(3, True, drop_share=0.0)) <= {8, 9, 10}
    rs.simulate(rs.World())


def test_all_devices_and_pipelines_are_one_camera():
    """As settings of a real camera hold whichever object set them, until it is reset or another is plugged in."""
    rs.simulate(rs.World())
    rs.context().query_devices()[0].first_depth_sensor().set_option(rs.option.laser_power, 30)
    rs.rs400_advanced_mode(rs.device()).load_json('{"param-secondpeakdelta": "10"}')
    stereo = rs.config().resolve(rs.pipeline(rs.context())).get_device().first_depth_sensor()
    camera = rs.pipeline().device().camera
    assert stereo.get_option(rs.option.laser_power) == 30 == camera.config().laser_power_mw
    assert camera.settings.values["param-secondpeakdelta"] == 10
    asked = rs.config()
    asked.enable_stream(rs.stream.depth, 96, 72)
    first, second = rs.pipeline(), rs.pipeline()
    first.start(asked)
    with pytest.raises(RuntimeError, match="Device or resource busy: another pipeline has the camera"):
        second.start()
    first.stop()
    assert second.start().get_stream(rs.stream.depth).width() == 848  # not the other config's
    for change in (rs.device().hardware_reset, lambda: rs.simulate(rs.World())):
        rs.device().first_depth_sensor().set_option(rs.option.laser_power, 30)
        change()
        assert rs.pipeline().device().camera.config().laser_power_mw != 30


@pytest.mark.parametrize(
    "ask, told",
    [
        (lambda c: c.enable_stream(rs.stream.depth, 64, 48, rs.format.rgb8, 30), "is not simulated"),
        (lambda c: c.enable_stream(rs.stream.infrared, 3), "infrared has the index 1 or 2, not 3"),
        (lambda c: c.enable_stream(rs.stream.depth, framerate=-30), "-30 frames a second"),
        (lambda c: c.enable_stream(rs.stream.depth, width=64), "a size of 64x0: give both sides"),
        (lambda c: rs.pipeline().start(c, lambda frame: None), "takes a config and a frame_queue, not a function"),
        (lambda c: c.enable_device_from_file("a.bag"), "plays no recordings"),
        (lambda c: rs.pipeline().wait_for_frames(), "cannot be called before start"),
        (lambda c: rs.device().first_depth_sensor().set_option(rs.option.laser_power, 1e4), "expected 0 to 360"),
        (lambda c: rs.device().first_color_sensor().set_option(rs.option.laser_power, 1), "doesn't support"),
    ],
)
def test_what_is_not_there_is_a_runtime_error(ask, told):
    with pytest.raises(RuntimeError, match=told):
        ask(rs.config())


# ---- geometry, on frames without a picture ----


def test_points_and_pixels_are_each_other_s_inverse_and_extrinsics_too():
    depth, color = profiles()
    point = rs.rs2_deproject_pixel_to_point(depth.get_intrinsics(), [10, 40], 2.0)
    np.testing.assert_allclose(point, [(10 - 31.5) / 25, (40 - 23.5) / 25, 2.0])
    np.testing.assert_allclose(rs.rs2_project_point_to_pixel(depth.get_intrinsics(), point), [10, 40])
    there, back = depth.get_extrinsics_to(color), color.get_extrinsics_to(depth)
    np.testing.assert_allclose(rs.rs2_transform_point_to_point(there, point), np.array(point) + [-0.015, 0, 0])
    np.testing.assert_allclose(there.matrix() @ back.matrix(), np.eye(4), atol=1e-12)


def test_align_moves_depth_by_its_parallax():
    frames = frameset(shift_m=-0.1)  # 5 px at 1 m
    whole = np.full((48, 64), 1000, np.uint16)
    frames = rs.composite_frame([frames.get_depth_frame().changed(whole), frames.get_color_frame()])
    moved = rs.align(rs.stream.color).process(frames).get_depth_frame().get_data()
    assert (moved[:, :58] == 1000).all() and (moved[:, 60:] == 0).all()
    same = rs.align(rs.stream.depth).process(frames).get_color_frame().get_data()
    np.testing.assert_array_equal(same[:, 6:], frames.get_color_frame().get_data()[:, 1:59])


def test_the_point_cloud_is_coloured_where_the_colour_camera_sees_it(tmp_path):
    frames, cloud = frameset(), rs.pointcloud()
    cloud.map_to(frames.get_color_frame())
    points = cloud.calculate(frames.get_depth_frame())
    z = points.get_vertices(2)[:, 2].reshape(48, 64)
    np.testing.assert_allclose(z, 1e-3 * frames.get_depth_frame().get_data(), rtol=1e-6)
    assert np.asanyarray(points.get_vertices()).view(np.float32).reshape(-1, 3).shape == (48 * 64, 3)
    points.export_to_ply(tmp_path / "cloud.ply", frames.get_color_frame())
    header = (tmp_path / "cloud.ply").read_bytes()[:300]
    assert f"element vertex {(z > 0).sum()}".encode() in header and b"uchar red" in header


def test_casts_and_questions_of_scripts_have_answers():
    frames = frameset()
    depth, color = frames.get_depth_frame(), frames.get_color_frame()
    assert depth.is_depth_frame() and color.is_video_frame() and not color.is_depth_frame() and frames.is_frameset()
    assert depth.as_frame() is depth.as_video_frame() is depth.as_depth_frame() is depth
    assert frames.as_frameset() is frames and frames.size() == 2
    assert (color.get_width(), color.get_height()) == (64, 48) and color.get_profile().is_video_stream_profile()
    assert frames.first(rs.stream.color) is color and frames.first_or_default(rs.stream.infrared) is None
    assert depth.get_frame_number() == 1
    picture = np.asanyarray(rs.colorizer().colorize(depth).get_data())
    assert picture.shape == (48, 64, 3) and (picture[depth.get_data() == 0] == 0).all()


def test_sensors_and_configs_answer_scripts():
    (device,) = rs.context().query_devices()
    stereo, rgb = device.query_sensors()
    assert (
        device.first_depth_sensor() is stereo and device.first_color_sensor() is rgb and device.sensors == [stereo, rgb]
    )
    assert rs.option.stereo_baseline in stereo.get_supported_options()
    assert stereo.is_option_read_only(rs.option.stereo_baseline)
    stereo.set_option(rs.option.laser_power, 30)
    advanced = rs.rs400_advanced_mode(device)
    device.hardware_reset()
    assert device.first_depth_sensor().get_option(rs.option.laser_power) != 30
    advanced.toggle_advanced_mode(True)
    advanced.load_json('{"controls-laserpower": "30"}')
    assert advanced.is_enabled() and device.camera.config().laser_power_mw == 30, "the camera after the reset"
    config = rs.config()
    config.enable_device(device.get_info(rs.camera_info.serial_number))
    config.resolve(rs.pipeline())
    config.enable_device("841512070000")
    with pytest.raises(RuntimeError, match="No device connected with '841512070000': .* has '000000000000'; World"):
        rs.pipeline().start(config)
    rs.simulate(rs.World(serial_number="841512070000"))
    assert config.resolve(rs.pipeline()).get_device().get_info(rs.camera_info.serial_number) == "841512070000"
    rs.simulate(rs.World())
    config.enable_all_streams()
    config.disable_all_streams()
    with pytest.raises(RuntimeError, match="record with write_topics"):
        config.enable_record_to_file("a.bag")


@pytest.mark.parametrize(
    "fault", [{"drop_share": 1.0}, {"jitter_ms": -1.0}, {"latency_ms": {rs.stream.depth: -9.0}}, {"frames": 1.5}]
)
def test_a_world_delivers_by_numbers_that_can_be(fault):
    """A share of 1 would let a script wait without end."""
    with pytest.raises(ValueError, match=next(iter(fault))):
        rs.World(**fault)


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
