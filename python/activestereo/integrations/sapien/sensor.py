# SPDX-License-Identifier: Apache-2.0
"""Replaces SAPIEN 3's StereoDepthSensor, method by method. The table in examples/sapien/README.md lists the common
parts."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np
import sapien
from numpy.typing import NDArray

import activestereo
from activestereo.camera.auto_exposure import DARKEST, SRGB, STRIDE, exposure_of_median
from activestereo.common.pose import as_matrix
from activestereo.integrations.sapien.config import Parameters, check_config, native_config
from activestereo.integrations.sapien.scene import SapienScene
from activestereo.sensor.cuda_memory import copied_to_cuda, cuda_tensor, wait_for

if TYPE_CHECKING:
    import torch


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


class StereoDepthSensor(Parameters):
    """Simulates an RGB camera, two infrared cameras and a projector on an entity of a SAPIEN scene.

    config: SAPIEN's StereoDepthSensorConfig, or ours with more fields. mount_entity: a sapien.Entity, in a scene before
    the first picture. pose: sapien.Pose relative to it; None: identity. Intrinsics are in SAPIEN's convention: the
    middle of the first pixel is at (0.5, 0.5). The scene is mirrored at the first picture and followed from then on.

    pipelined: a picture is rendered while SAPIEN simulates and the previous one is matched. Results are those of the
    previous picture; from the second take_picture() on has_picture is True.

    on_cuda: get_..._cuda() return arrays on the GPU, with the host's bits; without it they copy the host's arrays. With
    it the first picture raises CudaError without CUDA on the rendering GPU.
    """

    def __init__(
        self, config: Any, mount_entity: sapien.Entity, pose: sapien.Pose | None = None, *,
        pipelined: bool = False, on_cuda: bool = False,
    ) -> None:  # fmt: skip
        check_config(config)
        self._config, self._mount, self._pose = config, mount_entity, sapien.Pose() if pose is None else pose
        self._is_pipelined, self._on_cuda = pipelined, on_cuda
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
        if self._sensor is None:  # after update(), which waits: its projector changes the scene
            config, place = native_config(self._config), self._world.scene
            self._sensor = activestereo.StereoDepthSensor(
                config, place, on_cuda=self._on_cuda, pipelined=self._is_pipelined
            )
            if self._is_pipelined:
                self._world.pipelined.add(self._sensor)
        self._sensor.set_local_pose(as_matrix(self.get_pose()))
        self._sensor.take_picture(infrared_only)

    @property
    def has_picture(self) -> bool:
        """Returns whether results exist: from the second take_picture() on for a pipelined sensor, else from the
        first."""
        return self._sensor is not None and self._sensor.has_picture

    def compute_depth(
        self, bbox_start: tuple[int, int] | None = None, bbox_size: tuple[int, int] | None = None
    ) -> None:
        """Computes the last picture's depth. bbox_start, bbox_size: (x, y) and (width, height) in pixels of the
        rectified left infrared image, outside of which there is no depth; None: all. Raises RuntimeError before the
        first picture."""
        x = y = width = height = 0  # the whole image
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

    def native(self) -> activestereo.StereoDepthSensor:
        """Returns activestereo's sensor behind this one, which gives more: true depth, ids, the noisy infrared pair.
        Raises RuntimeError before the first picture."""
        if self._sensor is None:
            raise RuntimeError("no picture yet: call take_picture() first")
        return self._sensor

    def _cuda_results(self) -> CudaResults:
        self._cuda = self._cuda or CudaResults(self.native(), self._on_cuda)
        return self._cuda
