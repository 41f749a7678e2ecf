# SPDX-License-Identifier: Apache-2.0
"""A ManiSkill camera's configuration with a stereo sensor's further settings."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
from mani_skill.sensors.camera import CameraConfig
from mani_skill.sensors.depth_camera import StereoDepthCameraConfig as ManiSkillConfig
from numpy.typing import NDArray

from activestereo.camera.presets import StereoDepthSensorConfig

# Below this width the infrared images have twice the depth's size, since the matcher's windows would blur objects of
# ten pixels. The windows are small then, too.
_SMALL_PX = 256
# The matcher looks for no nearer things than disparities of this share of the width have.
_MOST_DISPARITY = 0.5


class StereoDepthCameraConfig(ManiSkillConfig):
    """A CameraConfig and: model, a preset's name; samples_per_pixel; min_depth and max_depth in metres; device, 'auto',
    'cpu' or an index; sensor, an activestereo.StereoDepthSensorConfig, with the RGB camera's size and intrinsics from
    the CameraConfig; pipelined, whether observations are a picture late; on_cuda, whether observations stay on the
    rendering GPU, None: if the simulation is on CUDA."""

    def __init__(
        self,
        *args: Any,
        min_depth: float = 0.1,
        max_depth: float = 10.0,
        model: str = "sapien-D435",
        samples_per_pixel: int = 4,
        device: str | int = "auto",
        sensor: StereoDepthSensorConfig | None = None,
        pipelined: bool = False,
        on_cuda: bool | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(*args, min_depth=min_depth, **kwargs)
        self.max_depth = max_depth
        self.model = model
        self.samples_per_pixel = samples_per_pixel
        self.device = device
        self.sensor = sensor
        self.pipelined = pipelined
        self.on_cuda = on_cuda

    @classmethod
    def fromCameraConfig(cls, cfg: CameraConfig) -> StereoDepthCameraConfig:
        """The name is ManiSkill's."""
        return cls(**cfg.__dict__)

    def native(self, intrinsic: NDArray[np.float64]) -> StereoDepthSensorConfig:
        """The sensor's configuration. intrinsic: 3x3 in SAPIEN's convention, the middle of the first pixel at (0.5,
        0.5)."""
        config = deepcopy(self.sensor) or self._preset_config(intrinsic)
        config.rgb_resolution = (self.width, self.height)
        config.rgb_intrinsic = _centred(intrinsic)
        return config

    def _preset_config(self, intrinsic: NDArray[np.float64]) -> StereoDepthSensorConfig:
        config = StereoDepthSensorConfig(self.model)
        scale = 2 if self.width < _SMALL_PX else 1
        focal_px, lit = config.ir_intrinsic[0, 0], _tangents(config)
        config.ir_resolution = (scale * self.width, scale * self.height)
        config.ir_intrinsic = _centred(np.diag([scale, scale, 1.0]) @ intrinsic)
        # The pattern reaches as far beyond a preset's field of view as the camera does.
        config.light_pattern_scale = max(1.0, float((_tangents(config) / lit).max()))
        config.min_depth_m, config.max_depth_m = self.min_depth, self.max_depth
        config.samples_per_pixel = self.samples_per_pixel
        nearest = int(np.ceil(config.focal_baseline_px_m / self.min_depth)) + 1
        config.max_disparity = max(32, min(nearest, int(_MOST_DISPARITY * config.ir_resolution[0])))
        if self.width < _SMALL_PX:
            config.block_width = config.block_height = 3
            config.p1, config.p2 = 4, 16
            # Dots of more than a pixel.
            dots = 0.5 * focal_px / config.ir_intrinsic[0, 0]
            config.light_pattern_scale = max(config.light_pattern_scale, dots)
        return config


def _tangents(config: StereoDepthSensorConfig) -> NDArray[np.float64]:
    """The tangents of half the infrared cameras' fields of view, horizontal and vertical."""
    return 0.5 * np.array(config.ir_resolution) / np.diag(config.ir_intrinsic)[:2]


def _centred(intrinsic: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moves SAPIEN's pixel centres at halves to ours at integers."""
    k = np.array(intrinsic, np.float64)
    k[:2, 2] -= 0.5
    return k
