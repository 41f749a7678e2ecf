# SPDX-License-Identifier: Apache-2.0
"""Implements the noise models of three systems, each with the text of its file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.noise_profiles.profile import Profile, Views, clipped
from activestereo.sensor.rival_noise import IsaacSettings, isaac


@dataclass(frozen=True)
class Isaac(Profile):
    """The noise model of Isaac Sim's single-view depth sensor, written as a USD layer.

    The attributes, their meaning and their defaults are from NVIDIA, ovrtx 0.7.0, "Camera single-view stereo depth
    model" (pages "USD Attributes" and "Tune Noise, Quantization and Confidence"), and from the example of
    OmniSensorDepthSensorSingleViewAPI in the RTX sensors' documentation. Up to Isaac Sim 6 their names are
    omni:rtx:post:depthSensor:* of a RenderProduct, in ovrtx 0.7 omni:sensor:depthSensor:* of a Camera. The layer has
    both.

    confidence: 0.7 by default, which drops surfaces without texture; 0 drops nothing.
    """

    FILE = "isaac.usda"
    LACKS = (
        "bias: noise has no mean, noiseMean being the step of disparity",
        "holes of dark, glossy and saturated surfaces: with confidenceThreshold 0 holes come from occlusion and range",
        "errors that neighbours share, and that grow where the pattern is dim",
    )
    FITTED: ClassVar = {"step_px": (0.01, 1.0, 0.1), "sigma_px": (0.0, 1.5, 0.3)}

    step_px: float = 0.25
    sigma_px: float = 0.25
    max_disparity_px: float = 110.0
    min_distance_m: float = 0.5
    max_distance_m: float = 9999.9
    confidence: float = 0.7

    @classmethod
    def known(cls, views: Views) -> Isaac:
        return cls(
            max_disparity_px=views.focal_baseline_px_m / views.near_m,
            min_distance_m=views.near_m,
            max_distance_m=views.far_m,
            confidence=0.0,
        )

    def apply(self, views: Views, random: np.random.Generator) -> NDArray[np.float32]:
        near = np.where(views.truth_m <= self.max_distance_m, views.truth_m, np.float32(0.0))
        settings = IsaacSettings(
            self.step_px, self.sigma_px, self.max_disparity_px, self.min_distance_m, self.confidence > 0.0
        )
        return isaac(near, views.gray, float(views.k[0, 0]), views.baseline_m, settings, random)

    def file_text(self, views: Views) -> str:
        values = {
            "baselineMM": views.baseline_m * 1000.0,
            "focalLengthPixel": float(views.k[0, 0]),
            "sensorSizePixel": float(views.truth_m.shape[2]),
            "maxDisparityPixel": self.max_disparity_px,
            "noiseMean": self.step_px,
            "noiseSigma": self.sigma_px,
            "noiseDownscaleFactorPixel": 1.0,
            "confidenceThreshold": self.confidence,
            "minDistance": self.min_distance_m,
            "maxDistance": self.max_distance_m,
        }

        def prim(kind: str, name: str, schema: str, space: str) -> list[str]:
            head = [f'def {kind} "{name}" (', f'    prepend apiSchemas = ["{schema}"]', ")", "{"]
            enabled = [f"    bool {space}:enabled = 1"] if kind == "RenderProduct" else []
            return [*head, *enabled, *(f"    float {space}:{key} = {value:.6g}" for key, value in values.items()), "}"]

        product = prim(
            "RenderProduct", "DepthSensor", "OmniSensorDepthSensorSingleViewAPI", "omni:rtx:post:depthSensor"
        )
        camera = prim("Camera", "DepthCamera", "OmniSensorGenericDepthSensorSingleViewAPI", "omni:sensor:depthSensor")
        return "\n".join(["#usda 1.0", "", *product, "", *camera, ""])


@dataclass(frozen=True)
class Gazebo(Profile):
    """The noise model of Gazebo's depth camera, written as SDF.

    SDFormat's <camera> has <clip> and one additive Gaussian <noise> of mean and stddev, the same at all depths
    (gz-sensors, ImageGaussianNoiseModel; gz-sensors#416 asks for more). Without <noise> depth is exact.
    """

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


@dataclass(frozen=True)
class ElevationMapping(Profile):
    """elevation_mapping's variances of a depth camera's points, written as its YAML file.

    Its structured-light sensor (Nguyen, Izadi and Lovell, 3DIMPVT 2012; ANYbotics/elevation_mapping,
    StructuredLightSensorProcessor) has a standard deviation along the ray, a + b (z - c)^2 + d z^e in metres, one
    across it, lateral_factor z, and cutoffs of depth. The defaults are its realsense_d435.yaml.
    """

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


PROFILES: dict[str, type[Profile]] = {
    "isaac": Isaac,
    "gazebo": Gazebo,
    "elevation_mapping": ElevationMapping,
}
