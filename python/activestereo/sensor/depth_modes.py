# SPDX-License-Identifier: Apache-2.0
"""Eight models of a depth camera, from the exact depth to full simulation, for comparing policies trained on each.

| mode | depth |
|--|--|
| clean | exact depth of the first surface, as a z-buffer has it |
| gaussian | exact depth with noise that grows with the square of the depth |
| datasheet | as gaussian, with the noise of a datasheet's subpixel RMS |
| simkinect | exact depth, shifted and in steps of disparity (Barron and Malik 2013; Handa et al. 2014) |
| redwood | as simkinect, coarser, as Habitat and Open3D have it (Choi et al. 2015) |
| isaac-like | noise, steps, occlusion and missing texture, as Isaac Sim's single-view depth sensor |
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
from activestereo.sensor.batch import StereoDepthSensorBatch
from activestereo.sensor.mounts import HasPoses
from activestereo.sensor.rival_noise import OF_TRUTH, IsaacSettings, one_view_depth

MODES = (*OF_TRUTH, "raster", "full")


class DepthCamera:
    """Measures depth by one of MODES with the RGB camera of a sensor on each mount. 'raster' makes every material of
    the scene Lambertian, for good. pose: the RGB camera's pose relative to its mount; None: identity. isaac: settings
    of 'isaac-like'; None: Isaac Sim's, which drop depth below 0.5 m and surfaces without texture."""

    def __init__(
        self, mode: str, config: StereoDepthSensorConfig, mounts: HasPoses, pose: PoseLike | None = None,
        isaac: IsaacSettings | None = None,
    ) -> None:  # fmt: skip
        if mode not in MODES:
            raise ValueError(unknown("mode", mode, MODES))
        self.mode, self._isaac = mode, isaac or IsaacSettings()
        config = deepcopy(config)
        if mode == "raster":
            make_lambertian(mounts.scene)
            config.max_bounces = 0
        self.sensors = StereoDepthSensorBatch(config, mounts, pose)
        self._config = config
        self._random = np.random.default_rng(config.noise_seed)

    def seed(self, seed: int) -> None:
        """Restarts all noise under this seed; the same seed repeats it."""
        self._random = np.random.default_rng(seed)
        self.sensors.restart(seed)

    def take_depth(self) -> NDArray[np.float32]:
        """Measures the scene as it is now. Returns float32 [E, height, width], metres in the RGB camera, 0 = no
        measurement."""
        if self.mode in ("raster", "full"):
            self.sensors.take_picture(infrared_only=True)
            self.sensors.compute_depth()
            return self.sensors.get_depth()
        c, gray = self._config, None
        if self.mode == "isaac-like" and self._isaac.needs_texture:
            self.sensors.take_picture()
            truth, gray = self.sensors.get_true_depth(), self.sensors.get_rgb().mean(axis=-1)
        else:
            truth = self.sensors.render_true_depth()
        truth = np.where((truth >= c.min_depth_m) & (truth < c.max_depth_m), truth, np.float32(0.0))
        lens = float(c.ir_intrinsic[0, 0]), c.focal_baseline_px_m
        return one_view_depth(self.mode, truth, gray, *lens, self._random, self._isaac)


def make_lambertian(scene: kuafu.Scene) -> None:
    """Removes gloss, metal, glass and subsurface scattering from every material; diffuse colours stay."""
    for number in range(scene.summary.material_count):
        material = scene.get_material(number)
        material.metallic = material.specular = material.transmission = material.subsurface = 0.0
        material.ir_transmission = None
        scene.set_material(number, material)
