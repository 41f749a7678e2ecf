# SPDX-License-Identifier: Apache-2.0
"""A matcher of another project: OpenCV's StereoSGBM, all paths."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.camera.plan import plan_of
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.camera.plan import registered


class Sgbm:
    """OpenCV's matcher for rectified pairs that `config` describes."""

    def __init__(self, config: StereoDepthSensorConfig) -> None:
        self._config, self._plan = config, plan_of(config)
        self._border = -(-config.max_disparity // 16) * 16
        mode = cv2.STEREO_SGBM_MODE_HH
        self._matcher = cv2.StereoSGBM_create(0, self._border, 5, 8 * 25, 32 * 25, 1, 0, 8, 60, 2, mode)

    def depth(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        """[height, width] metres as the RGB camera sees it, 0 = no measurement; left, right: counts."""
        wide = [cv2.copyMakeBorder(i, 0, 0, self._border, 0, cv2.BORDER_REPLICATE) for i in (left, right)]
        disparity = self._matcher.compute(*wide)[:, self._border :].astype(np.float32) / 16.0
        depth = np.where(disparity > 0.5, self._config.focal_baseline_px_m / np.maximum(disparity, 0.5), 0.0)
        return registered(depth.astype(np.float32), self._config.ir_intrinsic, np.eye(4), self._plan)
