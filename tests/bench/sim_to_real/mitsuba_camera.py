# SPDX-License-Identifier: Apache-2.0
"""A stereo camera with a dot projector in Mitsuba 3. Its geometry is a preset's; its light, optics, exposure and noise
differ (the table in foreign_mitsuba.py)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_to_real.mitsuba_scene import mitsuba, pose, projector
from sim_to_real.views import rotation
from activestereo.camera.plan import pattern_k
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pattern import PatternDesign, make_pattern
from activestereo.common.pose import Pose, camera_to_world

_MOST_DEPTH = 8  # surfaces of a path, the light's and the camera's included
_RIGHT_TURN_RAD = np.deg2rad([0.02, 0.0, 0.0])  # about the row axis, unknown to rectification
_LASER_SHARE, _DOT_WIDTH, _PATTERN_SEED = 0.85, 1.1, 77
_SPECKLE = 0.1
_NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.uint8)
_SHARPEST, _BLUR_PX = 3.0, 0.5
_FULL_WELL_E, _READ_E, _TARGET_DN = 15_000.0, 10.0, 80.0


class MitsubaCamera:
    """Infrared pairs of the cameras of `config`. samples: rays per pixel of the projector's light, and of the room's;
    with 64 the error on matt surfaces is a fifth of the camera's noise. Raises ValueError without Mitsuba."""

    def __init__(self, config: StereoDepthSensorConfig, samples: int) -> None:
        self._mi, self._config, self._samples = mitsuba(), config, samples
        design = config.pattern_design
        own = {"seed": design.seed + _PATTERN_SEED, "dot_sigma_px": _DOT_WIDTH * design.dot_sigma_px}
        pattern = make_pattern(PatternDesign(**{**vars(design), **own})) / 255.0
        k = pattern_k(config, design.width, design.height)
        k[[0, 1], [0, 1]] /= config.light_pattern_scale
        self._laser = projector(self._mi, pattern, k, _LASER_SHARE * config.projector_intensity, np.eye(4))

    def light(
        self, things: dict[str, Any], room: dict[str, Any], body: Pose, random: np.random.Generator
    ) -> list[NDArray[np.float64]]:
        """The light at the left and the right camera, [height, width]. things, room: parts of a scene, lit surfaces and
        their lights. body: the RGB camera's pose."""
        seeds = iter(random.integers(2**31, size=4).tolist())
        config = self._config
        laser = self._laser | {"to_world": pose(self._mi, camera_to_world(body * config.pose_rgb_irproj))}
        right_turn = np.eye(4)
        right_turn[:3, :3] = rotation(_RIGHT_TURN_RAD)
        sides = (config.trans_pose_l, np.eye(4)), (config.trans_pose_r, right_turn)
        light = []
        for place, turn in sides:
            sensor = self._sensor(camera_to_world(body * place) @ turn)
            dots, other = (self._render(things | part, sensor, next(seeds)) for part in ({"laser": laser}, room))
            light.append(dots * random.lognormal(-0.5 * _SPECKLE**2, _SPECKLE, dots.shape) + other)
        return light

    def counts(self, light: list[NDArray[np.float64]], random: np.random.Generator) -> list[NDArray[np.uint8]]:
        """[height, width] of each camera in one exposure of this light."""
        height, width = light[0].shape
        x = (np.arange(width) - 0.5 * (width - 1)) / self._config.ir_intrinsic[0, 0]
        y = (np.arange(height) - 0.5 * (height - 1)) / self._config.ir_intrinsic[1, 1]
        lens = 1.0 / (1.0 + x[None] ** 2 + y[:, None] ** 2) ** 2
        middle = slice(height // 4, -(height // 4)), slice(width // 4, -(width // 4))
        electrons_per_dn = _FULL_WELL_E / 255.0
        scale = _TARGET_DN * electrons_per_dn / np.mean([(lens * image)[middle] for image in light])
        electrons = [random.poisson(scale * lens * image) + random.normal(0.0, _READ_E, lens.shape) for image in light]
        return [np.clip(np.rint(own / electrons_per_dn), 0, 255).astype(np.uint8) for own in electrons]

    def _render(self, parts: dict[str, Any], sensor: dict[str, Any], seed: int) -> NDArray[np.float64]:
        integrator = {"type": "volpath", "max_depth": _MOST_DEPTH, "rr_depth": 100}
        scene = self._mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, **parts})
        image = np.array(self._mi.render(scene, spp=self._samples, seed=seed), np.float64)[..., :3].mean(axis=-1)
        # A path that meets a lamp by way of metal is rare and bright: a single pixel that no lens would draw so sharp.
        brightest = cv2.dilate(image, _NEIGHBOURS)
        return np.asarray(cv2.GaussianBlur(np.minimum(image, _SHARPEST * brightest), (0, 0), _BLUR_PX))

    def _sensor(self, to_world: NDArray[np.float64]) -> dict[str, Any]:
        width, height = self._config.ir_resolution
        return {
            "type": "perspective",
            "fov": float(np.rad2deg(2 * np.arctan(0.5 * width / self._config.ir_intrinsic[0, 0]))),
            "to_world": pose(self._mi, to_world),
            "near_clip": 1e-3,
            "sampler": {"type": "multijitter", "sample_count": self._samples},
            "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
        }
