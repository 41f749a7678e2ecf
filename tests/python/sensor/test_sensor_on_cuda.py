# SPDX-License-Identifier: Apache-2.0
"""A sensor whose results are CUDA's, and CUDA's memory."""

import ctypes as c
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from activestereo import Mounts, StereoDepthSensor, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.common.pose import rigid_motion
from activestereo.effects import builtin
from activestereo.model import Quantity, SensorModel
from activestereo.sensor.cuda_memory import CudaError, CudaMemory
from cuda_stub import exportable, place_in_file, seen_by_host, stub_for
from depth_engines import depth_engine
from sensor_scenes import with_depth

import kuafu
import simsense

NAMES = ("depth", "disparity", "ir_left", "confidence", "rgba8", "true_depth", "instance_ids", "material_ids")


def cpu_of(module: ModuleType) -> Any:
    """The stub of CUDA maps memory that has an address of the host."""
    try:
        return module.Device("cpu")
    except module.NoDeviceError as error:
        pytest.skip(str(error))


@pytest.fixture
def device() -> kuafu.Device:
    return cpu_of(kuafu)


@pytest.fixture
def config() -> StereoDepthSensorConfig:
    config = StereoDepthSensorConfig("d435").scaled(0.2)
    config.samples_per_pixel, config.max_bounces, config.denoise = 1, 1, "none"
    config.depth_maps = ("confidence",)
    return config


def world(device: kuafu.Device) -> tuple[kuafu.Scene, Any]:
    """A wall, and how far it is set."""
    scene = kuafu.Scene(device)
    corners = np.float32([[1, y, z] for y in (-9, 9) for z in (-9, 9)])
    wall = scene.add_instance(scene.add_mesh(corners, np.uint32([[0, 1, 3], [0, 3, 2]])))
    scene.set_environment((0.3, 0.2, 0.1), 0.3)

    def set_wall(away_m: float) -> None:
        scene.set_instance_pose(wall, rigid_motion((away_m, 0, 0)))

    return scene, set_wall


def host_results(sensor: StereoDepthSensor) -> dict[str, np.ndarray]:
    found = {name: getattr(sensor, f"get_{name}")() for name in NAMES if name not in ("ir_left", "confidence")}
    found |= {"ir_left": sensor.get_ir_measured()[0], "confidence": sensor.get_depth_map("confidence")}
    return {name: image.copy() for name, image in found.items()}


def pictures(sensor: StereoDepthSensor, set_wall: Any) -> Iterator[dict[str, np.ndarray]]:
    """The results of two pictures, and of the second under another matcher."""
    for step in range(2):
        set_wall(0.1 * step)
        with_depth(sensor)
        yield host_results(sensor)
    sensor.change(census_width=3, census_height=3)  # what is read now is of before
    yield host_results(sensor)
    sensor.compute_depth()
    yield host_results(sensor)


def test_results_are_cudas_with_the_bits_of_the_hosts(
    device: kuafu.Device,
    config: StereoDepthSensorConfig,
    monkeypatch: pytest.MonkeyPatch,
    stub_cuda: Path,
) -> None:
    stub_for(device, stub_cuda, monkeypatch)
    scene, set_wall = world(device)
    with StereoDepthSensor(config, scene) as sensor:
        expected = list(pictures(sensor, set_wall))
    assert not np.array_equal(expected[0]["depth"], expected[1]["depth"])
    assert not np.array_equal(expected[2]["depth"], expected[3]["depth"])
    scene, set_wall = world(device)
    with StereoDepthSensor(config, scene, on_cuda=True) as sensor:
        with pytest.raises(RuntimeError, match="no picture yet|no depth of this picture yet"):
            sensor.get_cuda("depth")
        for number, found in enumerate(pictures(sensor, set_wall)):
            for name, image in found.items():
                np.testing.assert_array_equal(image, expected[number][name], err_msg=name)
                there = seen_by_host(sensor.get_cuda(name))
                np.testing.assert_array_equal(there, image, err_msg=name, strict=True)
        assert seen_by_host(sensor.get_cuda("radiance")).shape == (*image.shape[:2], 3)
        with pytest.raises(ValueError, match="a sensor has no 'rgb' for CUDA .*depth, .*rgba8"):
            sensor.get_cuda("rgb")
        with pytest.raises(ValueError, match="'reason' is none of the config's depth_maps"):
            sensor.get_cuda("reason")


def test_what_cannot_be_on_cuda_is_refused_and_leaves_the_scene(
    device: kuafu.Device, config: StereoDepthSensorConfig, monkeypatch: pytest.MonkeyPatch, stub_cuda: Path
) -> None:
    scene, _ = world(device)
    with StereoDepthSensor(config, scene) as sensor, pytest.raises(RuntimeError, match="on_cuda=True"):
        sensor.get_cuda("depth")
    lights, mounts = scene.summary.light_count, Mounts(scene, np.eye(4)[None])
    with monkeypatch.context() as patch:
        patch.setitem(CudaMemory.__init__.__kwdefaults__, "library", "/nowhere/libcuda.so.1")
        for kind, place in ((StereoDepthSensor, scene), (StereoDepthSensorBatch, mounts)):
            with pytest.raises(CudaError, match="there is no CUDA driver"):
                kind(config, place, on_cuda=True)
    stub_for(device, stub_cuda, monkeypatch)
    model = SensorModel().with_effect(builtin()["quantisation"], {"step_dn": Quantity(16.0)})
    with pytest.raises(ValueError, match="such sensors have no quantisation: .* without on_cuda"):
        StereoDepthSensor(config, scene, model=model, on_cuda=True)
    assert scene.summary.light_count == lights


def test_torch_has_a_sensors_results_where_they_were_made(torch_on_a_gpu: Any, config: StereoDepthSensorConfig) -> None:
    scene, set_wall = world(kuafu.Device("auto"))
    with StereoDepthSensor(config, scene) as plain, StereoDepthSensor(config, scene, on_cuda=True) as sensor:
        for step in range(2):
            set_wall(0.1 * step)
            for each in (plain, sensor):
                with_depth(each)
            expected = host_results(plain)
            for name, image in host_results(sensor).items():
                np.testing.assert_array_equal(image, expected[name], err_msg=name, strict=True)
                if image.dtype != np.uint32:  # which older PyTorch does not have
                    tensor = torch_on_a_gpu.as_tensor(sensor.get_cuda(name), device="cuda")
                    np.testing.assert_array_equal(tensor.cpu().numpy(), image, err_msg=name, strict=True)
        devices = sensor.device, sensor.engine.device
        before = sum(device.copied_bytes for device in devices)
        with_depth(sensor)
        size = torch_on_a_gpu.as_tensor(sensor.get_cuda("depth"), device="cuda").nbytes
        assert sum(device.copied_bytes for device in devices) - before < size // 2  # records of scene and cameras


@pytest.fixture(params=[kuafu, simsense], ids=lambda module: module.__name__)
def module(request: pytest.FixtureRequest) -> ModuleType:
    return request.param


@pytest.fixture
def own_device(module: ModuleType) -> Any:
    return cpu_of(module)


def test_cuda_sees_the_exported_memory(module: ModuleType, own_device: Any, stub_cuda: Path) -> None:
    """Against a stub of CUDA's driver that maps the file behind the descriptor: one memory under two addresses."""
    buffer = exportable(module, own_device)
    stub = c.CDLL(str(stub_cuda))
    ours = buffer.image("float32", (6, 5)).array()
    stub.stub_be(own_device.info.device_uuid, c.c_uint64(place_in_file(ours.ctypes.data)))
    memory = CudaMemory(buffer, library=str(stub_cuda))
    interface = memory.array("float32", (6, 5)).__cuda_array_interface__
    assert interface["shape"] == (6, 5) and interface["typestr"] == "<f4" and interface["version"] == 3
    address = interface["data"][0]
    theirs = np.ctypeslib.as_array(c.cast(address, c.POINTER(c.c_float)), (6, 5))
    assert theirs.ctypes.data != ours.ctypes.data
    ours[2, 3] = 7
    assert theirs[2, 3] == 7
    theirs[2, 4] = 8
    assert ours[2, 4] == 8
    with pytest.raises(ValueError, match="needs 124 bytes"):
        memory.array("float32", (31,))
    memory.close()
    assert stub.stub_held() == 0


def test_cuda_memory_without_cuda_or_on_another_gpu_says_so(
    module: ModuleType, own_device: Any, stub_cuda: Path
) -> None:
    buffer = exportable(module, own_device)
    with pytest.raises(CudaError, match="no CUDA driver"):
        CudaMemory(buffer, library="/nowhere/libcuda.so.1")
    stub = c.CDLL(str(stub_cuda))
    stub.stub_be(b"0123456789abcdef", c.c_uint64(0))
    with pytest.raises(CudaError, match="none of the 2 CUDA devices"):
        CudaMemory(buffer, library=str(stub_cuda))
    assert stub.stub_held() == 0


def test_a_batchs_results_are_cudas_too(device: kuafu.Device, monkeypatch: pytest.MonkeyPatch, stub_cuda: Path) -> None:
    """The arrays have the bits of the host's, and the next picture's are in the same memory."""
    stub_for(device, stub_cuda, monkeypatch)
    scene, _ = world(device)
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.1)
    config.samples_per_pixel, config.max_bounces = 1, 0
    batch = StereoDepthSensorBatch(config, Mounts(scene, np.tile(np.eye(4), (2, 1, 1))), on_cuda=True)
    with pytest.raises(RuntimeError, match="no picture yet"):
        batch.get_cuda("rgba8")
    addresses = []
    for _ in range(2):
        batch.take_picture()
        with pytest.raises(RuntimeError, match="no depth of this picture yet"):
            batch.get_cuda("depth")
        batch.compute_depth()
        for name in ("depth", "disparity", "rgba8", "true_depth", "instance_ids", "ir_left"):
            host = batch.get_ir_measured()[0] if name == "ir_left" else getattr(batch, f"get_{name}")()
            there = batch.get_cuda(name)
            np.testing.assert_array_equal(seen_by_host(there), host, err_msg=name, strict=True)
            addresses.append(there.__cuda_array_interface__["data"][0])
    assert addresses[:6] == addresses[6:] and batch.get_depth().any()
    with pytest.raises(ValueError, match="a sensor has no 'rgb' for CUDA .*depth, .*confidence, .*rgba8"):
        batch.get_cuda("rgb")
    with pytest.raises(RuntimeError, match="on_cuda=True"):
        StereoDepthSensorBatch(config, Mounts(scene, np.eye(4)[None])).get_cuda("depth")


def test_torch_gives_the_depth_engine_its_pair_without_a_copy(torch_on_a_gpu: Any) -> None:
    torch = torch_on_a_gpu
    device = simsense.Device("auto")
    height, width, disparity = 96, 160, 7
    texture = np.random.default_rng(1).integers(0, 255, (height, width + disparity), dtype=np.uint8)
    pair = np.stack([texture[:, :width], texture[:, disparity:]])
    engine = depth_engine((width, height), 200.0, device, max_disparity=32)
    buffer = simsense.Buffer(device, pair.nbytes, exportable=True, host_visible=False)
    tensor = torch.as_tensor(CudaMemory(buffer).array("uint8", pair.shape), device="cuda")
    tensor.copy_(torch.from_numpy(pair))
    torch.cuda.synchronize()
    before = device.copied_bytes
    pair = [buffer.image("uint8", (height, width), side * height * width) for side in (0, 1)]
    out = simsense.Buffer(device, 4 * height * width, exportable=True, host_visible=False)
    found = torch.as_tensor(CudaMemory(out).array("float32", (height, width)), device="cuda")
    engine.compute(*pair, outputs={"disparity": out.image("float32", (height, width))})
    assert device.copied_bytes - before < pair.nbytes // 16
    valid = found[:, 32:] > 0
    assert float(valid.float().mean()) > 0.95
    assert float((found[:, 32:][valid] - disparity).abs().median()) < 0.1
