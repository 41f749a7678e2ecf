# SPDX-License-Identifier: Apache-2.0
"""Effects of a rig that moves while it exposes."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    stage=Stage.CAMERA, family="motion", moves=("right.delay_s",),
    finding="The right camera exposes at another time than the left one",
    source="stereo pairs without hardware synchronisation: shift = f v dt / z",
    parameters=[Parameter("delay_s", "s", low=-0.02, high=0.02, typical=0.001)],
)  # fmt: skip
def exposure_desync(inputs: EngineInputs, delay_s: float) -> None:
    """The right camera exposes delay_s after the left one. The disparity error follows the rig's velocity."""
    inputs.right.delay_s += delay_s


@engine_effect(
    stage=Stage.CAMERA, family="motion", moves=("camera.exposure_s",),
    finding="Motion blurs the images",
    source="exposure is an integral over time",
    parameters=[Parameter("exposure_fraction", "1", high=2.0, typical=1.0, source="1 = the frame's own exposure time")],
)  # fmt: skip
def motion_blur(inputs: EngineInputs, exposure_fraction: float) -> None:
    """The rig moves while the image is exposed. The image is the mean of the views during the exposure."""
    for side in inputs.sides:
        side.camera.exposure_s = exposure_fraction * inputs.frame.exposure_s


@engine_effect(
    stage=Stage.CAMERA, family="motion", moves=("camera.shutter", "camera.line_time_s", "camera.readout"),
    finding="Rows are exposed one after the other",
    source="Meingast, Geyer and Sastry 2005, Geometric models of rolling-shutter cameras",
    parameters=[Parameter("line_time_s", "s", low=-1e-4, high=1e-4, typical=2e-5, source="10-70 us on common imagers")],
)  # fmt: skip
def rolling_shutter(inputs: EngineInputs, line_time_s: float) -> None:
    """The imager exposes its rows one after the other. The middle row has the frame's time."""
    for side in inputs.sides:
        side.camera.shutter = "rolling"
        side.camera.line_time_s = abs(line_time_s)
        side.camera.readout = "rows_down" if line_time_s > 0 else "rows_up"
