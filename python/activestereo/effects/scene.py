# SPDX-License-Identifier: Apache-2.0
"""Effects of air and surfaces."""

from dataclasses import replace

import numpy as np

import kuafu
from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.light import Light
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.shading import IOR, fresnel, paths_per_length
from activestereo.effects.core.surfaces import SURFACES
from activestereo.effects.core.view import View

# Henyey and Greenstein's phase function always scatters some light back, so g is limited.
_MOST_FORWARD = 0.98


def _phase_g(backscatter: float) -> float:
    """Returns the g of Henyey and Greenstein's phase function that sends `backscatter` times the isotropic share
    straight back: (1 - g) / (1 + g)^2."""
    if backscatter == 0.0:
        return _MOST_FORWARD
    root = np.sqrt(8.0 * backscatter + 1.0)
    return float(np.clip((root - 2.0 * backscatter - 1.0) / (2.0 * backscatter), -_MOST_FORWARD, _MOST_FORWARD))


@engine_effect(
    stage=Stage.MEDIUM, family="medium", moves=("medium",),
    finding="The air in front of the camera is hazy",
    source="Koschmieder 1924; single scattering of uniform ambient light and of the projector's own beam",
    parameters=[
        Parameter("extinction_per_m", "1/m", high=3.0, typical=0.1),
        Parameter("backscatter", "1", neutral=1.0, high=3.0, typical=0.5,
                  source="scattering back to the rig over isotropic: fine smoke 1, fog 0.1-0.5 (Henyey and Greenstein "
                         "1941)"),
        Parameter("housing_m", "m", neutral=0.05, low=0.01, high=0.3, typical=0.03,
                  source="window and housing of the camera keep the air out so far, where the beam is brightest"),
    ],
)  # fmt: skip
def haze(inputs: EngineInputs, extinction_per_m: float, backscatter: float, housing_m: float) -> None:
    """Light is attenuated by exp(-extinction x distance). The air scatters ambient light and the projector's beam into
    the camera."""
    if extinction_per_m > 0.0:
        lower, upper = inputs.bounds_m
        inputs.medium = kuafu.Medium(
            extinction_per_m=(extinction_per_m,) * 3,
            albedo=(1.0,) * 3,
            phase_g=_phase_g(backscatter),
            bounds_min_m=lower,
            bounds_max_m=upper,
            housing_m=housing_m,
        )


@effect(
    stage=Stage.SURFACE, family="surface",
    finding="Surfaces light each other by another amount than the scene file says",
    source="radiosity: bounced light goes with the product of two albedos (Goral et al. 1984)",
    image_only="kuafu computes bounced light from the albedos alone",
    parameters=[Parameter("gain", "1", low=-1.0, high=3.0, typical=0.3, source="-1 = a model of single reflections")],
)  # fmt: skip
def interreflection(light: Light, view: View, gain: float) -> Light:
    """Other surfaces reflect 1 + gain times the rendered amount of light. This light is smooth and strongest in
    corners. Ambient light is included where its indirect share is known."""
    changed = replace(light, indirect=light.indirect * (1.0 + gain))
    if view.ambient_bounced is None:
        return changed
    return replace(changed, ambient=light.ambient * (1.0 + gain * view.ambient_bounced))


@engine_effect(
    stage=Stage.SURFACE, family="surface", moves=("materials.specular", "materials.ir_roughness", "materials.ir_ior"),
    finding="Surfaces are glossier than the scene file says",
    source="glTF 2.0 material model with KHR_materials_specular; GGX of Walter et al. 2007, Microfacet models for "
           "refraction",
    parameters=[
        Parameter("factor", "1", high=20.0, typical=0.5,
                  source="reflectance over common plastic's 0.04: up to 1 specularFactor on top of the nominal one, "
                         "beyond by a higher ior"),
        Parameter("roughness", "1", neutral=0.5, low=0.1, high=1.0, typical=0.2, source="without effect at factor 0"),
        SURFACES,
    ],
)  # fmt: skip
def specular(inputs: EngineInputs, factor: float, roughness: float, surfaces: float) -> None:
    """Surfaces mirror the projector's dots in a highlight and the surroundings in a sheen, on top of their diffuse
    light."""
    # Up to 1 the factor is glTF's; beyond, a higher index of refraction reflects as much at normal incidence, as of
    # varnish over metal paint or of a metal.
    root = np.sqrt(factor * fresnel(1.0))
    share, ior = (factor, IOR) if factor <= 1.0 else (1.0, float((1.0 + root) / (1.0 - root)))
    for material in inputs.surfaces(surfaces):
        material.specular = min(1.0, material.specular + share)
        material.ir_roughness = roughness
        material.ir_ior = ior


@engine_effect(
    stage=Stage.SURFACE, family="surface",
    moves=("materials.subsurface", "materials.ir_subsurface_color", "materials.ir_subsurface_radius_m"),
    finding="Light spreads below surfaces",
    source="Jensen et al. 2001, A practical model for subsurface light transport: millimetres in skin, wax, marble, "
           "foam",
    parameters=[
        Parameter("fraction", "1", high=1.0, typical=0.4, source="share of the light that enters"),
        Parameter("length_m", "m", neutral=0.003, low=0.0002, high=0.03, typical=0.002,
                  source="rms distance along one axis; without effect at fraction 0"),
        Parameter("core", "1", neutral=1.0, high=1.0, typical=1.0, in_engine=False,
                  source="share of the profile with a bright core, the engine's own; 0: exp(-distance / width), of "
                         "media that scatter forward"),
        SURFACES,
    ],
)  # fmt: skip
def subsurface(inputs: EngineInputs, fraction: float, length_m: float, core: float, surfaces: float) -> None:
    """Dots keep a core and grow wide tails. The tails have one width in metres on the surface, so that near ones look
    wider. Ambient edges stay sharp."""
    inputs.unrendered["core"] = core  # the engine scatters evenly to all sides, which is the profile with a core
    for material in inputs.surfaces(surfaces):
        albedo = material.base_color[0] if material.ir_albedo is None else material.ir_albedo
        material.subsurface = fraction
        material.ir_subsurface_color = albedo
        material.ir_subsurface_radius_m = length_m * paths_per_length(albedo)


@engine_effect(
    stage=Stage.SURFACE, family="surface", moves=(
        "materials.ir_albedo", "materials.ir_transmission", "materials.ir_transmission_roughness",
        "materials.thin_walled",
    ),
    finding="Surfaces let light through",
    source="KHR_materials_transmission: a share of the light goes through instead of being scattered back",
    parameters=[
        Parameter("fraction", "1", high=1.0, typical=0.2),
        Parameter("behind", "1", neutral=0.5, high=1.0, typical=0.3, in_engine=None,
                  source="radiance of what lies behind over the ambient radiance"),
        SURFACES,
    ],
)  # fmt: skip
def transmission(inputs: EngineInputs, fraction: float, behind: float, surfaces: float) -> None:
    """Surfaces are panes that reflect less light and show clearly what lies behind them. It keeps its brightness,
    unless a texture gives the panes' albedo. The formula lets ambient light from behind pass, not dots."""
    inputs.unrendered["behind"] = behind
    for material in inputs.surfaces(surfaces):
        has_texture = material.ir_albedo_texture is not None or material.base_color_texture is not None
        material.ir_transmission = fraction
        if not has_texture:  # glTF multiplies both reflected and transmitted light by the albedo
            albedo = material.base_color[0] if material.ir_albedo is None else material.ir_albedo
            material.ir_albedo = (1.0 - fraction) * albedo + fraction
            material.ir_transmission = fraction / max(material.ir_albedo, 1e-6)
        material.ir_transmission_roughness = 0.0
        material.thin_walled = True
