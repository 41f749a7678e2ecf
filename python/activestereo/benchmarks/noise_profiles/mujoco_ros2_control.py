# SPDX-License-Identifier: Apache-2.0
"""mujoco_ros2_control's depth camera, as a <ros2_control> sensor of a URDF.

The model is that of ros-controls/mujoco_ros2_control#303: NaN outside of a range, sigma(z) = z^2 subpixel / (fx
baseline) and a share of pixels that drop out. depth_min_range and depth_max_range are the pull request's names; the
other three follow its description. Compare them after its merge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.noise_profiles.profile import Profile, Views, clipped
from activestereo.sensor.rival_noise import gaussian


@dataclass(frozen=True)
class MujocoRos2Control(Profile):
    """The noise model. The defaults are a D435i's data sheet without drop-outs."""

    FILE = "mujoco_ros2_control.urdf"
    LACKS = (
        "bias, and steps of disparity",
        "where holes are: drop-outs are spread evenly, not at edges, dark or glossy surfaces",
        "errors that neighbours share",
    )
    FITTED: ClassVar = {"subpixel_px": (0.0, 1.5, 0.2), "dropout": (0.0, 0.5, 0.1)}

    subpixel_px: float = 0.08
    dropout: float = 0.0
    near_m: float = 0.28
    far_m: float = 10.0

    @classmethod
    def known(cls, views: Views) -> MujocoRos2Control:
        return cls(near_m=views.near_m, far_m=views.far_m)

    def apply(self, views: Views, random: np.random.Generator) -> NDArray[np.float32]:
        noisy = gaussian(views.truth_m, self.subpixel_px / views.focal_baseline_px_m, random)
        is_kept = random.random(views.truth_m.shape, np.float32) >= self.dropout
        return np.where(is_kept, clipped(views.truth_m, noisy, self.near_m, self.far_m), np.float32(0.0))

    def file_text(self, views: Views) -> str:
        values = {
            "depth_min_range": self.near_m,
            "depth_max_range": self.far_m,
            "depth_subpixel": self.subpixel_px,
            "depth_baseline": views.baseline_m,
            "depth_dropout": self.dropout,
        }
        lines = [f'    <param name="{name}">{value:.6g}</param>' for name, value in values.items()]
        return "\n".join(
            [
                '<robot name="depth_camera">',
                '  <ros2_control name="MujocoSystem" type="system">',
                '  <sensor name="camera">',
                *lines,
                "  </sensor>",
                "  </ros2_control>",
                "</robot>",
                "",
            ]
        )
