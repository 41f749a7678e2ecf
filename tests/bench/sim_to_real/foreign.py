# SPDX-License-Identifier: Apache-2.0
"""A world that stands for reality. Its camera differs from the simulated one, and the simulation does not know how.

| what | simulation | here |
|--|--|--|
| matcher | simsense | OpenCV's StereoSGBM, all paths |
| noise | the preset's, of a D435 | SAPIEN's model, gamma and Gaussian noise of 4 % and 0.5 counts |
| dots | the preset's pattern | of another draw, a tenth wider, 15 % of the light missing |
| optics | the preset's blur | one and a half times as wide |
| calibration | exact | right camera turned by 0.02 degrees |
| materials | as the objects' data | rougher by 0.06, darker by 10 to 30 % |
| room | one lamp | another place, brighter, another table |
| light | `samples` rays, denoised | other rays, not denoised |

The renderer is ours, as the modes' is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import kuafu
from sim_to_real.objects import BenchmarkObject
from sim_to_real.sgbm import Sgbm
from sim_to_real.stage import CameraSettings, Room, Stage
from sim_to_real.views import rotation
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.sensor.depth_modes import DepthCamera

_ROOM = Room(ambient=0.3, table_albedo=0.35, lamp_m=(-0.6, 0.5, 1.0), lamp_w_per_sr=1.6)
_BOUNCES = 6
_RIGHT_TURN_RAD = np.deg2rad([0.02, 0.0, 0.0])  # about the row axis, unknown to rectification


class ForeignStage(Stage):
    """A Stage with this world's camera, room and materials."""

    def __init__(
        self,
        objects: tuple[BenchmarkObject, ...],
        world: str,
        settings: CameraSettings,
        device: str | int = "auto",
        samples: int = 64,
    ) -> None:
        super().__init__(objects, world, replace(settings, samples=samples), device, _ROOM)
        for index, number in enumerate(self.materials):
            self.scene.set_material(number, _aged(self.scene.get_material(number), index))
        self.camera.sensors.close()
        self.camera = _ForeignCamera(DepthCamera("full", foreign_config(self.config), self.mounts))


class _ForeignCamera:
    def __init__(self, camera: DepthCamera) -> None:
        self._sensors, self._matcher = camera.sensors, Sgbm(camera.sensors.get_config())
        one = np.ones(1)
        for environment in range(self._sensors.shape[0]):
            self._sensors.vary(environment, one, one, rotation(_RIGHT_TURN_RAD)[None])

    def seed(self, seed: int) -> None:
        self._sensors.restart(seed)

    def take_depth(self) -> NDArray[np.float32]:
        self._sensors.take_picture(infrared_only=True)
        self._sensors.compute_depth()
        pairs = zip(*self._sensors.get_ir_measured(), strict=True)
        return np.stack([self._matcher.depth(left, right) for left, right in pairs])


def foreign_config(config: StereoDepthSensorConfig) -> StereoDepthSensorConfig:
    """`config`, changed in place."""
    config.ir_signal, config.ir_speckle_of_laser = None, False
    config.ir_speckle_noise, config.ir_thermal_noise = 1.5, 2.0
    design = config.pattern_design
    config.pattern_design = replace(design, seed=design.seed + 77, dot_sigma_px=1.1 * design.dot_sigma_px)
    config.projector_intensity *= 0.85
    optics = dict(config.ir_optics or {})
    config.ir_optics = optics | {"psf_sigma_px": 1.5 * optics.get("psf_sigma_px", 0.3)}
    config.denoise, config.max_bounces = "none", _BOUNCES
    return config


def _aged(material: kuafu.Material, index: int) -> kuafu.Material:
    share = 0.7 + 0.2 * (index % 3) / 2.0
    if not material.transmission:
        material.roughness = min(1.0, material.roughness + 0.06)
        red, green, blue, alpha = material.base_color
        material.base_color = (share * red, share * green, share * blue, alpha)
        if material.ir_albedo is not None:
            material.ir_albedo *= share
    return material
