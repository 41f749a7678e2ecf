# SPDX-License-Identifier: Apache-2.0
"""Memory that both libraries, and other libraries' arrays, share."""

import gc
import re
import subprocess
import sys
import weakref
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.sensor.pictures import IrLink, shared_memory_kind
from sensor_scenes import wall_scene, with_depth
from depth_engines import depth_engine

import kuafu
import simsense

SIZE = 64 * 48


@pytest.fixture(params=["of its own", "lent"])
def engine_device(device, request):
    """simsense's device on the same GPU: with a VkDevice of its own, or with kuafu's."""
    return simsense.Device(device if request.param == "lent" else device.info.device_uuid)


def test_depth_has_the_same_bits_on_a_lent_device(device):
    noise = np.random.default_rng(1).integers(0, 256, (48, 96), np.uint8)

    def depth(on):
        engine = depth_engine((96, 48), 80, on, back_end="vulkan", max_disparity=32)
        return engine.compute(noise, np.roll(noise, -5, 1), ("depth",))["depth"]

    lent = simsense.Device(device)
    assert lent.info.device_uuid == device.info.device_uuid
    own = depth(simsense.Device(device.info.device_uuid))
    assert (own > 0).mean() > 0.5
    np.testing.assert_array_equal(depth(lent), own)
    with pytest.raises(simsense.Error, match="is the host's"):
        kuafu.Device(lent)


@pytest.mark.parametrize("memory", ["opaque_fd", "host"])
def test_a_mark_written_by_one_is_read_by_the_other(device, engine_device, memory):
    kind = "opaque_fd" if memory == "opaque_fd" else "host_pointer"
    if f"export_{kind}" not in device.info.capabilities or f"import_{kind}" not in engine_device.info.capabilities:
        pytest.skip(f"{device.info.name} does not share memory by {memory}")
    source = kuafu.Buffer(device, SIZE, exportable=memory == "opaque_fd")
    with source.export(memory) as desc:
        sink = simsense.Buffer.import_(engine_device, desc)
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
        sensor = with_depth(StereoDepthSensor(config, wall_scene(1.0)), infrared_only=True)
        setting = sensor.get_config().ir_camera_exposure, sensor.get_config().ir_camera_gain
        seen.append([*sensor.get_ir(), *sensor.get_ir_measured(), sensor.get_depth(), setting])
    assert seen[0][-1][0] != config.ir_camera_exposure
    for one, other in zip(*seen, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_frame_copies_nothing(small_config, table_top):
    """Both copy counters stand still; but a GPU hands the results, wanted as arrays, from its memory to the host's."""
    small_config.samples_per_pixel, small_config.max_bounces = 1, 0
    sensor = StereoDepthSensor(small_config, table_top)
    assert sensor.ir_memory in ("opaque_fd", "host")
    with_depth(sensor, infrared_only=True)  # the first frame uploads the scene
    before = sensor.device.copied_bytes, sensor.engine.device.copied_bytes
    with_depth(sensor)
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


FORMATS = ["uint8", "uint16", "int16", "uint32", "float16", "float32"]
MODULES = [kuafu, simsense]


@pytest.fixture(params=MODULES, ids=lambda module: module.__name__)
def module(request: pytest.FixtureRequest) -> ModuleType:
    return request.param


@pytest.fixture
def own_device(module: ModuleType) -> Any:
    return module.Device("cpu")


@pytest.fixture
def buffer(module: ModuleType, own_device: Any) -> Any:
    return module.Buffer(own_device, 4096)


def read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


@pytest.mark.parametrize("dtype", FORMATS)
def test_numpy_sees_an_images_memory_by_each_protocol(buffer: Any, dtype: str) -> None:
    image = buffer.image(dtype, (2, 3, 5), 64)
    plain = image.array()
    plain[:] = np.arange(30).reshape(2, 3, 5)
    for seen in (np.asarray(image), np.from_dlpack(image)):
        assert seen.ctypes.data == plain.ctypes.data and seen.dtype == plain.dtype and seen.shape == (2, 3, 5)
        plain[1, 2, 4] = 77
        assert seen[1, 2, 4] == 77
        plain[1, 2, 4] = 29
        if seen.flags.writeable:  # NumPy before 2.1 shows what comes by DLPack read-only
            seen[0, 0, 0] = 78
            assert plain[0, 0, 0] == 78
            plain[0, 0, 0] = 0
    assert np.asarray(image).flags.writeable
    assert image.__dlpack_device__() == (1, 0)
    assert image.__array_interface__["version"] == 3


def test_a_buffer_is_its_bytes(buffer: Any) -> None:
    np.asarray(buffer)[:4] = (1, 2, 3, 4)
    for seen in (np.from_dlpack(buffer), np.asarray(buffer), np.asarray(memoryview(buffer))):
        assert seen.dtype == np.uint8 and seen.shape == (4096,) and list(seen[:4]) == [1, 2, 3, 4]
    assert buffer.__array_interface__["data"][0] == np.asarray(buffer).ctypes.data


def test_what_is_shared_outlives_its_names(module: ModuleType, own_device: Any) -> None:
    buffer = module.Buffer(own_device, 4096)
    image = buffer.image("float32", (4, 4))
    views = [np.asarray(image), np.from_dlpack(image), np.from_dlpack(buffer)]
    views[0][:] = 5
    del buffer, image
    gc.collect()
    assert (views[1] == 5).all() and views[2][3] == 64


def test_the_host_s_memory_has_no_stream(buffer: Any) -> None:
    with pytest.raises((RuntimeError, BufferError), match="stream"):
        buffer.image("uint8", (4,)).__dlpack__(stream=1)


@pytest.mark.parametrize("dtype", FORMATS)
def test_an_array_of_another_library_becomes_an_image(module: ModuleType, own_device: Any, dtype: str) -> None:
    array = np.zeros((16, 64), dtype)
    image = module.Image.from_dlpack(own_device, array)
    assert image.shape == (16, 64) and image.dtype == array.dtype
    assert image.array().ctypes.data == array.ctypes.data
    image.array()[3, 5] = 9
    assert array[3, 5] == 9
    array[3, 6] = 10
    assert image.array()[3, 6] == 10


def test_strides_cross(own_device: Any, module: ModuleType) -> None:
    whole = np.arange(32 * 64, dtype=np.float32).reshape(32, 64)
    for view in (whole[::2, 16:48], whole[::-1], whole.T):
        image = module.Image.from_dlpack(own_device, view)
        np.testing.assert_array_equal(image.array(), view)
        assert image.array().strides == view.strides


def test_the_producer_lives_as_long_as_the_image(module: ModuleType, own_device: Any) -> None:
    class Array(np.ndarray):
        """One that can be watched."""

    array = np.zeros((8, 8), np.float32).view(Array)
    watched = weakref.ref(array)
    image = module.Image.from_dlpack(own_device, array)
    del array
    gc.collect()
    assert watched() is not None
    del image
    gc.collect()
    assert watched() is None


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: np.zeros((4, 4)), "no image can hold float64"),
        (lambda: np.zeros((0, 4), np.uint8), "empty"),
        (lambda: np.zeros((1,) * 6, np.uint8), "6 dimensions"),
        (lambda: read_only(np.zeros(64, np.uint8)), "read-?only"),
        (lambda: [1, 2, 3], "__dlpack__"),
    ],
)
def test_what_cannot_be_taken_is_one_error(
    module: ModuleType, own_device: Any, make: Callable[[], Any], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        module.Image.from_dlpack(own_device, make())


def test_simsense_computes_on_an_array_of_another_library() -> None:
    device = simsense.Device("host")
    engine = depth_engine((40, 32), 40, device, max_disparity=16)
    pair = np.random.default_rng(1).integers(0, 255, (2, 32, 40), dtype=np.uint8)
    depth = np.full((32, 40), -1, np.float32)
    images = [simsense.Image.from_dlpack(device, array) for array in (pair[0], pair[1], depth)]
    engine.compute(images[0], images[1], {"depth": images[2]})
    np.testing.assert_array_equal(depth, engine.compute(pair[0], pair[1])["depth"])


def test_a_view_at_the_interpreters_end_is_let_go() -> None:
    program = "import kuafu, numpy; keep = numpy.from_dlpack(kuafu.Buffer(kuafu.Device('cpu'), 64)); print('fine')"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (said.returncode, said.stdout, said.stderr) == (0, "fine\n", "")


@pytest.mark.parametrize("module", ["kuafu", "simsense"])
def test_a_build_that_misreads_numpy_2_says_so(module) -> None:
    """pybind11 before 2.12 takes NumPy 2's types for empty ones. PyPI's wheels are built by a newer one."""
    header = Path("/usr/include/pybind11/detail/common.h")
    if (
        "site-packages" in kuafu.__file__
        or not header.exists()
        or int(re.search(r"VERSION_MINOR (\d+)", header.read_text())[1]) >= 12
    ):
        pytest.skip("this build's pybind11 knows NumPy 2")
    line = f"import numpy; numpy.__version__ = '2.1.0'; import {module}"
    run = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "2.1.0 is installed: pip install 'numpy<2'" in run.stderr
