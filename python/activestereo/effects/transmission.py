# SPDX-License-Identifier: Apache-2.0
"""Simulates surfaces that let light through."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.surfaces import SURFACES, chosen
from activestereo.effects.core.view import View


@moves("materials.ir_transmission", "materials.thin_walled")
def _engine(inputs: EngineInputs, fraction: float, behind: float, surfaces: float) -> None:
    for material in inputs.surfaces(surfaces):
        material.ir_transmission = fraction
        material.thin_walled = True


@effect(
    "transmission",
    stage=Stage.SURFACE,
    family="surface",
    finding="Surfaces let light through",
    source="KHR_materials_transmission: a share of the diffuse light goes through instead",
    parameters=[
        Parameter("fraction", "1", neutral=0.0, low=0.0, high=1.0, typical=0.2),
        Parameter(
            "behind", "1", neutral=0.5, low=0.0, high=1.0, typical=0.3, in_engine=False,
            source="radiance of what lies behind over the ambient radiance",
        ),
        SURFACES,
    ],
    engine=_engine,
)  # fmt: skip
def transmission(light: Light, view: View, fraction: float, behind: float, surfaces: float) -> Light:
    """Surfaces reflect less light and let the background show through: its ambient light, but not its dots."""
    if fraction == 0.0:
        return light
    share = np.where((view.depth_m > 0) & chosen(view, surfaces), fraction, 0.0)
    kept = 1.0 - share
    return Light(
        light.direct * kept,
        light.indirect * kept,
        light.ambient * kept + share * behind,
        light.flat * kept,
        light.supersampled,
    )
