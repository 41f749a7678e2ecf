# SPDX-License-Identifier: Apache-2.0
"""Principal point of the right camera off its calibration (also: yaw)."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@moves("right.camera.k")
def _engine(inputs: EngineInputs, cx_px: float, cy_px: float) -> None:
    inputs.right.shift_image(cx_px, cy_px)


@effect(
    "principal_point_offset",
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The right image is shifted against its calibration",
    source="device reports of 0.05-1 px after thermal or mechanical stress (librealsense issues 8230, 9561)",
    parameters=[
        Parameter("cx_px", "px", neutral=0.0, low=-5.0, high=5.0, typical=0.2),
        Parameter("cy_px", "px", neutral=0.0, low=-5.0, high=5.0, typical=0.1),
    ],
    engine=_engine,
)
def principal_point_offset(light: Light, view: View, cx_px: float, cy_px: float) -> Light:
    """The right image is shifted: a constant disparity error, growing with distance squared in depth."""
    if not view.is_right or (cx_px == 0.0 and cy_px == 0.0):
        return light
    u, v = view.pixels()
    return light.warped(u - cx_px, v - cy_px)
