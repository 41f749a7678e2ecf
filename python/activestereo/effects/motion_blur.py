# SPDX-License-Identifier: Apache-2.0
"""Simulates motion during the exposure."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "motion_blur",
    moves=("camera.exposure_s",),
    stage=Stage.CAMERA,
    family="motion",
    finding="Motion blurs the images",
    source="exposure is an integral over time",
    parameters=[
        Parameter(
            "exposure_fraction", "1", neutral=0.0, low=0.0, high=2.0, typical=1.0,
            source="1 = the frame's own exposure time",
        )
    ],
)  # fmt: skip
def motion_blur(inputs: EngineInputs, exposure_fraction: float) -> None:
    """The image is the mean over the exposure of what the moving rig sees."""
    for side in inputs.sides:
        side.camera.exposure_s = exposure_fraction * inputs.frame.exposure_s
