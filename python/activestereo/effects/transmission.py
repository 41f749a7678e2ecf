# SPDX-License-Identifier: Apache-2.0
"""Simulates surfaces that let light through."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.surfaces import SURFACES


@engine_effect(
    "transmission",
    moves=("materials.ir_transmission", "materials.thin_walled"),
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
)  # fmt: skip
def transmission(inputs: EngineInputs, fraction: float, behind: float, surfaces: float) -> None:
    """Surfaces reflect less light and let the background show through: its ambient light, but not its dots."""
    inputs.unrendered["behind"] = behind
    for material in inputs.surfaces(surfaces):
        material.ir_transmission = fraction
        material.thin_walled = True
