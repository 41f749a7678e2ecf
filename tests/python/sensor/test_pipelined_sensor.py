# SPDX-License-Identifier: Apache-2.0
"""Late maps and late pictures have the bits of those that are made at once."""

from types import SimpleNamespace

import numpy as np
import pytest

import kuafu
from activestereo import Mounts, Pose, StereoDepthSensor, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.effects import builtin
from activestereo.model import Quantity, SensorModel
from activestereo.sensor.maps import Maps
from activestereo.sensor.pictures import PictureMemory


def test_maps_that_were_read_are_computed_with_the_next_picture():
    asked = []

    def compute(names):
        asked.append(list(names))
        return {name: np.full((1, 1), len(asked)) for name in names}

    maps = Maps(SimpleNamespace(compute=compute, shape=(), plan=SimpleNamespace(depth_maps=())))
    with pytest.raises(RuntimeError, match="no depth of this picture yet"):
        maps.read("depth_rgb")
    maps.begin()
    assert maps.read("depth_rgb") == 1
    assert maps.read("disparity") == 2 and maps.read("disparity") == 2
    maps.complete()
    maps.begin()
    assert asked == [["depth_rgb"], ["disparity"], ["ir_left", "ir_right"], ["depth_rgb", "disparity"]]
    maps.begin(("ir_left", "disparity"))
    assert asked[4:] == [["depth_rgb", "disparity", "ir_left"]] and maps.read("ir_left") == 5


@pytest.mark.parametrize("host_visible", [True, False])
def test_a_picture_stays_where_it_was_rendered(device, host_visible):
    scene = kuafu.Scene(device)
    scene.set_environment((0.25, 0.5, 1.0))
    renderer, camera = kuafu.Renderer(device), kuafu.Camera(8, 6, [[8, 0, 3.5], [0, 8, 2.5], [0, 0, 1]])
    outputs = {"radiance": (np.float32, 3), "instance_id": (np.uint32, 1)}
    memory = PictureMemory(device, (1, 6, 8), outputs, host_visible)
    renderer.render(scene, camera, memory.targets, band="visible", spp=1)
    image = memory.read("radiance")
    np.testing.assert_allclose(image, np.broadcast_to([0.25, 0.5, 1.0], (1, 6, 8, 3)), rtol=1e-6)
    assert (memory.read("instance_id") == 0xFFFFFFFF).all() and memory.read("radiance") is image
    scene.set_environment((0.0, 0.0, 0.0))
    memory.forget()
    renderer.render(scene, camera, memory.targets, band="visible", spp=1)
    assert image.any() and not memory.read("radiance").any()  # what was read before is the reader's


def test_what_was_read_is_rendered_into_the_hosts_memory_from_then_on(device):
    scene = kuafu.Scene(device)
    renderer, camera = kuafu.Renderer(device), kuafu.Camera(8, 6, [[8, 0, 3.5], [0, 8, 2.5], [0, 0, 1]])
    outputs = {"radiance": (np.float32, 3), "instance_id": (np.uint32, 1), "depth": (np.float32, 1)}
    memory = PictureMemory(device, (1, 6, 8), outputs, host_visible=False)
    first = dict(memory.targets)
    for read in ((), ("radiance", "instance_id"), ()):
        memory.forget()
        renderer.render(scene, camera, memory.targets, band="visible", spp=1)
        assert all((memory.read(name) == 0xFFFFFFFF).all() for name in read if name == "instance_id")
        assert memory.targets == first or not read
        _ = [memory.read(name) for name in read]
    assert [name for name in outputs if memory.targets[name] is not first[name]] == ["instance_id"]
    assert (memory.read("instance_id") == 0xFFFFFFFF).all()
    assert memory.targets["instance_id"].array().shape == first["instance_id"].shape


def test_late_maps_are_of_the_engine_that_the_depth_is_of(small_config, table_top):
    """A penalty that changes after compute_depth() changes nothing of that picture."""
    small_config.samples_per_pixel = 1
    early, late = (StereoDepthSensor(small_config, table_top) for _ in range(2))
    for sensor in (early, late):
        sensor.take_picture(infrared_only=True)
        sensor.compute_depth()
    expected = early.get_disparity(), early.get_ir_measured()
    late.change(p1=1, p2=200)
    late.set_conditions(temperature_c=60.0)
    np.testing.assert_array_equal(late.get_disparity(), expected[0])
    np.testing.assert_array_equal(late.get_ir_measured(), expected[1])
    late.compute_depth()
    assert (late.get_disparity() != expected[0]).any()


def test_an_rgb_picture_outlives_infrared_ones(small_config, table_top):
    small_config.samples_per_pixel = 1
    sensor = StereoDepthSensor(small_config, table_top)
    sensor.take_picture()
    rgb = sensor.get_rgb()
    sensor.take_picture(infrared_only=True)
    np.testing.assert_array_equal(sensor.get_rgb(), rgb)


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
