"""A gloss that the nominal materials lack."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.ggx import base_share, highlight, reflected_share
from activestereo.effects.core.light import Light
from activestereo.effects.core.shading import Shading
from activestereo.effects.core.surfaces import SURFACES, on_surfaces
from activestereo.effects.core.view import View


@moves("materials.specular", "materials.ir_roughness")
def _engine(inputs: EngineInputs, factor: float, roughness: float, surfaces: float) -> None:
    for material in inputs.surfaces(surfaces):
        material.specular = min(1.0, material.specular + factor)
        material.ir_roughness = roughness


@effect(
    "specular",
    stage=Stage.SURFACE,
    family="surface",
    source="glTF 2.0 material model with KHR_materials_specular; GGX of Walter et al. 2007, Microfacet models for refraction",
    parameters=[
        Parameter("factor", "1", neutral=0.0, low=0.0, high=1.0, typical=0.5, source="specularFactor on top of the nominal one; 1 = common plastic"),
        Parameter("roughness", "1", neutral=0.5, low=0.1, high=1.0, typical=0.2, source="without effect at factor 0"),
        SURFACES,
    ],  # fmt: skip
    engine=_engine,
)
def specular(light: Light, view: View, factor: float, roughness: float, surfaces: float) -> Light:
    """Surfaces mirror the projector's dots in a highlight and the surroundings in a sheen, on top of their diffuse light."""
    if factor == 0.0:
        return light
    shading = Shading(light, view)
    lobe = highlight(shading.normal, shading.to_projector, shading.to_camera, roughness)
    lit = light.flat > 0
    cosines = np.maximum(shading.camera_cosine, 1e-3), np.maximum(shading.projector_cosine, 1e-3)
    flat = light.flat * base_share(*cosines, roughness, factor) + np.where(lit, factor * lobe * shading.irradiance, 0.0)
    dots = light.direct / np.where(lit, light.flat, 1.0)
    sheen = factor * np.where(shading.hit, reflected_share(cosines[0], roughness), 0.0)
    white = np.pi * shading.reflectance
    # What part of the sky a surface sees: its ambient light over that of an open surface of its albedo.
    open_share = np.clip(light.ambient / np.where(white > 0, white, np.inf), 0.0, 1.0)
    ambient = light.ambient * (1.0 - sheen) + sheen * open_share
    return on_surfaces(light, replace(light, direct=np.where(lit, dots * flat, light.direct), flat=flat, ambient=ambient), view, surfaces)
