# SPDX-License-Identifier: Apache-2.0
"""Maps that are read late have the bits of those that are computed at once; pictures stay where they were rendered."""

from types import SimpleNamespace

import numpy as np
import pytest

import kuafu
from activestereo import StereoDepthSensor
from activestereo.sensor.maps import Maps
from activestereo.sensor.pictures import PictureMemory
from sensor_scenes import with_depth


def test_maps_that_were_read_are_computed_with_the_next_picture():
    asked = []

    def compute(names):
        asked.append(list(names))
        return {name: np.full((1, 1), len(asked)) for name in names}

    maps = Maps(SimpleNamespace(compute=compute, shape=(), plan=SimpleNamespace(config=SimpleNamespace(depth_maps=()))))
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
    early, late = (with_depth(StereoDepthSensor(small_config, table_top), infrared_only=True) for _ in range(2))
    expected = early.get_disparity(), early.get_ir_measured()
    late.change(p1=1, p2=200)
    late.set_conditions(temperature_c=60.0)
    np.testing.assert_array_equal(late.get_disparity(), expected[0])
    np.testing.assert_array_equal(late.get_ir_measured(), expected[1])
    late.compute_depth()
    assert (late.get_disparity() != expected[0]).any()


def test_an_infrared_picture_has_no_rgb_of_an_earlier_one(small_config, table_top):
    small_config.samples_per_pixel = 1
    sensor = StereoDepthSensor(small_config, table_top)
    sensor.take_picture()
    assert sensor.get_rgb().any()
    sensor.take_picture(infrared_only=True)
    for get in (sensor.get_rgb, sensor.get_rgba8, sensor.get_true_depth, sensor.get_instance_ids):
        with pytest.raises(RuntimeError, match="the last picture has no RGB: .* without infrared_only"):
            get()
