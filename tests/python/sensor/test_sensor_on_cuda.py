# SPDX-License-Identifier: Apache-2.0
"""A sensor whose results lie in CUDA's memory has the bits of one without, by get_cuda() and for the host."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kuafu
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.sensor.cuda_memory import CudaError, CudaMemory
from activestereo.effects import builtin
from activestereo.model import Quantity, SensorModel
from cuda_stub import seen_by_host, stub_for

NAMES = ("depth", "disparity", "ir_left", "confidence", "rgba8", "true_depth", "instance_ids", "material_ids")


@pytest.fixture
def device() -> kuafu.Device:
    """The stub of CUDA maps memory that has an address of the host."""
    try:
        return kuafu.Device("cpu")
    except kuafu.NoDeviceError as error:
        pytest.skip(str(error))


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
        pose = np.eye(4)
        pose[0, 3] = away_m
        scene.set_instance_pose(wall, pose)

    return scene, set_wall


def host_results(sensor: StereoDepthSensor) -> dict[str, np.ndarray]:
    found = {name: getattr(sensor, f"get_{name}")() for name in NAMES if name not in ("ir_left", "confidence")}
    found |= {"ir_left": sensor.get_ir_measured()[0], "confidence": sensor.get_depth_map("confidence")}
    return {name: image.copy() for name, image in found.items()}


def pictures(sensor: StereoDepthSensor, set_wall: Any) -> Iterator[dict[str, np.ndarray]]:
    """The results of two pictures, and of the second under another matcher."""
    for step in range(2):
        set_wall(0.1 * step)
        sensor.take_picture()
        sensor.compute_depth()
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
    lights = scene.summary.light_count
    with monkeypatch.context() as patch:
        patch.setitem(CudaMemory.__init__.__kwdefaults__, "library", "/nowhere/libcuda.so.1")
        with pytest.raises(CudaError, match="there is no CUDA driver"):
            StereoDepthSensor(config, scene, on_cuda=True)
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
                each.take_picture()
                each.compute_depth()
            expected = host_results(plain)
            for name, image in host_results(sensor).items():
                np.testing.assert_array_equal(image, expected[name], err_msg=name, strict=True)
                if image.dtype != np.uint32:  # which older PyTorch does not have
                    tensor = torch_on_a_gpu.as_tensor(sensor.get_cuda(name), device="cuda")
                    np.testing.assert_array_equal(tensor.cpu().numpy(), image, err_msg=name, strict=True)
        devices = sensor.device, sensor.engine.device
        before = sum(device.copied_bytes for device in devices)
        sensor.take_picture()
        sensor.compute_depth()
        size = torch_on_a_gpu.as_tensor(sensor.get_cuda("depth"), device="cuda").nbytes
        assert sum(device.copied_bytes for device in devices) - before < size // 2  # records of scene and cameras
