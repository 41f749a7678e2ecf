# SPDX-License-Identifier: Apache-2.0
"""OpenCV's StereoSGBM behind a sensor."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.presets import StereoDepthSensorConfig

_BLOCK = 7
_STEPS = 16  # of a pixel in its disparities
_WIDER = 16  # disparities come in multiples of this


class OpenCVMatcher:
    """SGBM with eight paths of the configuration's disparities, uniqueness and left-right check; other parameters are
    those of OpenCV's documentation. ImportError where cv2 is missing."""

    def __init__(self, config: StereoDepthSensorConfig) -> None:
        import cv2

        count = -(-config.max_disparity // _WIDER) * _WIDER
        self._margin = count + max(0, config.min_disparity)
        self._cv2, self._sgbm = cv2, cv2.StereoSGBM_create(
            minDisparity=config.min_disparity, numDisparities=count, blockSize=_BLOCK, P1=8 * _BLOCK**2,
            P2=32 * _BLOCK**2, disp12MaxDiff=config.lr_max_diff, preFilterCap=63,
            uniquenessRatio=config.uniqueness_ratio, mode=cv2.STEREO_SGBM_MODE_HH4,
        )  # fmt: skip
        self._least = config.min_disparity

    def __call__(self, left: NDArray[Any], right: NDArray[Any]) -> tuple[NDArray[np.float32], None]:
        return np.stack([self._match(*pair) for pair in zip(left, right, strict=True)]), None

    def _match(self, left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.float32]:
        scale = 255.0 / max(255, int(left.max()), int(right.max()))
        wide = (  # OpenCV leaves the first columns out, as many as there are disparities
            self._cv2.copyMakeBorder(
                (image * scale).astype(np.uint8), 0, 0, self._margin, 0, self._cv2.BORDER_REPLICATE
            )
            for image in (left, right)
        )
        disparity = self._sgbm.compute(*wide)[:, self._margin :].astype(np.float32) / _STEPS
        return np.where(disparity >= self._least, disparity, np.float32(np.nan))
