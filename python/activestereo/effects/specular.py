# SPDX-License-Identifier: Apache-2.0
"""Simulates a gloss that the nominal materials lack."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.shading import IOR, Shading, base_share, fresnel, highlight, ior_of, reflected_share
from activestereo.effects.core.surfaces import SURFACES, on_surfaces
from activestereo.effects.core.view import View


def _layer(factor: float) -> tuple[float, float]:
    """Returns (specularFactor, ior) of a layer that reflects `factor` times as much as common plastic. Up to 1 it is
    glTF's factor; beyond, a higher index of refraction, as of varnish over metal paint or of a metal."""
    return (factor, IOR) if factor <= 1.0 else (1.0, ior_of(factor * float(fresnel(1.0))))


@moves("materials.specular", "materials.ir_roughness", "materials.ir_ior")
def _engine(inputs: EngineInputs, factor: float, roughness: float, surfaces: float) -> None:
    share, ior = _layer(factor)
    for material in inputs.surfaces(surfaces):
        material.specular = min(1.0, material.specular + share)
        material.ir_roughness = roughness
        material.ir_ior = ior


@effect(
    "specular",
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
    engine=_engine,
)  # fmt: skip
def specular(light: Light, view: View, factor: float, roughness: float, surfaces: float) -> Light:
    """Surfaces mirror the projector's dots in a highlight and the surroundings in a sheen, on top of their diffuse
    light."""
    if factor == 0.0:
        return light
    shading, (share, ior) = Shading.of(light, view), _layer(factor)
    lobe = highlight(shading.lobe(), roughness, ior)
    lit = light.flat > 0
    cosines = np.maximum(shading.camera_cosine, 1e-3), np.maximum(shading.projector_cosine, 1e-3)
    flat = light.flat * base_share(*cosines, roughness, share, ior) + np.where(
        lit, share * lobe * shading.irradiance, 0.0
    )
    dots = light.direct / np.where(lit, light.flat, 1.0)
    sheen = share * np.where(shading.hit, reflected_share(cosines[0], roughness, ior), 0.0)
    white = np.pi * shading.reflectance
    # The share of the surroundings that a surface sees: its ambient light over that of an open surface of its albedo.
    open_share = np.clip(light.ambient / np.where(white > 0, white, np.inf), 0.0, 1.0)
    ambient = light.ambient * (1.0 - sheen) + sheen * open_share
    return on_surfaces(
        light,
        replace(light, direct=np.where(lit, dots * flat, light.direct), flat=flat, ambient=ambient),
        view,
        surfaces,
    )
