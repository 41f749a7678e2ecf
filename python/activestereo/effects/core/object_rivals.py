# SPDX-License-Identifier: Apache-2.0
"""Rivals of the library's names for one object: what its surface may be instead of what an effect says of it.

They are no names of a sensor's faults: an albedo is a nuisance of every fit, and a metal is what a scene file has a
word for.
"""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Effect, Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.ggx import highlight
from activestereo.effects.core.light import Light
from activestereo.effects.core.shading import Shading
from activestereo.effects.core.surfaces import SURFACES, on_surfaces
from activestereo.effects.core.view import View

# A mirror's index of refraction would be infinite; a dielectric's lobe of this one is scaled to the metal's.
_MIRROR_IOR = 100.0


@moves("materials.ir_albedo")
def _reflecting(inputs: EngineInputs, change: float, surfaces: float) -> None:
    for material in inputs.surfaces(surfaces):
        own = material.base_color[0] if material.ir_albedo is None else material.ir_albedo
        material.ir_albedo = min(1.0, (1.0 + change) * own)


@effect(
    "albedo",
    stage=Stage.SURFACE,
    family="surface",
    finding="Surfaces reflect another share of the light than the scene file says",
    source="Lambert 1760, Photometria",
    parameters=[
        Parameter("change", "1", neutral=0.0, low=-0.95, high=4.0, typical=0.2, source="relative"),
        SURFACES,
    ],
    engine=_reflecting,
)
def albedo(light: Light, view: View, change: float, surfaces: float) -> Light:
    """Surfaces reflect more or less of all light."""
    return on_surfaces(light, light.map(lambda images: (1.0 + change) * images), view, surfaces)


@moves("materials.metallic", "materials.ir_roughness")
def _metallic(inputs: EngineInputs, fraction: float, roughness: float, surfaces: float) -> None:
    for material in inputs.surfaces(surfaces):
        material.metallic = fraction
        material.ir_roughness = roughness


@effect(
    "metal",
    stage=Stage.SURFACE,
    family="surface",
    finding="Surfaces are of metal",
    source="glTF 2.0 metallic-roughness model; GGX of Walter et al. 2007",
    parameters=[
        Parameter("fraction", "1", neutral=0.0, low=0.0, high=1.0, typical=0.5),
        Parameter("roughness", "1", neutral=0.5, low=0.1, high=1.0, typical=0.2, source="without effect at fraction 0"),
        SURFACES,
    ],
    engine=_metallic,
)
def metal(light: Light, view: View, fraction: float, roughness: float, surfaces: float) -> Light:
    """Surfaces mirror the share of the light that they would spread: the dots show in a highlight alone."""
    if fraction == 0.0:
        return light
    shading, lit = Shading.of(light, view), light.flat > 0
    mirrored = np.pi * shading.reflectance * highlight(shading.lobe(), roughness, _MIRROR_IOR) * shading.irradiance
    flat = (1.0 - fraction) * light.flat + fraction * np.where(lit, mirrored, 0.0)
    dots = light.direct / np.where(lit, light.flat, 1.0)
    changed = replace(light, direct=np.where(lit, dots * flat, (1.0 - fraction) * light.direct), flat=flat)
    return on_surfaces(light, changed, view, surfaces)


RIVALS: tuple[Effect, ...] = (albedo, metal)
