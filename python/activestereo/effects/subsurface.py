# SPDX-License-Identifier: Apache-2.0
"""Simulates light that scatters below the surface and leaves it elsewhere."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.materials import paths_per_length
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.surfaces import SURFACES


@engine_effect(
    "subsurface",
    moves=("materials.subsurface", "materials.ir_subsurface_color", "materials.ir_subsurface_radius_m"),
    stage=Stage.SURFACE,
    family="surface",
    finding="Light spreads below surfaces",
    source="Jensen et al. 2001, A practical model for subsurface light transport: millimetres in skin, wax, marble, "
           "foam",
    parameters=[
        Parameter(
            "fraction", "1", neutral=0.0, low=0.0, high=1.0, typical=0.4, source="share of the light that enters"
        ),
        Parameter(
            "length_m", "m", neutral=0.003, low=0.0002, high=0.03, typical=0.002,
            source="rms distance along one axis; without effect at fraction 0",
        ),
        Parameter(
            "core", "1", neutral=1.0, low=0.0, high=1.0, typical=1.0, in_engine=False,
            source="share of the profile with a bright core, the engine's own; 0: exp(-distance / width), of media "
            "that scatter forward",
        ),
        SURFACES,
    ],
)  # fmt: skip
def subsurface(inputs: EngineInputs, fraction: float, length_m: float, core: float, surfaces: float) -> None:
    """Dots keep a core and grow wide tails of one width in metres on the surface; near ones look wider; ambient edges
    stay sharp."""
    inputs.unrendered["core"] = core  # the engine scatters evenly to all sides, which is the profile with a core
    for material in inputs.surfaces(surfaces):
        albedo = material.base_color[0] if material.ir_albedo is None else material.ir_albedo
        material.subsurface = fraction
        material.ir_subsurface_color = albedo
        material.ir_subsurface_radius_m = length_m * paths_per_length(albedo)
