# SPDX-License-Identifier: Apache-2.0
"""Simulates a principal point of the right camera that differs from its calibration. A small yaw looks the same."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "principal_point_offset",
    moves=("right.camera.k",),
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The right image is shifted against its calibration",
    source="device reports of 0.05-1 px after thermal or mechanical stress (librealsense issues 8230, 9561)",
    parameters=[
        Parameter("cx_px", "px", neutral=0.0, low=-5.0, high=5.0, typical=0.2),
        Parameter("cy_px", "px", neutral=0.0, low=-5.0, high=5.0, typical=0.1),
    ],
)
def principal_point_offset(inputs: EngineInputs, cx_px: float, cy_px: float) -> None:
    """The right image is shifted: a constant disparity error, growing with distance squared in depth."""
    inputs.right.shift_image(cx_px, cy_px)
