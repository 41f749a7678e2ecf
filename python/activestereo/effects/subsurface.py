# SPDX-License-Identifier: Apache-2.0
"""Simulates light that scatters below the surface and leaves it elsewhere."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import BlurAlong
from activestereo.effects.core.surfaces import SURFACES, on_surfaces
from activestereo.effects.core.view import View


def _mean_free_path_m(length_m: float, albedo: float) -> float:
    """Returns the mean free path of a medium whose light leaves at an rms distance length_m along one axis. Christensen
    and Burley 2015 (Approximate reflectance profiles for efficient subsurface scattering): the profile of two
    exponentials of width d = path / s has an rms distance of sqrt(7) d."""
    s = 1.9 - albedo + 3.5 * (albedo - 0.8) ** 2
    return length_m / np.sqrt(7.0) * s


# (weight, width in rms lengths) of Gaussians whose sum is a profile: the light within any radius agrees to 0.006.
# This profile is two exponentials over the distance, as in _mean_free_path_m's source. Light that leaves after few
# scatterings makes a bright core where it enters.
_WITH_CORE = ((0.081, 0.032), (0.254, 0.193), (0.396, 0.643), (0.269, 1.751))
# This profile is exp(-distance / width), whose rms distance is sqrt(3) widths. A medium that scatters forward turns
# light around only deep inside (Jensen et al. 2001: the diffuse part has no core either).
_WITHOUT_CORE = ((0.118, 0.308), (0.525, 0.735), (0.357, 1.389))

# A pixel with less than this share of the brightest pixel's light lies in shadow.
_LEAST_LIT = 1e-3
# The number of blurred images that are kept: a scan returns to a length and profile with another fraction.
_PROFILES_KEPT = 4


@moves("materials.subsurface", "materials.ir_subsurface_color", "materials.ir_subsurface_radius_m")
def _engine(inputs: EngineInputs, fraction: float, length_m: float, core: float, surfaces: float) -> None:
    """Gives the materials of `surfaces` subsurface scattering. The engine scatters evenly to all sides, which is the
    profile with a core, so it ignores `core`."""
    for material in inputs.surfaces(surfaces):
        albedo = material.base_color[0] if material.ir_albedo is None else material.ir_albedo
        material.subsurface = fraction
        material.ir_subsurface_color = albedo
        material.ir_subsurface_radius_m = _mean_free_path_m(length_m, albedo)


@effect(
    "subsurface",
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
    engine=_engine,
)  # fmt: skip
def subsurface(light: Light, view: View, fraction: float, length_m: float, core: float, surfaces: float) -> Light:
    """Dots keep a core and grow wide tails of one width in metres on the surface; near ones look wider; ambient edges
    stay sharp."""
    if fraction == 0.0:
        return light
    spread, share = (
        core * peaked + (1.0 - core) * smooth
        for peaked, smooth in zip(
            _wandered(light, view, length_m, _WITH_CORE, core > 0.0),
            _wandered(light, view, length_m, _WITHOUT_CORE, core < 1.0),
            strict=True,
        )
    )
    # The dots' irradiance spreads; reflectance and shadows stay where they are.
    dots = np.where(share > 0, spread / np.where(share > 0, share, 1.0), 0.0)
    return on_surfaces(
        light, replace(light, direct=(1.0 - fraction) * light.direct + fraction * light.flat * dots), view, surfaces
    )


def _wandered(
    light: Light, view: View, length_m: float, profile: tuple[tuple[float, float], ...], is_wanted: bool
) -> np.ndarray:
    """Returns two images [2][height][width] after light spread below the surface. The first is the pattern's share of
    the irradiance; the second is the share of such light that came from lit pixels. Both are 0 if not is_wanted.
    Neighbours count alike, whatever they reflect."""
    if not is_wanted:
        return np.zeros((2, *view.shape), light.direct.dtype)

    def spread() -> np.ndarray:
        across, down = view.once("blurs below", lambda: tuple(map(BlurAlong, _pixels_per_m(view), (-1, -2))))
        lit = light.flat > _LEAST_LIT * light.flat.max()
        entered = np.stack([np.where(lit, light.direct / np.where(lit, light.flat, 1.0), 0.0), lit]).astype(np.float32)
        blurred = (down(across(entered, width * length_m), width * length_m) for _, width in profile)
        return np.sum([weight * image for (weight, _), image in zip(profile, blurred, strict=True)], axis=0)

    choice = length_m, profile is _WITH_CORE
    return view.latest("light below", light, spread, choice=choice, most=_PROFILES_KEPT)


def _pixels_per_m(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Returns pixels per metre on the surface along image columns and along rows, [height][width] each. Both are rms
    values and foreshortened on slanted surfaces. Where nothing is hit, the farthest depth counts. Surfaces turned about
    both axes move columns and rows together, which is left out."""
    hit, (x, y) = view.depth_m > 0, view.rays()
    along_x, along_y, along_z = np.moveaxis(view.normal, -1, 0)
    seen = (1.0 + ray**2 - (along - ray * along_z) ** 2 for ray, along in ((x, along_x), (y, along_y)))
    scale = 1.0 / np.where(hit, view.depth_m, view.depth_m.max() if hit.any() else 1.0)
    across, down = (k * scale * np.sqrt(np.maximum(s, 0.0)) for k, s in zip(np.diag(view.K)[:2], seen, strict=True))
    return across, down
