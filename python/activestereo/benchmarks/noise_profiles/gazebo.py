# SPDX-License-Identifier: Apache-2.0
"""Gazebo's depth camera, as SDF.

SDFormat's <camera> has <clip> and one additive Gaussian <noise> of mean and stddev, the same at all depths
(gz-sensors, ImageGaussianNoiseModel; asked to be more in gz-sensors#416); without <noise> depth is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.noise_profiles.profile import Profile, Views, clipped


@dataclass(frozen=True)
class Gazebo(Profile):
    FILE = "gazebo.sdf"
    LACKS = (
        "noise that grows with depth: one stddev in metres is too much near by and too little far away",
        "holes, other than what is nearer or farther than the clip planes",
        "steps of disparity, and errors that neighbours share",
    )
    FITTED: ClassVar = {"mean_m": (-0.05, 0.05, 0.0), "stddev_m": (0.0, 0.2, 0.02)}

    mean_m: float = 0.0
    stddev_m: float = 0.0
    near_m: float = 0.1
    far_m: float = 100.0

    @classmethod
    def known(cls, views: Views) -> Gazebo:
        return cls(near_m=views.near_m, far_m=views.far_m)

    def apply(self, views: Views, random: np.random.Generator) -> NDArray[np.float32]:
        noise = self.mean_m + self.stddev_m * random.standard_normal(views.truth_m.shape, np.float32)
        return clipped(views.truth_m, views.truth_m + noise, self.near_m, self.far_m)

    def file_text(self, views: Views) -> str:
        height, width = views.truth_m.shape[1:]
        (fx, _, cx), (_, fy, cy), _ = views.k
        return f"""<?xml version="1.0"?>
<sdf version="1.9">
  <model name="depth_camera">
    <link name="link">
      <sensor name="depth_camera" type="depth_camera">
        <camera>
          <horizontal_fov>{2.0 * np.arctan(width / (2.0 * fx)):.6f}</horizontal_fov>
          <image><width>{width}</width><height>{height}</height><format>R_FLOAT32</format></image>
          <clip><near>{self.near_m:.6g}</near><far>{self.far_m:.6g}</far></clip>
          <lens><intrinsics><fx>{fx:.6g}</fx><fy>{fy:.6g}</fy><cx>{cx:.6g}</cx><cy>{cy:.6g}</cy><s>0</s></intrinsics></lens>
          <noise><type>gaussian</type><mean>{self.mean_m:.6g}</mean><stddev>{self.stddev_m:.6g}</stddev></noise>
        </camera>
      </sensor>
    </link>
  </model>
</sdf>
"""
