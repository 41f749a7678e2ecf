# SPDX-License-Identifier: Apache-2.0
"""Depth of one camera in five kinds, one word each, to compare what a robot learns from them.

| mode | depth |
|--|--|
| clean | of the first surface, as a z-buffer has it |
| gaussian | that, with noise that grows with the square of the depth |
| isaac-like | from one view: that as disparity, with noise and in steps, as simulators' depth cameras have it |
| raster | matched stereo of Lambertian surfaces without bounces of light (Planche et al., DepthSynth, 3DV 2017) |
| full | matched stereo of path-traced images |
"""

from __future__ import annotations

from copy import deepcopy

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.nearest import unknown
from activestereo.common.pose import PoseLike
from activestereo.sensor.batch import HasPoses, StereoDepthSensorBatch

MODES = ("clean", "gaussian", "isaac-like", "raster", "full")
# Of 'gaussian': standard deviation at 1 m. A D435's subpixel noise of 0.08 px gives this.
_SIGMA_M_AT_1_M = 0.004
# Of 'isaac-like', as Isaac Sim's single-view depth sensor has them by default.
_DISPARITY_SIGMA_PX, _DISPARITY_STEP_PX = 0.25, 1.0 / 16.0


class DepthCamera:
    """Depth [E, height, width], float32 metres, of a sensor's RGB camera on each mount. 'raster' makes every material
    of the scene Lambertian, for good. pose: the RGB camera's, relative to its mount."""

    def __init__(
        self, mode: str, config: StereoDepthSensorConfig, mounts: HasPoses, pose: PoseLike | None = None
    ) -> None:
        if mode not in MODES:
            raise ValueError(unknown("mode", mode, MODES))
        self.mode = mode
        config = deepcopy(config)
        if mode == "raster":
            make_lambertian(mounts.scene)
            config.max_bounces = 0
        self.sensors = StereoDepthSensorBatch(config, mounts, pose)
        self._config = config
        self._random = np.random.default_rng(config.noise_seed)

    def seed(self, seed: int) -> None:
        """From here on all noise is as it was after the same seed."""
        self._random = np.random.default_rng(seed)
        self.sensors.restart(seed)

    def take(self) -> NDArray[np.float32]:
        """What the camera gives now, 0 = no measurement."""
        if self.mode in ("raster", "full"):
            self.sensors.take_picture(infrared_only=True)
            self.sensors.compute_depth()
            return self.sensors.get_depth()
        truth = self.sensors.render_true_depth()
        c = self._config
        truth = np.where((truth >= c.min_depth_m) & (truth < c.max_depth_m), truth, np.float32(0.0))
        if self.mode == "clean":
            return truth
        noise = self._random.standard_normal(truth.shape, np.float32)
        if self.mode == "gaussian":
            return np.where(truth > 0, truth + _SIGMA_M_AT_1_M * truth**2 * noise, 0.0).astype(np.float32)
        with np.errstate(divide="ignore", invalid="ignore"):
            disparity = c.focal_baseline_px_m / truth + _DISPARITY_SIGMA_PX * noise
            disparity = np.rint(disparity / _DISPARITY_STEP_PX) * _DISPARITY_STEP_PX
            is_measured = (truth > 0) & (disparity > 0) & (disparity < c.max_disparity)
            return np.where(is_measured, c.focal_baseline_px_m / disparity, 0.0).astype(np.float32)


def make_lambertian(scene: kuafu.Scene) -> None:
    """Takes gloss, metal, glass and what lies below surfaces from every material; diffuse colours stay."""
    for number in range(scene.summary.material_count):
        material = scene.get_material(number)
        material.metallic = material.specular = material.transmission = material.subsurface = 0.0
        material.ir_transmission = None
        scene.set_material(number, material)
