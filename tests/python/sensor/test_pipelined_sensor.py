# SPDX-License-Identifier: Apache-2.0
"""A sensor that renders the next picture while this one is matched gives the serial bits, one picture late."""

import numpy as np
import pytest

import kuafu
from activestereo import Mounts, Pose, StereoDepthSensor, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.effects import builtin
from activestereo.model import Quantity, SensorModel

COUNT = 3


@pytest.fixture
def config():
    config = StereoDepthSensorConfig("d435").scaled(0.25)
    config.samples_per_pixel, config.max_bounces, config.denoise = 1, 1, "none"
    config.depth_maps = ("confidence",)
    return config


def small_world():
    """A wall and a square before it, which each picture moves; its instance."""
    scene = kuafu.Scene(kuafu.Device())
    scene.set_environment((0.3, 0.3, 0.3), 0.3)
    material = scene.add_material(kuafu.Material(base_color=(0.5, 0.4, 0.3, 1.0), specular=0.0))
    numbers = []
    for x, half in ((1.2, 9.0), (0.8, 0.2)):
        corners = np.array([[x, y, z] for y in (-half, half) for z in (-half, half)], np.float32)
        numbers.append(scene.add_instance(scene.add_mesh(corners, [[0, 1, 3], [0, 3, 2]]), [material]))
    return scene, numbers[1]


def move(scene, square, step):
    pose = np.eye(4)
    pose[1, 3] = 0.05 * step
    scene.set_instance_pose(square, pose)


def results(sensor, with_rgb):
    sensor.compute_depth()
    found = [sensor.get_depth(), sensor.get_disparity(), *sensor.get_ir_measured(), *sensor.get_ir()]
    found += [sensor.get_depth_map("confidence"), np.array(sensor.frame_index)]
    if with_rgb:
        found += [sensor.get_rgb(), sensor.get_rgba8(), sensor.get_true_depth(), sensor.get_instance_ids()]
    return [np.array(image) for image in found]


def serial(config, with_rgb):
    scene, square = small_world()
    with StereoDepthSensor(config, scene) as sensor:
        for step in range(COUNT):
            move(scene, square, step)
            sensor.set_local_pose(Pose([0.0, 0.0, 0.01 * (step // 2)]))
            sensor.take_picture(infrared_only=not with_rgb)
            yield results(sensor, with_rgb)


def late(config, with_rgb):
    scene, square = small_world()
    with StereoDepthSensor(config, scene, pipelined=True) as sensor:
        for step in range(COUNT + 1):
            sensor.wait()
            move(scene, square, min(step, COUNT - 1))
            sensor.set_local_pose(Pose([0.0, 0.0, 0.01 * (step // 2)]))
            sensor.take_picture(infrared_only=not with_rgb)
            assert sensor.has_picture == (step > 0)
            if step > 0:
                yield results(sensor, with_rgb)


@pytest.mark.parametrize(
    "mode, emitter, with_rgb", [("fixed", "on", True), ("converging", "alternating", False), ("settled", "on", False)]
)
def test_bits_are_the_serial_ones(config, mode, emitter, with_rgb):
    config.ir_exposure_mode, config.emitter = mode, emitter
    pictures = list(serial(config, with_rgb))
    assert len(pictures) == COUNT and not np.array_equal(pictures[0][2], pictures[1][2])
    for expected, found in zip(pictures, late(config, with_rgb), strict=True):
        for one, other in zip(expected, found, strict=True):
            np.testing.assert_array_equal(one, other)


def batch_pictures(config, count, pipelined):
    """Pictures of two environments, one darker than the other, after each picture that has results."""
    scene, square = small_world()
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, 1, 3] = 0.1
    with StereoDepthSensorBatch(config, Mounts(scene, poses), pipelined=pipelined) as batch:
        batch.vary(1, np.array([1.0]), np.array([0.6]), np.eye(3)[None])
        for step in range(count):
            batch.wait()
            move(scene, square, min(step, COUNT - 1))
            batch.take_picture()
            assert batch.has_picture == (step > 0 or not pipelined)
            if batch.has_picture:
                batch.compute_depth()
                found = [batch.get_depth(), *batch.get_ir_measured(), batch.get_ir_radiance(), batch.get_rgba8()]
                yield [np.array(image) for image in (*found, batch.get_rgb(), batch.get_instance_ids())]


def test_bits_of_a_batch_are_the_serial_ones(config):
    config.ir_exposure_mode = "settled"
    pictures = list(batch_pictures(config, COUNT, False))
    assert not np.array_equal(pictures[0][1], pictures[1][1])
    for expected, found in zip(pictures, batch_pictures(config, COUNT + 1, True), strict=True):
        for one, other in zip(expected, found, strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_batch_starts_anew_while_pictures_are_under_way(config):
    config.ir_exposure_mode = "fixed"
    scene, square = small_world()
    with StereoDepthSensorBatch(config, Mounts(scene, np.eye(4)[None]), pipelined=True) as batch:
        depths = []
        for _ in range(2):
            batch.restart(7)
            for _ in range(2):
                batch.take_picture(infrared_only=True)
            batch.compute_depth()
            depths.append(batch.get_depth().copy())
        np.testing.assert_array_equal(*depths)
        with pytest.raises(kuafu.Error):
            batch.take_picture()
            move(scene, square, 1)
        assert batch.render_true_depth().max() > 1.0
        move(scene, square, 1)


def test_the_scene_changes_only_after_waiting(config):
    config.samples_per_pixel = 16
    scene, square = small_world()
    with StereoDepthSensor(config, scene, pipelined=True) as sensor:
        with pytest.raises(RuntimeError, match="no picture yet"):
            sensor.compute_depth()
        sensor.take_picture(infrared_only=True)
        with pytest.raises(kuafu.Error):
            move(scene, square, 1)
        sensor.wait()
        move(scene, square, 1)
        sensor.take_picture(infrared_only=True)
        sensor.compute_depth()
        before = sensor.get_disparity()
        sensor.change(p1=1, p2=200)  # waits; what has been computed stays
        np.testing.assert_array_equal(sensor.get_disparity(), before)
        with pytest.raises(ValueError, match="no progress"):
            sensor.take_picture(progress=lambda share: False)
    move(scene, square, 2)  # close() has waited


@pytest.mark.parametrize("mode, count", [("fixed", 2), ("converging", 2), ("settled", 1)])
def test_new_noise_holds_for_the_next_depth(config, mode, count):
    """As of the serial sensor, for the picture that is there and for the one that is rendered, which has settled under
    the noise before."""
    config.ir_exposure_mode = mode
    scene, _ = small_world()
    serial, late = [], []
    with StereoDepthSensor(config, scene) as sensor:
        for step in range(count):
            sensor.take_picture(infrared_only=True)
            if step == 0:
                quiet = np.array(results(sensor, False)[2])
                sensor.change(ir_speckle_noise=40.0, ir_thermal_noise=10.0)
            serial.append(results(sensor, False))
    with StereoDepthSensor(config, scene, pipelined=True) as sensor:
        sensor.take_picture(infrared_only=True)
        sensor.wait()
        for step in range(count):
            sensor.take_picture(infrared_only=True)
            if step == 0:
                sensor.change(ir_speckle_noise=40.0, ir_thermal_noise=10.0)
            late.append(results(sensor, False))
    assert not np.array_equal(serial[0][2], quiet)
    for expected, found in zip(serial, late, strict=True):
        for one, other in zip(expected, found, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("waits", [True, False])
def test_a_picture_keeps_the_exposure_that_it_settled_at(config, waits):
    config.ir_exposure_mode, config.emitter = "settled", "off"
    scene, _ = small_world()
    with StereoDepthSensor(config, scene, pipelined=True) as sensor:
        sensor.take_picture(infrared_only=True)
        sensor.wait()
        scene.set_environment((0.9, 0.9, 0.9), 0.9)
        sensor.take_picture(infrared_only=True)
        if waits:
            sensor.wait()
        sensor.change(p1=8, p2=200)
        sensor.take_picture(infrared_only=True)
        assert 255.0 * sensor.get_ir()[0].mean() == pytest.approx(config.ir_exposure_target_dn, rel=0.1)


def test_a_sensor_that_is_forgotten_leaves_the_scene(config):
    scene, square = small_world()
    lights = scene.summary.light_count
    sensor = StereoDepthSensor(config, scene, pipelined=True)
    sensor.take_picture(infrared_only=True)
    assert scene.summary.light_count == lights + 1
    del sensor
    assert scene.summary.light_count == lights
    move(scene, square, 1)


def test_effects_outside_of_the_engines_are_refused(config):
    scene, _ = small_world()
    lights = scene.summary.light_count
    model = SensorModel().with_effect(builtin()["quantisation"], {"step_dn": Quantity(16.0)})
    with pytest.raises(ValueError, match="such sensors have no quantisation: a StereoDepthSensor has"):
        StereoDepthSensor(config, scene, model=model, pipelined=True)
    assert scene.summary.light_count == lights
