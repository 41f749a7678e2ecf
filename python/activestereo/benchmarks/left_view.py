# SPDX-License-Identifier: Apache-2.0
"""Depth as the left infrared camera sees it, for matchers and recordings that know no RGB camera."""

from __future__ import annotations

import numpy as np

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import Pose


def with_rgb_at_left(config: StereoDepthSensorConfig) -> StereoDepthSensorConfig:
    """The configuration, changed: its RGB camera takes the left infrared one's place; the rest stays."""
    to_left = np.linalg.inv(config.trans_pose_l.to_transformation_matrix())
    for name in ("pose_rgb_irproj", "trans_pose_r", "trans_pose_l"):
        setattr(config, name, Pose(to_left @ getattr(config, name).to_transformation_matrix()))
    return config
