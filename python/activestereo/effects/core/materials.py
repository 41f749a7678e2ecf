# SPDX-License-Identifier: Apache-2.0
"""Computes the light of surfaces whose material changed, without a render: gloss, light that scatters below the
surface, light that goes through."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import BlurAlong
from activestereo.effects.core.shading import Shading, base_share, highlight, reflected_share
from activestereo.effects.core.view import View

if TYPE_CHECKING:
    import kuafu

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


def paths_per_length(albedo: float) -> float:
    """Returns the mean free path of a medium over the rms distance, along one axis, at which its light leaves.
    Christensen and Burley 2015 (Approximate reflectance profiles for efficient subsurface scattering): the profile of
    two exponentials of width d = path / s has an rms distance of sqrt(7) d."""
    return (1.9 - albedo + 3.5 * (albedo - 0.8) ** 2) / float(np.sqrt(7.0))


def reflected(light: Light, view: View, material: kuafu.Material, unrendered: dict[str, float]) -> Light:
    """Returns the light as if all surfaces had this material's gloss, scattering and transparency, but their own
    diffuse colour. unrendered: see EngineInputs."""
    if material.specular:
        light = _glossy(light, view, material)
    if material.subsurface:
        light = _scattered_below(light, view, material, unrendered["core"])
    if material.ir_transmission:
        through = np.where(view.depth_m > 0, material.ir_transmission, 0.0)
        seen = light.images * (1.0 - through)
        seen[2] += through * unrendered["behind"]
        light = Light.of_images(seen, light.supersampled)
    return light


def _glossy(light: Light, view: View, material: kuafu.Material) -> Light:
    """Returns the light with a highlight of the projector's dots and a sheen of the surroundings."""
    shading, share = Shading.of(light, view), material.specular
    assert material.ir_roughness is not None and material.ir_ior is not None  # the effect has set them
    layer = material.ir_roughness, material.ir_ior
    lit = light.flat > 0
    cosines = np.maximum(shading.camera_cosine, 1e-3), np.maximum(shading.projector_cosine, 1e-3)
    flat = light.flat * base_share(*cosines, layer[0], share, layer[1]) + np.where(
        lit, share * highlight(shading.lobe(), *layer) * shading.irradiance, 0.0
    )
    dots = light.direct / np.where(lit, light.flat, 1.0)
    sheen = share * np.where(shading.hit, reflected_share(cosines[0], *layer), 0.0)
    white = np.pi * shading.reflectance
    # The share of the surroundings that a surface sees: its ambient light over that of an open surface of its albedo.
    open_share = np.clip(light.ambient / np.where(white > 0, white, np.inf), 0.0, 1.0)
    ambient = light.ambient * (1.0 - sheen) + sheen * open_share
    return replace(light, direct=np.where(lit, dots * flat, light.direct), flat=flat, ambient=ambient)


def _scattered_below(light: Light, view: View, material: kuafu.Material, core: float) -> Light:
    """Returns the light after a share of the dots' light spread below the surface (subsurface scattering). The
    surfaces' reflectance and shadows stay. core: weight 0..1 of the spread profile that has a bright core; the other
    has none."""
    fraction = material.subsurface
    assert material.ir_subsurface_radius_m is not None and material.ir_subsurface_color is not None
    length_m = material.ir_subsurface_radius_m / paths_per_length(material.ir_subsurface_color)
    spread, share = (
        core * peaked + (1.0 - core) * smooth
        for peaked, smooth in zip(
            _wandered(light, view, length_m, _WITH_CORE, core > 0.0),
            _wandered(light, view, length_m, _WITHOUT_CORE, core < 1.0),
            strict=True,
        )
    )
    dots = np.where(share > 0, spread / np.where(share > 0, share, 1.0), 0.0)
    return replace(light, direct=(1.0 - fraction) * light.direct + fraction * light.flat * dots)


def _wandered(
    light: Light, view: View, length_m: float, profile: tuple[tuple[float, float], ...], is_wanted: bool
) -> np.ndarray:
    """Returns two images [2][height][width], blurred as light spreads below the surface: the pattern's value in lit
    pixels, and the mask of lit pixels. Their ratio is the spread pattern. profile: pairs (weight, width in length_m) of
    Gaussians. is_wanted: if false, both are 0."""
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
