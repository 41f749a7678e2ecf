# SPDX-License-Identifier: Apache-2.0
"""Simulates dots that blur away from the projector's focus."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "projector_defocus",
    moves=("projector.radius_m", "projector.focus_m"),
    stage=Stage.PROJECTOR,
    family="projector blur",
    finding="The projector is out of focus",
    source="thin lens: the blur circle's angular radius = aperture radius x |1/z - 1/z_focus|",
    parameters=[
        Parameter(
            "aperture_px_m", "px m", neutral=0.0, low=0.0, high=6.0, typical=1.0,
            source="radius of the aperture times focal length in pattern pixels",
        ),
        Parameter("focus_m", "m", neutral=1.0, low=0.2, high=5.0, typical=0.5),
    ],
    is_pointwise=True,
)  # fmt: skip
def projector_defocus(inputs: EngineInputs, aperture_px_m: float, focus_m: float) -> None:
    """Each dot becomes a disc whose radius in pattern pixels is aperture x |1/z - 1/focus|; ambient edges stay sharp.
    """
    if inputs.projector is not None and aperture_px_m > 0.0:
        inputs.projector.radius_m = aperture_px_m / np.mean(np.diag(inputs.projector.k)[:2])
        inputs.projector.focus_m = focus_m
