# SPDX-License-Identifier: Apache-2.0
"""SAPIEN 3's StereoDepthSensor, method by method; the table in examples/sapien/README.md says what is the same."""

from __future__ import annotations

from copy import deepcopy
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import sapien
from numpy.typing import NDArray
from PIL import Image

import activestereo
from activestereo.camera.presets import SAPIEN_NAMES
from activestereo.camera.presets import StereoDepthSensorConfig as NativeConfig
from activestereo.common.input_files import checked_file
from activestereo.common.pose import Pose, as_matrix
from activestereo.integrations.sapien.cuda_results import CudaResults
from activestereo.integrations.sapien.device_array import DeviceArray
from activestereo.integrations.sapien.scene import SapienScene
from activestereo.sensor.cuda_tensor import copied_to_cuda

# SAPIEN's Color pictures are coded with this exponent.
_GAMMA = 2.2


class StereoDepthSensorConfig(NativeConfig):
    """SAPIEN's configuration, with its two models and values, and with all other fields of ours. activestereo's own
    StereoDepthSensorConfig("D435") errs as the device does, and may be given to the sensor, too."""

    SUPPORTED_MODELS = ("D415", "D435")

    def __init__(self, model: str = "D435") -> None:
        if model not in self.SUPPORTED_MODELS:
            raise ValueError(f"Invalid sensor model '{model}', must be one of: {self.SUPPORTED_MODELS}")
        super().__init__(f"sapien-{model}")


class StereoDepthSensor:
    """One RGB camera, two infrared cameras and a projector on an entity of a SAPIEN scene.

    config: SAPIEN's StereoDepthSensorConfig or ours, which has more fields. mount_entity: a sapien.Entity, in a scene
    before the first picture. pose: sapien.Pose relative to it. Intrinsics are in SAPIEN's convention: the middle of the
    first pixel is at (0.5, 0.5). The scene is mirrored at the first picture and followed from then on.

    pipelined: a picture is rendered while SAPIEN simulates and the one before is matched. Results are of the picture
    before; from the second take_picture() on has_picture is True.

    on_cuda: get_..._cuda() give what lies on the GPU or is computed there, with the host's bits; without, they copy the
    host's arrays. The first picture then raises CudaError where there is no CUDA, or none on the GPU that renders.
    """

    def __init__(
        self,
        config: Any,
        mount_entity: sapien.Entity,
        pose: sapien.Pose | None = None,
        *,
        pipelined: bool = False,
        on_cuda: bool = False,
    ) -> None:
        self._is_pipelined, self._on_cuda = pipelined, on_cuda
        self._cuda: CudaResults | None = None
        self._config = config
        self._mount = mount_entity
        self._pose = sapien.Pose() if pose is None else pose
        self._world: SapienScene | None = None
        self._sensor: activestereo.StereoDepthSensor | None = None
        _check_config(config)

    # ---- taking pictures ----

    def take_picture(self, infrared_only: bool = False) -> None:
        """RuntimeError where the mount is in no scene. SAPIEN's scene.update_render() is not needed."""
        scene = self._mount.get_scene()
        if scene is None:
            raise RuntimeError("Cannot take picture: sensor is not added to scene")
        if self._world is None or self._world.sapien_scene is not scene:
            self._world, self._sensor = SapienScene.of(scene), None
        self._world.update()
        if self._sensor is None:  # after update(), which waits: its projector changes the scene
            mount = activestereo.Mount(self._world.scene)
            config = native_config(self._config)
            self._sensor = activestereo.StereoDepthSensor(
                config, mount, on_cuda=self._on_cuda, pipelined=self._is_pipelined
            )
            if self._is_pipelined:
                self._world.pipelined.add(self._sensor)
            self._cuda = CudaResults(self._sensor) if self._on_cuda else None
        sensor = self._made()
        sensor.set_local_pose(as_matrix(self.get_pose()))
        sensor.take_picture(infrared_only)

    @property
    def has_picture(self) -> bool:
        """Whether results are there: of a pipelined sensor from the second take_picture() on, else from the first."""
        return self._sensor is not None and self._sensor.has_picture

    def compute_depth(
        self, bbox_start: tuple[int, int] | None = None, bbox_size: tuple[int, int] | None = None
    ) -> None:
        """bbox_start, bbox_size: (x, y) and (width, height) in pixels of the left infrared image, rectified; what lies
        outside has no depth. RuntimeError before the first picture."""
        sensor = self._made()
        x = y = width = height = 0  # all of it
        if bbox_start is not None and bbox_size is not None:
            (x, y), (width, height) = bbox_start, bbox_size
        sensor.engine.set_parameters(roi_x=x, roi_y=y, roi_width=width, roi_height=height)
        sensor.compute_depth()

    # ---- results ----

    def get_rgb(self) -> NDArray[np.float32]:
        """float32 [height, width, 3] in 0..1."""
        return self._made().get_rgb().copy()

    def get_rgba_cuda(self) -> DeviceArray:
        """float32 [height, width, 4] on a CUDA device, through torch."""
        if self._cuda is not None:
            return DeviceArray(self._cuda.rgba())
        rgb = self.get_rgb()
        return DeviceArray(copied_to_cuda(np.concatenate([rgb, np.ones_like(rgb[..., :1])], axis=2)))

    def get_ir(self) -> list[NDArray[np.float32]]:
        """[left, right] float32 [height, width] in 0..1, gamma-coded; noise is not in it."""
        return [np.power(image, np.float32(1.0 / _GAMMA)) for image in self._made().get_ir()]

    def get_depth(self) -> NDArray[np.float32]:
        """float32 [height, width] metres in the RGB camera, 0 = no measurement."""
        return self._made().get_depth().copy()

    def get_depth_cuda(self) -> DeviceArray:
        """get_depth() on a CUDA device, through torch. Of a sensor made with on_cuda the next compute_depth() writes
        into the same memory."""
        return DeviceArray(copied_to_cuda(self.get_depth()) if self._cuda is None else self._cuda.depth())

    def get_pointcloud(self, with_rgb: bool = False) -> NDArray[np.float32]:
        """float32 [n, 3] or [n, 6]: x right, y down, z forward in the RGB camera, metres; colours 0..1."""
        return self._made().get_pointcloud(with_rgb)

    def get_pointcloud_cuda(self, with_rgb: bool = False) -> DeviceArray:
        """get_pointcloud() on a CUDA device, through torch."""
        if self._cuda is not None:
            return DeviceArray(self._cuda.pointcloud(with_rgb))
        return DeviceArray(copied_to_cuda(self.get_pointcloud(with_rgb)))

    # ---- the sensor itself ----

    def get_config(self) -> Any:
        """A copy, of the class that was given."""
        return deepcopy(self._config)

    def get_pose(self) -> sapien.Pose:
        """The RGB camera's, in the scene."""
        return self._mount.get_pose() * self._pose

    def set_local_pose(self, pose: sapien.Pose) -> None:
        self._pose = pose

    def native(self) -> activestereo.StereoDepthSensor:
        """The sensor behind it, which has more: true depth, ids, the noisy infrared pair. RuntimeError before the first
        picture."""
        return self._made()

    # ---- parameters: TypeError for what SAPIEN refuses ----

    def set_ir_noise(self, ir_speckle_noise: float, ir_thermal_noise: float) -> None:
        self._set(ir_speckle_noise=ir_speckle_noise, ir_thermal_noise=ir_thermal_noise)

    def set_census_window_size(self, census_width: int, census_height: int) -> None:
        self._set(census_width=census_width, census_height=census_height)

    def set_matching_block_size(self, block_width: int, block_height: int) -> None:
        self._set(block_width=block_width, block_height=block_height)

    def set_penalties(self, p1_penalty: int, p2_penalty: int) -> None:
        self._set(p1_penalty=p1_penalty, p2_penalty=p2_penalty)

    def set_uniqueness_ratio(self, uniqueness_ratio: int) -> None:
        self._set(uniqueness_ratio=uniqueness_ratio)

    def set_lr_max_diff(self, lr_max_diff: int) -> None:
        self._set(lr_max_diff=lr_max_diff)

    # ---- inside ----

    def _set(self, **changes: Any) -> None:
        changed = deepcopy(self._config)
        for name, value in changes.items():
            setattr(changed, name, value)
        _check_config(changed)
        if self._sensor is not None:
            setter = next(name for name, fields in _SETTERS.items() if set(changes) == fields)
            getattr(self._sensor, setter)(*(_own_value(name, value) for name, value in changes.items()))
        for name, value in changes.items():
            setattr(self._config, name, value)

    def _made(self) -> activestereo.StereoDepthSensor:
        if self._sensor is None:
            raise RuntimeError("no picture yet: call take_picture() first")
        return self._sensor


_SETTERS = {
    "set_ir_noise": {"ir_speckle_noise", "ir_thermal_noise"},
    "set_census_window_size": {"census_width", "census_height"},
    "set_matching_block_size": {"block_width", "block_height"},
    "set_penalties": {"p1_penalty", "p2_penalty"},
    "set_uniqueness_ratio": {"uniqueness_ratio"},
    "set_lr_max_diff": {"lr_max_diff"},
}


def native_config(config: Any) -> NativeConfig:
    """The configuration of our sensor: pixel centres at integers, our Pose."""
    out = NativeConfig("sapien-D435")
    for name in NativeConfig._FIELDS:
        given = name if hasattr(config, name) else SAPIEN_NAMES.get(name, name)
        if hasattr(config, given):
            value = getattr(config, given)
            is_pose = hasattr(value, "to_transformation_matrix")
            setattr(out, name, Pose(as_matrix(value)) if is_pose else deepcopy(_own_value(name, value)))
    for name in ("rgb_intrinsic", "ir_intrinsic", "ir_intrinsic_right"):
        if getattr(out, name) is not None:
            k = np.array(getattr(out, name), np.float64)
            k[:2, 2] -= 0.5
            setattr(out, name, k)
    if isinstance(out.light_pattern, (str, PathLike)) and out.light_pattern != "generated":
        setattr(out, "light_pattern", _red_of(out.light_pattern))  # noqa: B010 (the field takes either)
    return out


def _own_value(name: str, value: Any) -> Any:
    """SAPIEN's ways to switch a check off are a difference of 255 pixels and a ratio of 100 % and more."""
    if name == "lr_max_diff":
        return -1 if value == 255 else value
    return min(value, 100) if name == "uniqueness_ratio" else value


def _red_of(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """SAPIEN's patterns are colour images, of which its red projector throws the red."""
    with Image.open(checked_file(Path(path))) as image:
        return np.ascontiguousarray(np.asarray(image.convert("RGB"))[..., 0])


def _check_config(c: Any) -> None:
    """TypeError where SAPIEN's SimSenseComponent raises it."""
    noise = ("ir_speckle_noise", "ir_thermal_noise")
    census, block = ("census_width", "census_height"), ("block_width", "block_height")
    is_quiet = c.ir_speckle_noise == 0
    is_rising = _is_int(c.p1_penalty, 1) and _is_int(c.p2_penalty, 1, 223) and c.p1_penalty < c.p2_penalty
    rules = [
        (("ir_resolution",), all(_is_int(v, 32) for v in c.ir_resolution), "two whole numbers of at least 32"),
        (noise, is_quiet or (c.ir_speckle_noise > 0 and c.ir_thermal_noise > 0), "both above 0, or the first one 0"),
        (census, _is_window(c.census_width, c.census_height, 65), "odd, above 0, their product at most 65"),
        (("max_disp",), _is_int(c.max_disp, 32, 1024), "a whole number from 32 to 1024"),
        (block, _is_window(c.block_width, c.block_height, 256), "odd, above 0, their product at most 256"),
        (("p1_penalty", "p2_penalty"), is_rising, "whole numbers, rising, from 1 to 223"),
        (("uniqueness_ratio",), _is_int(c.uniqueness_ratio, 0, 255), "a whole number from 0 to 255"),
        (("lr_max_diff",), _is_int(c.lr_max_diff, -1, 255), "a whole number from 0 to 255, which switches it off"),
        (("median_filter_size",), c.median_filter_size in (1, 3, 5, 7), "1, 3, 5 or 7"),
    ]
    for names, holds, text in rules:
        if not holds:
            given = ", ".join(str(getattr(c, name)) for name in names)
            raise TypeError(f"{' and '.join(names)} must be {text}; given {given}")


def _is_int(value: Any, low: int, high: int = 2**31) -> bool:
    return isinstance(value, int) and low <= value <= high


def _is_window(width: Any, height: Any, most: int) -> bool:
    return all(_is_int(v, 1) and v % 2 == 1 for v in (width, height)) and width * height <= most
