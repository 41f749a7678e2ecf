# SPDX-License-Identifier: Apache-2.0
"""Results of SAPIEN's get_..._cuda(): computed on the GPU of a sensor that was made with on_cuda, else copied; and the
array that holds them, as sapien.CudaArray does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.camera.auto_exposure import DARKEST, SRGB, STRIDE, exposure_of_median
from activestereo.common.computed_once import computed_once
from activestereo.sensor.cuda_memory import copied_to_cuda, cuda_tensor, wait_for
from activestereo.sensor.sensor import StereoDepthSensor

if TYPE_CHECKING:
    import torch


class CudaResults:
    """The results of a sensor's last picture, with the bits of the host's methods."""

    def __init__(self, sensor: StereoDepthSensor) -> None:
        self._sensor = sensor
        self._rgb_exposure = sensor.get_config().rgb_exposure

    def depth(self) -> torch.Tensor:
        """Depth [height, width] in the depth engine's memory; the next compute overwrites it."""
        return cuda_tensor(self._sensor.get_cuda("depth"))

    def rgba(self) -> torch.Tensor:
        """[height, width, 4]."""
        import torch

        rgb = self._rgb()
        return wait_for(torch.cat([rgb, torch.ones_like(rgb[..., :1])], dim=2))

    def pointcloud(self, with_rgb: bool) -> torch.Tensor:
        """[n, 3] or [n, 6]."""
        import torch

        depth = self.depth()
        v, u = torch.nonzero(depth, as_tuple=True)
        points = (self._rays()[:, v, u] * depth[v, u]).T.to(depth.dtype)
        return wait_for(torch.cat([points, self._rgb()[v, u]], dim=1) if with_rgb else points.contiguous())

    # ---- inside ----

    def _rgb(self) -> torch.Tensor:
        """As auto_exposure.encoded_rgb(), on CUDA. Only the exposure factor passes through the host."""
        light = self._light()
        exposure = self._rgb_exposure
        if not exposure:  # as auto_exposure.rgb_exposure()
            green = light[::STRIDE, ::STRIDE, 1]
            lit = green[(green >= float(DARKEST)) & (green < np.inf)]
            exposure = exposure_of_median(np.float32(lit.median().item())) if lit.numel() else 1.0
        # By float64, for not every torch's root of float32 is the nearest one.
        root = (light * float(np.float32(exposure))).clamp(0.0, 1.0).double().sqrt().float()
        place = (root * (len(SRGB) - 1) + 0.5).int().clamp(0, len(SRGB) - 1)
        return self._curve()[place]

    def _light(self) -> torch.Tensor:
        return cuda_tensor(self._sensor.get_cuda("radiance"))

    @computed_once
    def _curve(self) -> torch.Tensor:
        return self._light().new_tensor(SRGB)

    @computed_once
    def _rays(self) -> torch.Tensor:
        import torch

        return torch.from_numpy(self._sensor.rgb_rays()).to(self.depth().device)


class CopiedResults:
    """Copies on torch's CUDA device, for a sensor with results in host memory."""

    def __init__(self, sensor: StereoDepthSensor) -> None:
        self._sensor = sensor

    def depth(self) -> torch.Tensor:
        return copied_to_cuda(self._sensor.get_depth())

    def rgba(self) -> torch.Tensor:
        rgb = self._sensor.get_rgb()
        return copied_to_cuda(np.concatenate([rgb, np.ones_like(rgb[..., :1])], axis=2))

    def pointcloud(self, with_rgb: bool) -> torch.Tensor:
        return copied_to_cuda(self._sensor.get_pointcloud(with_rgb))


class DeviceArray:
    """A torch tensor with the members of sapien.CudaArray."""

    def __init__(self, tensor: torch.Tensor) -> None:
        self._tensor = tensor

    @property
    def shape(self) -> list[int]:
        return list(self._tensor.shape)

    @property
    def strides(self) -> list[int]:
        """In bytes."""
        return [n * self._tensor.element_size() for n in self._tensor.stride()]

    @property
    def typestr(self) -> str:
        return str(self.__cuda_array_interface__["typestr"])

    @property
    def cuda_id(self) -> int:
        return int(self._tensor.device.index)

    @property
    def ptr(self) -> int:
        return int(self._tensor.data_ptr())

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return dict(self._tensor.__cuda_array_interface__)

    def torch(self) -> torch.Tensor:
        """The torch tensor itself."""
        return self._tensor

    def dlpack(self) -> Any:
        return self._tensor.__dlpack__()

    def cupy(self) -> Any:
        import cupy

        return cupy.asarray(self)

    def jax(self) -> Any:
        import jax

        return jax.dlpack.from_dlpack(self._tensor)
