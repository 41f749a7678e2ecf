# SPDX-License-Identifier: Apache-2.0
"""Point pair features (Drost et al., CVPR 2010) as OpenCV has them, refined by ICP. Needs no guess."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_to_real.clouds import LEAST, Cloud
from sim_to_real.icp import Icp, IcpSetting
from sim_to_real.objects import Surface

_TRIED = 8  # the poses with the most votes
# For the model: sampling and the features' steps, relative to its size. For the scene: number of voting points, and
# sampling.
_STEP, _SCENE_SHARE, _SCENE_DISTANCE = 0.1, 0.1, 0.05
# OpenCV joins poses that are nearer to each other than its relative step, taken as a length. In millimetres that joins
# equal ones alone; in metres it would join all.
_UNITS_PER_M = 1000.0


@dataclass(frozen=True)
class PpfSetting:
    """reach_m: distance limit of the ICP, and of points that agree with a pose."""

    reach_m: float


class Ppf:
    SETTINGS = tuple(PpfSetting(reach) for reach in (0.003, 0.006, 0.012, 0.03))

    def __init__(self, surface: Surface, setting: PpfSetting) -> None:
        if not hasattr(cv2, "ppf_match_3d"):
            raise ImportError("point pair features need OpenCV with its extra modules: Debian's python3-opencv")
        self._icp = Icp(surface, IcpSetting(setting.reach_m, "plane"))
        self._detector: Any = cv2.ppf_match_3d.PPF3DDetector(_STEP, _STEP)
        self._detector.trainModel(_table(surface.points, surface.normals))

    def find(self, cloud: Cloud, start: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """object_to_world, or None. It ignores the guess."""
        if len(cloud.points) < LEAST:
            return None
        try:
            found = self._detector.match(_table(cloud.points, cloud.normals), _SCENE_SHARE, _SCENE_DISTANCE)
        except cv2.error:  # it asserts if its own thinning leaves too few points of a scene
            return None
        starts = np.array([pose.pose for pose in found[:_TRIED]], np.float64).reshape(-1, 4, 4)
        starts[:, :3, 3] /= _UNITS_PER_M
        refined = [self._icp.refine(cloud, start) for start in starts]
        return max(refined, key=lambda r: r[1])[0] if refined else None


def _table(points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.ascontiguousarray(np.concatenate([_UNITS_PER_M * points, normals], axis=1), np.float32)
