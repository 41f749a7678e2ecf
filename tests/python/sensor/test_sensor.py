# SPDX-License-Identifier: Apache-2.0
"""StereoDepthSensor in front of the example scene, at half resolution, and in scenes made for one question."""

import re
import os

import numpy as np
import pytest

import kuafu
from activestereo import Mount, Pose, StereoDepthSensor, StereoDepthSensorConfig
from activestereo.common.accuracy import accuracy_by_material
from activestereo.common.pose import body_pose
from sensor_scenes import light_of, sensor_or_batch, wall_scene, with_depth


@pytest.fixture(scope="module")
def table(table_top):
    """A sensor at the scene's camera with one picture taken."""
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.5)
    config.samples_per_pixel, config.max_bounces = 4, 3
    scene = kuafu.Scene(kuafu.Device())
    scene.load(table_top)
    sensor = with_depth(StereoDepthSensor(config, scene, pose=body_pose(scene.camera(0).camera_to_world)))
    return sensor


def accuracies(sensor):
    """{material: accuracy} of the sensor's last picture."""
    maps = sensor.get_depth(), sensor.get_true_depth(), sensor.get_material_ids()
    return {row.name: row for row in accuracy_by_material(*maps, sensor.scene.material_name)}


@pytest.fixture(scope="module")
def by_material(table):
    return accuracies(table)


def test_shapes_and_types(table):
    assert table.get_rgb().shape == (240, 424, 3) and table.get_rgb().dtype == np.float32
    assert [image.shape for image in table.get_ir()] == [(240, 424)] * 2
    assert [(image.shape, image.dtype.name) for image in table.get_ir_measured()] == [((240, 424), "uint8")] * 2
    assert table.get_depth().shape == (240, 424) and table.get_depth().dtype == np.float32
    for picture in (table.get_rgb(), *table.get_ir()):
        assert picture.min() >= 0.0 and picture.max() <= 1.0


def test_bytes_of_the_rgb_picture_are_its_floats_rounded(table):
    rgba = table.get_rgba8()
    assert rgba.shape == (240, 424, 4) and rgba.dtype == np.uint8 and (rgba[..., 3] == 255).all()
    assert np.abs(255.0 * table.get_rgb() - rgba[..., :3]).max() < 0.51
    assert rgba[..., :3].std() > 20


def test_most_of_the_table_is_measured_well(by_material):
    wood = by_material["wood"]
    assert wood.fill > 0.9
    assert wood.median_error_m < 0.012  # of a half-size sensor: f B is 10.8 px m, a tenth of a pixel at 0.9 m is 8 mm


def test_materials_that_break_stereo_do(by_material):
    for name in ("glass", "steel"):  # light goes elsewhere: every match is off
        assert by_material[name].median_error_m > 2 * by_material["clay"].median_error_m, name
    # Little light comes back from velvet: some matches are noise, and some find none.
    assert by_material["velvet"].p90_error_m > 2 * by_material["clay"].p90_error_m


def test_glass_has_more_holes_than_clay(table):
    pictures = [accuracies(with_depth(table)) for _ in range(4)]  # one alone has some 30 holes of each
    glass, clay = (sum(1 - seen[name].fill for seen in pictures) for name in ("glass", "clay"))
    assert glass > 1.5 * clay


def test_infrared_pictures_are_well_exposed(table):
    for image in table.get_ir_measured():
        assert (image == 255).mean() < 0.02
        assert np.percentile(image, 95) > 20


def test_noise_free_infrared_is_what_the_measured_one_scatters_about(table):
    clean, measured = table.get_ir()[0] * 255.0, table.get_ir_measured()[0].astype(float)
    middle = (clean > 10) & (clean < 200)
    residual = measured[middle] - clean[middle]
    assert abs(residual.mean()) < 0.1
    light = clean[middle] - table.get_config().ir_black_level_dn
    expected = np.sqrt((light**2 / 1333.33 + 0.25**2 + 1 / 12).mean())  # gamma factor, Gaussian, rounding
    assert residual.std() == pytest.approx(expected, rel=0.05)


def test_point_cloud_projects_onto_the_depth_map(table):
    depth, k = table.get_depth(), table.get_config().rgb_intrinsic
    cloud = table.get_pointcloud(with_rgb=True)
    assert cloud.shape == ((depth > 0).sum(), 6) and cloud.dtype == np.float32
    u, v = (cloud[:, axis] / cloud[:, 2] * k[axis, axis] + k[axis, 2] for axis in (0, 1))
    columns, rows = np.rint(u).astype(int), np.rint(v).astype(int)
    np.testing.assert_allclose(cloud[:, 2], depth[rows, columns], rtol=1e-6)
    np.testing.assert_allclose(cloud[:, 3:], table.get_rgb()[rows, columns], atol=1e-6)
    assert table.get_pointcloud().shape[1] == 3


def test_pictures_by_name_agree_with_each_other(table):
    depth, position = table.get_picture("depth")[..., 0], table.get_picture("position")
    assert np.array_equal(depth, table.get_true_depth())
    world_to_camera = np.linalg.inv(table.rgb_camera().camera_to_world)
    seen = depth > 0
    np.testing.assert_allclose(position[seen] @ world_to_camera[2, :3] + world_to_camera[2, 3], depth[seen], atol=1e-4)
    uv, visible = table.get_picture("projector_uv", "left"), table.get_picture("projector_visibility", "left")[..., 0]
    assert uv.shape == (240, 424, 2) and np.all(np.isfinite(uv[visible == 1])) and 0.5 < visible.mean() < 1
    with pytest.raises(ValueError, match="rgb, left, right"):
        table.get_picture("depth", "middle")


def test_stage_times_name_the_three_parts(table):
    assert {name.split(":")[0] for name in table.stage_times} == {"rgb", "ir", "depth"}


def test_a_wall_in_front_of_the_sensor_is_as_far_as_it_is(small_config):
    """The default pose looks along x. Only axes, poses, projector, matcher and registration in place give this."""
    small_config.max_bounces = 0
    sensor = with_depth(StereoDepthSensor(small_config, wall_scene(0.9)))
    np.testing.assert_allclose(sensor.get_true_depth(), 0.9, rtol=1e-5)
    depth = sensor.get_depth()[20:-20, 40:-40]
    assert (depth > 0).mean() > 0.99
    assert np.median(depth[depth > 0]) == pytest.approx(0.9, rel=0.005)


def test_moving_the_mount_moves_the_sensor(small_config):
    small_config.max_bounces, small_config.samples_per_pixel = 0, 1
    mount = Mount(wall_scene(0.9), Pose([0.2, 0.0, 0.0]))
    sensor = StereoDepthSensor(small_config, mount, pose=Pose([0.1, 0.0, 0.0]))
    np.testing.assert_allclose(sensor.get_pose().p, [0.3, 0.0, 0.0])
    for local, expected in ((None, 0.6), (Pose([-0.1, 0.0, 0.0]), 0.8)):
        if local:
            sensor.set_local_pose(local)
        sensor.take_picture()
        np.testing.assert_allclose(sensor.get_true_depth(), expected, rtol=1e-5)
    mount.pose = Pose()
    sensor.take_picture()
    np.testing.assert_allclose(sensor.get_true_depth(), 1.0, rtol=1e-5)
    matrix = Pose([0.1, 0.0, 0.0]).to_transformation_matrix()
    np.testing.assert_allclose(
        StereoDepthSensor(small_config, Mount(wall_scene(0.9), matrix), pose=matrix).get_pose().p, [0.2, 0.0, 0.0]
    )


def test_a_mount_without_scene_or_pose_is_told(small_config):
    with pytest.raises(TypeError, match="pose is None"):
        Mount(wall_scene(0.9), None)
    with pytest.raises(TypeError, match="must be a kuafu.Scene, not str"):
        Mount("scene.gltf")


@pytest.mark.parametrize(
    ("name", "words"), [("reason", "config's depth_maps (): name it there"), ("reasn", "did you mean 'reason'?")]
)
def test_a_map_that_the_configuration_lacks_is_refused_with_the_remedy(small_config, name, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        StereoDepthSensor(small_config, wall_scene(1.0)).get_depth_map(name)


@pytest.mark.parametrize(
    ("maps", "words"),
    [
        ("disparity", "expected a sequence of names"),
        (["ir_lef"], "did you mean 'ir_left'"),
        (["reason"], "unknown map"),
    ],
)
def test_depth_is_computed_with_maps_that_can_be_read(small_config, maps, words):
    with pytest.raises((TypeError, ValueError), match=words):
        StereoDepthSensor(small_config, wall_scene(1.0)).compute_depth(maps)


def test_the_projector_is_seen_by_the_infrared_cameras_only(small_config):
    small_config.max_bounces, small_config.samples_per_pixel = 0, 1
    sensor = StereoDepthSensor(small_config, wall_scene(0.9))
    sensor.take_picture()
    assert sensor.get_rgb().max() == 0.0
    assert sensor.get_ir()[0].max() > 0.5
    lights = sensor.scene.summary.light_count
    sensor.close()
    assert sensor.scene.summary.light_count == lights - 1


@pytest.mark.parametrize("kind", ["sensor", "batch"])
def test_a_closed_sensor_keeps_its_results_and_does_nothing_more(small_config, kind):
    small_config.max_bounces, small_config.samples_per_pixel = 0, 1
    sensor = sensor_or_batch(kind, small_config, wall_scene(0.9))
    with sensor:
        with_depth(sensor)
    assert (sensor.get_depth() > 0).any() and (sensor.get_disparity() > 0).any() and sensor.get_rgb().max() == 0.0
    image = np.ones(small_config.ir_resolution[::-1], np.float32)
    acts = [sensor.take_picture, sensor.compute_depth]
    if kind == "batch":
        acts += [lambda: sensor.restart(1), lambda: sensor.vary(laser_power=[1.0]), sensor.render_true_depth]
    else:
        acts += [
            lambda: sensor.change(p1=8),
            lambda: sensor.get_picture("depth"),
            lambda: sensor.set_velocity([1, 0, 0]),
        ]
        acts += [lambda: sensor.set_conditions(30.0), lambda: sensor.set_local_pose(np.eye(4))]
        acts += [lambda: sensor.compute_depth_from(image, image), lambda: sensor.get_depth_map("cause")]
    for act in acts:
        with pytest.raises(RuntimeError, match="is closed .* make a new sensor"):
            act()
    sensor.close()  # twice does nothing
    assert (sensor.get_depth() > 0).any()


def test_same_seed_same_frame_and_a_new_frame_differs(small_config, table_top):
    small_config.max_bounces, small_config.samples_per_pixel = 1, 1
    first, again = (StereoDepthSensor(small_config, table_top) for _ in range(2))
    frames = []
    for sensor, count in ((first, 2), (again, 1)):
        for _ in range(count):
            with_depth(sensor, infrared_only=True)
            frames.append(sensor.get_ir_measured()[0].copy())
    np.testing.assert_array_equal(frames[0], frames[2])
    assert not np.array_equal(frames[0], frames[1])
    again.compute_depth()
    np.testing.assert_array_equal(again.get_ir_measured()[0], frames[2])


def test_setters_reach_the_engine_and_bad_values_change_nothing(small_config):
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    matcher = {"census_width": 5, "census_height": 7, "block_width": 3, "block_height": 5, "p1": 5, "p2": 50}
    matcher |= {"uniqueness_ratio": 20, "lr_max_diff": -1}
    sensor.change(**matcher)
    sensor.change(ir_speckle_noise=2.0, ir_thermal_noise=3.0)
    p = sensor.engine.parameters
    assert {name: p[name] for name in matcher} == matcher
    assert (p["speckle_shape"], p["adc_noise_dn"]) == pytest.approx((1333.33 / 2.0, 0.75))
    sensor.change(ir_speckle_noise=0.0, ir_thermal_noise=0.0)
    assert sensor.engine.parameters["speckle_shape"] == sensor.engine.parameters["adc_noise_dn"] == 0.0
    c = sensor.get_config()
    dn = c.ir_camera_exposure * c.ir_camera_gain * c.ir_responsivity_dn
    assert p["exposure_s"] * p["responsivity_e"] == pytest.approx(dn)
    assert p["black_level_dn"] == small_config.ir_black_level_dn
    for bad in ({"p1": 50, "p2": 5}, {"ir_speckle_noise": 1.0, "ir_thermal_noise": 0.0}, {"census_width": 4}):
        with pytest.raises(ValueError):
            sensor.change(**bad)
    assert sensor.get_config().p1 == 5 and sensor.get_config().ir_speckle_noise == 0.0


def test_a_new_noise_seed_reaches_the_images(small_config):
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    before = with_depth(sensor).get_ir_measured()[0].copy()
    sensor.change(noise_seed=small_config.noise_seed + 1)
    sensor.compute_depth()
    assert (sensor.get_ir_measured()[0] != before).mean() > 0.1


@pytest.mark.parametrize(
    "change", [{"laser_power_mw": 30.0}, {"emitter": "off"}, {"ir_camera_exposure": 1e-4}, {"samples_per_pixel": 99}]
)
def test_what_pictures_depend_on_cannot_change(small_config, change):
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    (name,) = change
    with pytest.raises(ValueError, match=f"{name} of a sensor cannot change"):
        sensor.change(**change)
    assert sensor.get_config() == small_config


def test_either_factor_of_the_noise_takes_the_place_of_an_imager(small_config):
    small_config.ir_signal = "d435"
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    sensor.change(ir_thermal_noise=3.0)
    assert sensor.get_config().ir_signal is None
    assert sensor.engine.parameters["adc_noise_dn"] == pytest.approx(0.75)


def test_noise_free_pictures_are_of_the_imager_that_measures(small_config):
    small_config.ir_signal = {"bit_depth": 12, "gain": 6.0, "black_level_dn": 90.0}
    sensor = with_depth(StereoDepthSensor(small_config, wall_scene(1.0)), infrared_only=True)
    measured = sensor.get_ir_measured()[0]
    assert measured.dtype == np.uint16
    np.testing.assert_allclose(4095 * sensor.get_ir()[0], measured, atol=0.51)


def test_results_before_the_picture_say_what_to_call(small_config):
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    with pytest.raises(RuntimeError, match="take_picture"):
        sensor.compute_depth()
    sensor.take_picture(infrared_only=True)
    with pytest.raises(RuntimeError, match="compute_depth"):
        sensor.get_depth()
    with pytest.raises(RuntimeError, match="infrared_only"):
        sensor.get_rgb()


def test_progress_of_a_picture_rises_to_one_and_its_exceptions_come_through(small_config):
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    seen = []
    sensor.take_picture(progress=seen.append)
    assert seen == sorted(seen) and seen[-1] == pytest.approx(1.0)

    def stop(fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sensor.take_picture(progress=stop)
    sensor.take_picture(infrared_only=True)


def test_a_cancelled_picture_is_none(small_config):
    sensor = with_depth(StereoDepthSensor(small_config, wall_scene(1.0)))
    with pytest.raises(kuafu.CancelledError):
        sensor.take_picture(progress=lambda fraction: fraction > 0.6)  # within the infrared pair
    for get in (sensor.compute_depth, sensor.get_depth, sensor.get_ir, sensor.get_rgb, sensor.get_true_depth):
        with pytest.raises(RuntimeError, match="take_picture|compute_depth"):
            get()
    with_depth(sensor)
    again = StereoDepthSensor(small_config, wall_scene(1.0))
    for _ in range(2):
        again.take_picture()
    again.compute_depth()
    np.testing.assert_array_equal(sensor.get_depth(), again.get_depth())


def test_without_a_projector_it_is_a_passive_pair(small_config):
    small_config.light_pattern = None
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    assert sensor.scene.summary.light_count == 0
    sensor.take_picture(infrared_only=True)
    assert np.ptp(sensor.get_ir()[0]) < 1e-3


def test_a_list_of_dots_takes_the_place_of_the_pattern_image(small_config):
    design = small_config.pattern_design
    small_config.light_dots = [[design.width / 2, design.height / 2, 2 * np.pi * design.dot_sigma_px**2]]
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    sensor.take_picture(infrared_only=True)
    image = sensor.get_ir()[0].astype(float)
    assert np.sum(image > (np.median(image) + image.max()) / 2) < 30 and image.max() > 2 * np.median(image)


def test_what_is_no_scene_is_refused(small_config):
    with pytest.raises(TypeError, match="kuafu.Scene"):
        StereoDepthSensor(small_config, 42)
    with pytest.raises(FileNotFoundError):
        StereoDepthSensor(small_config, "nowhere.gltf")


def test_speckle_is_of_the_laser_alone_where_asked(table_top, small_config):
    scene = kuafu.Scene(kuafu.Device())
    scene.load(table_top)
    small_config.max_bounces, small_config.ir_speckle_of_laser, small_config.ir_ambient_radiance = 0, True, 0.1
    small_config.ir_signal = {"speckle_shape": 4.0, "speckle_scale": 0.25, "bit_depth": 16, "gain": 100.0}
    sensor = with_depth(
        StereoDepthSensor(small_config, scene, pose=body_pose(scene.camera(0).camera_to_world)), infrared_only=True
    )
    c = sensor.get_config()
    counts_per_radiance = 100.0 * c.ir_camera_exposure * c.ir_camera_gain * c.ir_responsivity_dn
    for got, clean, all_light, laser in zip(sensor.get_ir_measured(), sensor.get_ir(), *light_of(sensor), strict=True):
        noise = (got - 65535.0 * clean) / counts_per_radiance
        bright = (laser > 0.01) & (got < 65535)
        assert np.std(noise[bright] / laser[bright]) == pytest.approx(0.5, rel=0.03)  # Gamma(4, 1/4)'s
        ambient = laser < 0.1 * all_light
        assert ambient.sum() > 500
        assert np.std(noise[ambient] / all_light[ambient]) < 0.05


@pytest.mark.parametrize("kind", ["sensor", "batch"])
def test_sensors_that_are_closed_leave_nothing_in_the_scene(kind):
    scene = wall_scene(1.0)
    config = StereoDepthSensorConfig("D435").scaled(0.08)
    device, before = scene.device, None
    for _ in range(10_000 if os.environ.get("ACTIVESTEREO_FULL") else 5):
        sensor_or_batch(kind, config, scene).close()
        s = scene.summary
        counts = s.texture_count, s.light_count, s.material_count, s.instance_count, s.mesh_count
        before = before or (counts, device.allocated_bytes)
        assert (counts, device.allocated_bytes) == before


@pytest.mark.parametrize("kind", ["sensor", "batch"])
def test_a_sensor_that_cannot_be_made_leaves_nothing_in_the_scene(kind, monkeypatch):
    scene = wall_scene(1.0)
    config = StereoDepthSensorConfig("D435").scaled(0.08)

    def refuse(*signals):
        raise ValueError("no such signal")

    monkeypatch.setattr("simsense.Engine.set_signal", refuse)
    with pytest.raises(ValueError, match="no such signal"):
        sensor_or_batch(kind, config, scene)
    assert (scene.summary.texture_count, scene.summary.light_count) == (0, 0)


def test_setters_refuse_what_nothing_can_have(table):
    for linear in ((1e300, 0, 0), (0, np.nan, 0), (0, 0)):
        with pytest.raises(ValueError, match="velocity"):
            table.set_velocity(linear)
    with pytest.raises(ValueError, match="angular velocity in rad/s .1. is 1e\\+09, expected -60 to 60 rad/s"):
        table.set_velocity((0, 0, 0), (0, 1e9, 0))
    with pytest.raises(ValueError, match="linear velocity in m/s .0. is 300, .*divide mm/s by 1000"):
        table.set_velocity((300, 0, 0))
    with pytest.raises(ValueError, match="temperature_c is 298, expected -100 to 200 .*subtract 273.15 from kelvin"):
        table.set_conditions(298)
    with pytest.raises(ValueError, match="time_s"):
        table.set_conditions(20.0, np.inf)
    with pytest.raises(ValueError, match="ir_speckle_noise is nan"):
        table.change(ir_speckle_noise=np.nan, ir_thermal_noise=1.0)


def test_a_batch_refuses_what_no_picture_has():
    config = StereoDepthSensorConfig("D435").scaled(0.08)
    with sensor_or_batch("batch", config, wall_scene(1.0)) as batch:
        for seed in (np.nan, 2**64, 2**32, -1, "x", 1.5):
            with pytest.raises(ValueError, match="the seed is .*expected .*0 to 4294967295"):
                batch.restart(seed)
        batch.restart(2**32 - 1)
        batch.take_picture(infrared_only=True)


def test_radiance_of_ones_own_is_matched_as_the_sensors_own_is(table):
    """Sensors that render and those that are given the same light count and match alike."""
    before = table.get_disparity().copy()
    images, lasers = light_of(table)
    found = table.compute_depth_from(*images, *lasers, outputs=("disparity", "ir_left"), frame_index=table.frame_index)
    np.testing.assert_array_equal(found["disparity"], before)
    np.testing.assert_array_equal(found["ir_left"], table.get_ir_measured()[0])
    np.testing.assert_array_equal(table.get_disparity(), before)


def test_radiance_that_is_none_is_named(table):
    light = np.ones((240, 424), np.float32)
    bad = light.copy()
    bad[3, 5] = np.nan
    with pytest.raises(ValueError, match=r"right\[3, 5\] is nan, expected a radiance"):
        table.compute_depth_from(light, bad)
    with pytest.raises(ValueError, match=r"left is \[2, 2\], expected \[240, 424\]"):
        table.compute_depth_from(np.ones((2, 2)), light)
    with pytest.raises(ValueError, match="come together"):
        table.compute_depth_from(light, light, left_laser=light)
