# SPDX-License-Identifier: Apache-2.0
"""Isaac Sim's single-view depth sensor, as a USD layer.

The attributes, their meaning and their defaults: NVIDIA, ovrtx 0.7.0, "Camera single-view stereo depth model" (pages
"USD Attributes" and "Tune Noise, Quantization and Confidence"), and the example of OmniSensorDepthSensorSingleViewAPI
in the RTX sensors' documentation. Up to Isaac Sim 6 they are omni:rtx:post:depthSensor:* of a RenderProduct, in ovrtx
0.7 omni:sensor:depthSensor:* of a Camera: the layer has both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.noise_profiles.profile import Profile, Views
from activestereo.sensor.rival_noise import IsaacSettings, isaac


@dataclass(frozen=True)
class Isaac(Profile):
    """confidence: 0.7 by default, which drops surfaces without texture; 0 drops nothing."""

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
