# SPDX-License-Identifier: Apache-2.0
"""The infrared pair's memory is one memory: both libraries address it, and no frame is copied."""

import numpy as np
import pytest

import kuafu
import simsense
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.sensor.pictures import IrLink, shared_memory_kind
from sensor_scenes import wall_scene

SIZE = 64 * 48


@pytest.fixture(params=["of its own", "lent"])
def engine_device(device, request):
    """simsense's device on the same GPU: with a VkDevice of its own, or with kuafu's."""
    return simsense.Device(device if request.param == "lent" else device.info.device_uuid)


def test_depth_has_the_same_bits_on_a_lent_device(device):
    noise = np.random.default_rng(1).integers(0, 256, (48, 96), np.uint8)
    camera = simsense.Camera(width=96, height=48, k=[[80, 0, 47.5], [0, 80, 23.5], [0, 0, 1]])
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05

    def depth(on):
        engine = simsense.Engine(on, camera, camera, left_to_right, rectified=True, back_end="vulkan", max_disparity=32)
        return engine.compute(noise, np.roll(noise, -5, 1), ("depth",))["depth"]

    lent = simsense.Device(device)
    assert lent.info.device_uuid == device.info.device_uuid
    own = depth(simsense.Device(device.info.device_uuid))
    assert (own > 0).mean() > 0.5
    np.testing.assert_array_equal(depth(lent), own)
    with pytest.raises(simsense.Error, match="is the host's"):
        kuafu.Device(lent)


def shared_buffers(device, engine_device, memory):
    source = kuafu.Buffer(device, SIZE, exportable=memory == "opaque_fd")
    with source.export(memory) as desc:
        return source, simsense.Buffer.import_(engine_device, desc)


@pytest.mark.parametrize("memory", ["opaque_fd", "host"])
def test_a_mark_written_by_one_is_read_by_the_other(device, engine_device, memory):
    needed = {
        "opaque_fd": ("export_opaque_fd", "import_opaque_fd"),
        "host": ("export_host_pointer", "import_host_pointer"),
    }[memory]
    if not (needed[0] in device.info.capabilities and needed[1] in engine_device.info.capabilities):
        pytest.skip(f"{device.info.name} does not share memory by {memory}")
    source, sink = shared_buffers(device, engine_device, memory)
    np.asarray(source)[17] = 201
    assert np.asarray(sink)[17] == 201
    np.asarray(sink)[18] = 202
    assert np.asarray(source)[18] == 202


def test_a_closed_description_has_no_file_descriptor_any_more(device, engine_device):
    if "export_opaque_fd" not in device.info.capabilities:
        pytest.skip(f"{device.info.name} exports no opaque_fd")
    desc = kuafu.Buffer(device, SIZE, exportable=True).export("opaque_fd")
    desc.close()
    with pytest.raises(ValueError, match="closed"):
        simsense.Buffer.import_(engine_device, desc)


def test_link_gives_each_camera_its_half(device, engine_device):
    link = IrLink(device, engine_device, 64, 48)
    images = link.images()
    images[0], images[1] = 1.0, 2.0
    link.put(images)
    left, right = link._sink.read().view(np.float32).reshape(2, 48, 64)
    assert (left == 1.0).all() and (right == 2.0).all()


def test_memory_of_a_gpu_is_read_and_written_by_copies(device, engine_device, monkeypatch):
    """The copies of a GPU with memory of its own, on any device that shares file descriptors."""
    if shared_memory_kind(device, engine_device) != "opaque_fd":
        pytest.skip(f"{device.info.name} and {engine_device.info.name} share no file descriptors")
    monkeypatch.setattr("activestereo.sensor.pictures.has_own_memory", lambda device: True)
    link = IrLink(device, engine_device, 64, 48, count=2)
    pair = np.random.default_rng(0).random((4, 48, 64), dtype=np.float32)
    link.put(pair)
    np.testing.assert_array_equal(link.images(), pair)
    np.testing.assert_array_equal(link.images(link.count), pair[:2])
    monkeypatch.setattr("activestereo.sensor.pictures._CACHED_BYTES", 3 * pair[0].nbytes)  # two pieces
    link.brighten(np.array([2.0, 3.0], np.float32))
    np.testing.assert_array_equal(link.images(), pair * np.array([2, 3, 2, 3], np.float32)[:, None, None])
    with pytest.raises(BufferError, match="not host-visible"):
        link.target.array()


def test_a_sensor_sees_the_same_in_memory_of_a_gpu(monkeypatch):
    config = StereoDepthSensorConfig("D435").scaled(0.15)
    config.samples_per_pixel, config.max_bounces, config.ir_exposure_mode = 1, 0, "settled"
    seen = []
    for is_on_gpu in (False, True):
        monkeypatch.setattr("activestereo.sensor.pictures.has_own_memory", lambda device, own=is_on_gpu: own)
        sensor = StereoDepthSensor(config, wall_scene(1.0))
        sensor.take_picture(infrared_only=True)
        sensor.compute_depth()
        setting = sensor.get_config().ir_camera_exposure, sensor.get_config().ir_camera_gain
        seen.append([*sensor.get_ir(), *sensor.get_ir_measured(), sensor.get_depth(), setting])
    assert seen[0][-1][0] != config.ir_camera_exposure
    for one, other in zip(*seen, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_frame_copies_nothing(small_config, table_top):
    """Over take_picture and compute_depth both copy counters stand still. A GPU hands the results, which the sensor
    wants as arrays, from its own memory to the host's."""
    small_config.samples_per_pixel, small_config.max_bounces = 1, 0
    sensor = StereoDepthSensor(small_config, table_top)
    assert sensor.ir_memory in ("opaque_fd", "host")
    sensor.take_picture(infrared_only=True)  # the first frame uploads the scene
    sensor.compute_depth()
    before = sensor.device.copied_bytes, sensor.engine.device.copied_bytes
    sensor.take_picture()
    sensor.compute_depth()
    assert sensor.device.copied_bytes == before[0]
    on_gpu = sensor.engine.device.info.kind not in ("host", "cpu")
    handed_over = sum(array.nbytes for array in sensor._engine.maps._found.values()) if on_gpu else 0
    assert sensor.engine.device.copied_bytes - before[1] == handed_over


def test_memory_of_an_array_that_ended_is_used_again(device):
    buffer = kuafu.Buffer(device, 1 << 20)
    buffer.write(np.full(1 << 20, 5, np.uint8))
    first = buffer.read()
    address = first.ctypes.data
    view = first[7:9]
    del first
    buffer.write(np.full(1 << 20, 6, np.uint8))
    second = buffer.read()
    assert second.ctypes.data != address and (view == 5).all()  # a view still refers to it
    del view
    third = buffer.read()
    assert third.ctypes.data == address and (third == 6).all() and third.flags.writeable


def test_a_scene_may_be_of_another_device_than_the_renderer_and_buffers_may_not(device):
    """kuafu_renderer_render: the scene lies in host memory, and each renderer has a copy on its own device."""
    other, scene = kuafu.Device(), wall_scene(1.0)
    scene.set_environment((1.0, 0.5, 0.25))
    texture = scene.add_texture(np.arange(48, dtype=np.uint8).reshape(4, 4, 3))
    scene.set_material(0, kuafu.Material(base_color_texture=texture))
    k = np.array([[30.0, 0, 15.5], [0, 30.0, 15.5], [0, 0, 1]])
    pose = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    images = [
        kuafu.Renderer(own).render(scene, kuafu.Camera(32, 32, k, pose), spp=2)["radiance"].copy()
        for own in (scene.device, other, scene.device)
    ]
    assert images[0].std() > 0
    for image in images[1:]:
        np.testing.assert_array_equal(image, images[0])
    with pytest.raises(ValueError, match="its buffer belongs to another device than the renderer"):
        target = kuafu.Buffer(other, 32 * 32 * 4 * 4).image("f4", (1, 32, 32, 4))
        kuafu.Renderer(scene.device).render(scene, kuafu.Camera(32, 32, k, pose), {"radiance": target}, spp=1)
