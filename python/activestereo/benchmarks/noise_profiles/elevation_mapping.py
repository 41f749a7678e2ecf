# SPDX-License-Identifier: Apache-2.0
"""elevation_mapping's variances of a depth camera's points, as its YAML.

Its structured-light sensor (Nguyen, Izadi and Lovell, 3DIMPVT 2012; ANYbotics/elevation_mapping,
StructuredLightSensorProcessor) has a standard deviation along the ray, a + b (z - c)^2 + d z^e in metres, one across
it, lateral_factor z, and cutoffs of depth. The defaults are its realsense_d435.yaml.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.noise_profiles.profile import Profile, Views, clipped


@dataclass(frozen=True)
class ElevationMapping(Profile):
    FILE = "elevation_mapping.yaml"
    LACKS = (
        "holes: it takes the points that there are",
        "bias, steps of disparity, and errors that neighbours share: variances of points are added as if independent",
        "the spread across the ray is not fitted: lateral_factor is a pixel's width",
    )
    FITTED: ClassVar = {"a": (0.0, 0.02, 0.002), "b": (0.0, 0.1, 0.01), "c": (-1.0, 1.0, 0.3)}

    a: float = 0.00241809
    b: float = 0.00662547
    c: float = 0.77199589
    lateral_factor: float = 0.00220941
    near_m: float = 0.35
    far_m: float = 3.0

    @classmethod
    def known(cls, views: Views) -> ElevationMapping:
        return cls(lateral_factor=1.0 / float(views.k[0, 0]), near_m=views.near_m, far_m=views.far_m)

    def apply(self, views: Views, random: np.random.Generator) -> NDArray[np.float32]:
        sigma_m = self.a + self.b * (views.truth_m - self.c) ** 2
        noisy = views.truth_m + sigma_m * random.standard_normal(views.truth_m.shape, np.float32)
        return clipped(views.truth_m, noisy, self.near_m, self.far_m)

    def file_text(self, views: Views) -> str:
        values = {
            "cutoff_min_depth": self.near_m,
            "cutoff_max_depth": self.far_m,
            "normal_factor_a": self.a,
            "normal_factor_b": self.b,
            "normal_factor_c": self.c,
            "normal_factor_d": 0,
            "normal_factor_e": 1,
            "lateral_factor": self.lateral_factor,
        }
        lines = [f"sensor_processor/{name}: {value:.8g}" for name, value in values.items()]
        return "\n".join(["sensor_processor/type: structured_light", *lines, ""])
