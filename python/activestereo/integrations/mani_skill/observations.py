# SPDX-License-Identifier: Apache-2.0
"""Sensors' results as ManiSkill's observations: its shapes, types and units."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from activestereo.common.computed_once import computed_once
from activestereo.sensor.batch import StereoDepthSensorBatch
from activestereo.sensor.cuda_tensor import cuda_tensor

_MM = 1000.0
_FARTHEST_MM = 32767.0


class Observations:
    """Observations of a batch's last picture and depth, made on the GPU that renders (on_cuda) or on the host."""

    def __init__(self, sensors: StereoDepthSensorBatch, on_cuda: bool) -> None:
        self.sensors, self._on_cuda = sensors, on_cuda

    def rgb(self) -> torch.Tensor:
        """uint8 [E, height, width, 3]."""
        return self._taken("rgba8")[..., :3].contiguous()

    def depth_mm(self) -> torch.Tensor:
        """Whole millimetres [E, height, width], as float32."""
        return (self._taken("depth") * _MM).clamp(max=_FARTHEST_MM).round()

    def positions(self, depth_mm: torch.Tensor) -> torch.Tensor:
        """int16 [E, height, width, 3] millimetres in the camera's OpenGL axes: x right, y up, z backward."""
        points = self._rays() * depth_mm[..., None]
        return points.clamp(-_FARTHEST_MM, _FARTHEST_MM).round().to(torch.int16)

    def segmentation(self, semantic_ids: NDArray[np.integer]) -> torch.Tensor:
        """int16 [E, height, width, 1]: ManiSkill's per_scene_id, 0 = nothing there. semantic_ids: of each instance."""
        ids = torch.from_numpy(semantic_ids.astype(np.int16))
        instances = self._taken("instance_ids").view(torch.int32)  # values above 2^31 are negative
        known = torch.where(instances < 0, len(ids) - 1, instances.clamp(max=len(ids) - 1))
        return ids.to(instances.device)[known][..., None]

    def _taken(self, name: str) -> torch.Tensor:
        """Reads the sensors' get_<name>() on the device of the observations."""
        if self._on_cuda:
            return cuda_tensor(self.sensors.get_cuda(name))
        return torch.from_numpy(getattr(self.sensors, f"get_{name}")())

    @computed_once
    def _rays(self) -> torch.Tensor:
        """Ray directions, float32 [height, width, 3], in the same axes, with z = -1."""
        config = self.sensors.get_config()
        k, (width, height) = config.rgb_intrinsic, config.rgb_resolution
        v, u = np.indices((height, width))
        rays = np.stack([(u - k[0, 2]) / k[0, 0], -(v - k[1, 2]) / k[1, 1], -np.ones(u.shape)], axis=-1)
        return torch.from_numpy(rays.astype(np.float32)).to(self._taken("depth").device)
