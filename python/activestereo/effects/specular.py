# SPDX-License-Identifier: Apache-2.0
"""Simulates a gloss that the nominal materials lack."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.shading import IOR, fresnel, ior_of
from activestereo.effects.core.surfaces import SURFACES


@engine_effect(
    "specular",
    moves=("materials.specular", "materials.ir_roughness", "materials.ir_ior"),
    stage=Stage.SURFACE,
    family="surface",
    finding="Surfaces are glossier than the scene file says",
    source="glTF 2.0 material model with KHR_materials_specular; GGX of Walter et al. 2007, Microfacet models for "
    "refraction",
    parameters=[
        Parameter(
            "factor", "1", neutral=0.0, low=0.0, high=20.0, typical=0.5,
            source="reflectance over common plastic's 0.04: up to 1 specularFactor on top of the nominal one, beyond "
            "by a higher ior",
        ),
        Parameter("roughness", "1", neutral=0.5, low=0.1, high=1.0, typical=0.2, source="without effect at factor 0"),
        SURFACES,
    ],  # fmt: skip
)  # fmt: skip
def specular(inputs: EngineInputs, factor: float, roughness: float, surfaces: float) -> None:
    """Surfaces mirror the projector's dots in a highlight and the surroundings in a sheen, on top of their diffuse
    light."""
    # Up to 1 the factor is glTF's; beyond, a higher index of refraction, as of varnish over metal paint or of a metal.
    share, ior = (factor, IOR) if factor <= 1.0 else (1.0, ior_of(factor * float(fresnel(1.0))))
    for material in inputs.surfaces(surfaces):
        material.specular = min(1.0, material.specular + share)
        material.ir_roughness = roughness
        material.ir_ior = ior
