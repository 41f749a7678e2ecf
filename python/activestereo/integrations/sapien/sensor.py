# SPDX-License-Identifier: Apache-2.0
"""Replaces SAPIEN 3's StereoDepthSensor and its configuration, method by method, and refuses the same values as SAPIEN.
The table in examples/sapien/README.md lists the common parts."""

from __future__ import annotations

from copy import deepcopy
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import sapien
from numpy.typing import NDArray
from PIL import Image

import activestereo
from activestereo.camera.auto_exposure import DARKEST, SRGB, STRIDE, exposure_of_median
from activestereo.camera.presets import SAPIEN_NAMES
from activestereo.camera.presets import StereoDepthSensorConfig as NativeConfig
from activestereo.common.input_files import checked_file
from activestereo.common.pose import Pose, as_matrix
from activestereo.integrations.sapien.scene import SapienScene, own_matrix
from activestereo.sensor.cuda_memory import copied_to_cuda, cuda_tensor, wait_for

if TYPE_CHECKING:
    import torch


_NATIVE_NAMES = {given: own for own, given in SAPIEN_NAMES.items()}


class StereoDepthSensorConfig(NativeConfig):
    """SAPIEN's configuration for its two models, with SAPIEN's default values and all other fields of ours. The sensor
    also takes activestereo's own StereoDepthSensorConfig("D435"), which has the real device's errors."""

    SUPPORTED_MODELS = ("D415", "D435")

    def __init__(self, model: str = "D435") -> None:
        name = model.removeprefix("sapien-")  # the presets' names
        if name not in self.SUPPORTED_MODELS:
            raise ValueError(f"Invalid sensor model '{model}', must be one of: {self.SUPPORTED_MODELS}")
        super().__init__(f"sapien-{name}")


def native_config(config: Any) -> NativeConfig:
    """Converts a configuration in SAPIEN's conventions to ours: pixel centres at integers, our Pose."""
    out = NativeConfig("sapien-D435")
    for name in NativeConfig._FIELDS:
        given = name if hasattr(config, name) else SAPIEN_NAMES.get(name, name)
        if hasattr(config, given):
            value = getattr(config, given)
            is_pose = hasattr(value, "to_transformation_matrix")
            setattr(out, name, Pose(as_matrix(value)) if is_pose else deepcopy(own_value(name, value)))
    for name in ("rgb_intrinsic", "ir_intrinsic", "ir_intrinsic_right"):
        if getattr(out, name) is not None:
            setattr(out, name, own_matrix(getattr(out, name)))
    if isinstance(out.light_pattern, (str, PathLike)) and out.light_pattern != "generated":
        with Image.open(checked_file(Path(out.light_pattern))) as image:  # SAPIEN's projector is red
            out.light_pattern = np.ascontiguousarray(np.asarray(image.convert("RGB"))[..., 0])
    return out


def own_value(name: str, value: Any) -> Any:
    """Converts the value of field `name` from SAPIEN's convention to ours. SAPIEN switches the left-right check off by
    255 pixels, we by -1. Its uniqueness ratio may exceed 100 %, ours not."""
    if name == "lr_max_diff":
        return -1 if value == 255 else value
    return min(value, 100) if name == "uniqueness_ratio" else value


def check_config(c: Any) -> None:
    """Raises TypeError for each value that SAPIEN's SimSenseComponent refuses. c: a configuration with SAPIEN's field
    names."""
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


class CudaResults:
    """Gives the results of a sensor's last picture on a CUDA device, with the same bits as the host's methods. on_cuda:
    they lie in memory that the sensor shares with CUDA; otherwise they are copies of the host's results."""

    def __init__(self, sensor: activestereo.StereoDepthSensor, on_cuda: bool) -> None:
        self._sensor, self._on_cuda = sensor, on_cuda
        self._rgb_exposure = sensor.get_config().rgb_exposure
        self._rays: torch.Tensor | None = None

    def depth(self) -> torch.Tensor:
        """Returns depth [height, width], metres; with on_cuda in the depth engine's memory, which the next
        compute_depth() overwrites."""
        sensor = self._sensor
        return cuda_tensor(sensor.get_cuda("depth")) if self._on_cuda else copied_to_cuda(sensor.get_depth())

    def rgba(self) -> torch.Tensor:
        """Returns the colours 0..1 with an alpha of 1, float32 [height, width, 4]."""
        import torch

        rgb = self._rgb()
        return wait_for(torch.cat([rgb, torch.ones_like(rgb[..., :1])], dim=2))

    def pointcloud(self, with_rgb: bool) -> torch.Tensor:
        """Returns the measured points, metres in the RGB camera, [n, 3]; with_rgb: [n, 6], with colours."""
        import torch

        if not self._on_cuda:
            return copied_to_cuda(self._sensor.get_pointcloud(with_rgb))
        depth = self.depth()
        if self._rays is None:
            self._rays = torch.from_numpy(self._sensor.rgb_rays()).to(depth.device)
        v, u = torch.nonzero(depth, as_tuple=True)
        points = (self._rays[:, v, u] * depth[v, u]).T.to(depth.dtype)
        return wait_for(torch.cat([points, self._rgb()[v, u]], dim=1) if with_rgb else points.contiguous())

    def _rgb(self) -> torch.Tensor:
        """Encodes the RGB picture on CUDA, as auto_exposure.encoded_rgb() does on the host; only the exposure factor
        passes through the host."""
        if not self._on_cuda:
            return copied_to_cuda(self._sensor.get_rgb())
        light = cuda_tensor(self._sensor.get_cuda("radiance"))
        exposure = self._rgb_exposure
        if not exposure:  # as auto_exposure.rgb_exposure()
            green = light[::STRIDE, ::STRIDE, 1]
            lit = green[(green >= float(DARKEST)) & (green < np.inf)]
            exposure = exposure_of_median(np.float32(lit.median().item())) if lit.numel() else 1.0
        # float64, because not every torch rounds the square root of float32 correctly.
        root = (light * float(np.float32(exposure))).clamp(0.0, 1.0).double().sqrt().float()
        place = (root * (len(SRGB) - 1) + 0.5).int().clamp(0, len(SRGB) - 1)
        return light.new_tensor(SRGB)[place]


class DeviceArray:
    """Wraps a float32 torch tensor with the members of sapien.CudaArray. strides: in bytes."""

    def __init__(self, tensor: torch.Tensor) -> None:
        self._tensor, self.typestr = tensor, "<f4"
        self.shape: list[int] = list(tensor.shape)
        self.strides: list[int] = [n * tensor.element_size() for n in tensor.stride()]
        self.ptr: int = tensor.data_ptr()
        self.cuda_id: int | None = tensor.device.index

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return dict(self._tensor.__cuda_array_interface__)

    def torch(self) -> torch.Tensor:
        """Returns the torch tensor itself."""
        return self._tensor

    def dlpack(self) -> Any:
        return self._tensor.__dlpack__()

    def cupy(self) -> Any:
        import cupy

        return cupy.asarray(self)

    def jax(self) -> Any:
        import jax

        return jax.dlpack.from_dlpack(self._tensor)


# SAPIEN's Color pictures are coded with this exponent.
_GAMMA = 2.2


class StereoDepthSensor:
    """Simulates an RGB camera, two infrared cameras and a projector on an entity of a SAPIEN scene.

    config: SAPIEN's StereoDepthSensorConfig, or ours with more fields. mount_entity: a sapien.Entity, in a scene before
    the first picture. pose: sapien.Pose relative to it; None: identity. Intrinsics are in SAPIEN's convention: the
    middle of the first pixel is at (0.5, 0.5). The scene is mirrored at the first picture and followed from then on.

    on_cuda: get_..._cuda() return arrays on the GPU, with the host's bits; without it they copy the host's arrays. With
    it the first picture raises CudaError without CUDA on the rendering GPU.
    """

    def __init__(
        self, config: Any, mount_entity: sapien.Entity, pose: sapien.Pose | None = None, *,
        on_cuda: bool = False,
    ) -> None:  # fmt: skip
        check_config(config)
        self._config, self._mount, self._pose = config, mount_entity, sapien.Pose() if pose is None else pose
        self._on_cuda = on_cuda
        self._world: SapienScene | None = None
        self._sensor: activestereo.StereoDepthSensor | None = None
        self._cuda: CudaResults | None = None

    def take_picture(self, infrared_only: bool = False) -> None:
        """Brings the mirrored scene up to date and takes a picture. Raises RuntimeError if the mount is in no scene.
        SAPIEN's scene.update_render() is not needed."""
        scene = self._mount.get_scene()
        if scene is None:
            raise RuntimeError("Cannot take picture: sensor is not added to scene")
        if self._world is None or self._world.sapien_scene is not scene:
            self._world, self._sensor, self._cuda = SapienScene.for_scene(scene), None, None
        self._world.update()
        if self._sensor is None:
            config, place = native_config(self._config), self._world.scene
            self._sensor = activestereo.StereoDepthSensor(config, place, on_cuda=self._on_cuda)
        self._sensor.set_local_pose(as_matrix(self.get_pose()))
        self._sensor.take_picture(infrared_only)

    def compute_depth(
        self, bbox_start: tuple[int, int] | None = None, bbox_size: tuple[int, int] | None = None
    ) -> None:
        """Computes the last picture's depth. bbox_start, bbox_size: (x, y) and (width, height) in pixels of the
        rectified left infrared image, outside of which there is no depth; None: all. Raises RuntimeError before the
        first picture."""
        x = y = width = height = 0  # the whole image
        if (bbox_start is None) != (bbox_size is None):
            raise ValueError("bbox_start and bbox_size come together, or not at all: the whole image")
        if bbox_start is not None and bbox_size is not None:
            (x, y), (width, height) = bbox_start, bbox_size
        self.native().engine.set_parameters(roi_x=x, roi_y=y, roi_width=width, roi_height=height)
        self.native().compute_depth()

    def get_rgb(self) -> NDArray[np.float32]:
        """Returns the RGB picture, float32 [height, width, 3] in 0..1."""
        return self.native().get_rgb().copy()

    def get_rgba_cuda(self) -> DeviceArray:
        """Returns the RGB picture with an alpha of 1, float32 [height, width, 4], on a CUDA device, through torch."""
        return DeviceArray(self._cuda_results().rgba())

    def get_ir(self) -> list[NDArray[np.float32]]:
        """Returns [left, right] infrared images without noise, float32 [height, width] in 0..1, gamma-coded."""
        return [np.power(image, np.float32(1.0 / _GAMMA)) for image in self.native().get_ir()]

    def get_depth(self) -> NDArray[np.float32]:
        """Returns float32 [height, width] metres in the RGB camera, 0 = no measurement."""
        return self.native().get_depth().copy()

    def get_depth_cuda(self) -> DeviceArray:
        """Returns get_depth() on a CUDA device, through torch. With on_cuda the next compute_depth() overwrites it."""
        return DeviceArray(self._cuda_results().depth())

    def get_pointcloud(self, with_rgb: bool = False) -> NDArray[np.float32]:
        """Returns the measured points, float32 [n, 3], metres in the RGB camera (x right, y down, z forward); with_rgb:
        [n, 6], with colours 0..1."""
        return self.native().get_pointcloud(with_rgb)

    def get_pointcloud_cuda(self, with_rgb: bool = False) -> DeviceArray:
        """Returns get_pointcloud() on a CUDA device, through torch."""
        return DeviceArray(self._cuda_results().pointcloud(with_rgb))

    def get_config(self) -> Any:
        """Returns a copy of the configuration, of the class that was given."""
        return deepcopy(self._config)

    def get_pose(self) -> sapien.Pose:
        """Returns the RGB camera's pose in the scene."""
        return self._mount.get_pose() * self._pose

    def set_local_pose(self, pose: sapien.Pose) -> None:
        self._pose = pose

    def set_ir_noise(self, ir_speckle_noise: float, ir_thermal_noise: float) -> None:
        """Sets factors on the default noise; ir_speckle_noise 0 switches both kinds off."""
        self.change(ir_speckle_noise=ir_speckle_noise, ir_thermal_noise=ir_thermal_noise)

    def set_census_window_size(self, census_width: int, census_height: int) -> None:
        """Sets the census window's sides, odd numbers of pixels."""
        self.change(census_width=census_width, census_height=census_height)

    def set_matching_block_size(self, block_width: int, block_height: int) -> None:
        """Sets the sides of the block that matching costs are summed over, odd numbers of pixels."""
        self.change(block_width=block_width, block_height=block_height)

    def set_penalties(self, p1_penalty: int, p2_penalty: int) -> None:
        """Sets the costs of a disparity step between neighbours: p1_penalty of one pixel, p2_penalty of more."""
        self.change(p1_penalty=p1_penalty, p2_penalty=p2_penalty)

    def set_uniqueness_ratio(self, uniqueness_ratio: int) -> None:
        """Sets by how many percent the best disparity must beat the others."""
        self.change(uniqueness_ratio=uniqueness_ratio)

    def set_lr_max_diff(self, lr_max_diff: int) -> None:
        """Sets the largest difference of the left and right disparities, in pixels; 255 switches the check off."""
        self.change(lr_max_diff=lr_max_diff)

    def change(self, **changes: Any) -> None:
        """Changes fields, by SAPIEN's names, of the configuration and of the sensor. Raises TypeError for values that
        SAPIEN refuses."""
        changed = deepcopy(self._config)
        for name, value in changes.items():
            setattr(changed, name, value)
        check_config(changed)
        if self._sensor is not None:
            native = {_NATIVE_NAMES.get(name, name): own_value(name, value) for name, value in changes.items()}
            self._sensor.change(**native)
        for name, value in changes.items():
            setattr(self._config, name, value)

    def native(self) -> activestereo.StereoDepthSensor:
        """Returns activestereo's sensor behind this one, for further results: true depth, ids, the noisy infrared pair.
        Raises RuntimeError before the first picture."""
        if self._sensor is None:
            raise RuntimeError("no picture yet: call take_picture() first")
        return self._sensor

    def _cuda_results(self) -> CudaResults:
        self._cuda = self._cuda or CudaResults(self.native(), self._on_cuda)
        return self._cuda
