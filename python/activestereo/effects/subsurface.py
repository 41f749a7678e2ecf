# SPDX-License-Identifier: Apache-2.0
"""Light that wanders below the surface."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import blur
from activestereo.effects.core.surfaces import SURFACES, on_surfaces
from activestereo.effects.core.view import View


def _mean_free_path_m(length_m: float, albedo: float) -> float:
    """Of a medium whose light leaves at an rms distance length_m along one axis. Christensen and Burley 2015
    (Approximate reflectance profiles for efficient subsurface scattering): the profile of two exponentials of width d =
    path / s has an rms distance of sqrt(7) d."""
    s = 1.9 - albedo + 3.5 * (albedo - 0.8) ** 2
    return length_m / np.sqrt(7.0) * s


# (weight, width in rms lengths) of Gaussians whose sum is the profile of two exponentials in _mean_free_path_m's
# source: the light within any radius agrees to 0.006.
_PROFILE = ((0.081, 0.032), (0.254, 0.193), (0.396, 0.643), (0.269, 1.751))

# A scan goes through lengths and comes back to them with another fraction.
_LENGTHS_KEPT = 3


@moves("materials.subsurface", "materials.ir_subsurface_color", "materials.ir_subsurface_radius_m")
def _engine(inputs: EngineInputs, fraction: float, length_m: float, surfaces: float) -> None:
    for material in inputs.surfaces(surfaces):
        albedo = material.base_color[0] if material.ir_albedo is None else material.ir_albedo
        material.subsurface = fraction
        material.ir_subsurface_color = albedo
        material.ir_subsurface_radius_m = _mean_free_path_m(length_m, albedo)


@effect(
    "subsurface",
    stage=Stage.SURFACE,
    family="surface",
    source="Jensen et al. 2001, A practical model for subsurface light transport: millimetres in skin, wax, marble, "
           "foam",
    parameters=[
        Parameter(
            "fraction", "1", neutral=0.0, low=0.0, high=1.0, typical=0.4, source="share of the light that enters"
        ),
        Parameter(
            "length_m",
            "m",
            neutral=0.003,
            low=0.0002,
            high=0.03,
            typical=0.002,
            source="rms distance along one axis; without effect at fraction 0",
        ),
        SURFACES,
    ],
    engine=_engine,
)
def subsurface(light: Light, view: View, fraction: float, length_m: float, surfaces: float) -> Light:
    """Dots keep a core and grow wide tails of one width in metres on the surface; near ones look wider; ambient edges
    stay sharp."""
    if fraction == 0.0:
        return light
    dots = view.latest(
        "dots below", light, lambda: _dots_below(light, view, length_m), choice=length_m, most=_LENGTHS_KEPT
    )
    return on_surfaces(
        light, replace(light, direct=(1.0 - fraction) * light.direct + fraction * light.flat * dots), view, surfaces
    )


def _dots_below(light: Light, view: View, length_m: float) -> np.ndarray:
    """The pattern's share of the light that leaves, [height][width]."""
    hit = view.depth_m > 0
    sigma_px = np.where(hit, view.K[0, 0] * length_m / np.where(hit, view.depth_m, 1.0), 0.0)
    entered = np.stack([light.direct, light.flat])
    spread, share = sum(
        (weight * blur(entered, width * sigma_px) for weight, width in _PROFILE), np.zeros(entered.shape, entered.dtype)
    )
    # What spreads is the dots' irradiance: reflectance and shadows stay where they are.
    return np.where(share > 0, spread / np.where(share > 0, share, 1.0), 0.0)
