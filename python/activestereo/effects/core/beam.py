# SPDX-License-Identifier: Apache-2.0
"""Computes the light that a medium between rig and scene takes away, and that it scatters once towards the camera."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import map_coordinates

from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import Pattern, smooth_pattern
from activestereo.effects.core.view import View, transform

if TYPE_CHECKING:
    import kuafu

# The beam's glow is smooth, so rays through every fourth pixel are enough, with this many samples along each.
_STEP_PX, _PLACES = 4, 24
# A Gaussian averages the dots that a ray crosses between two samples.
_DOTS_PX = 8.0
# A ray that hits nothing ends at the first distance; the second is the least distance of the projector from a ray.
_FAR_M, _LEAST_ASIDE_M = 10.0, 1e-3


def through_medium(light: Light, view: View, medium: kuafu.Medium) -> Light:
    """Returns the light that reaches the camera through a fog that scatters but does not absorb. It fills all space
    from the camera's housing on."""
    extinction_per_m, g, housing_m = medium.extinction_per_m[0], medium.phase_g, medium.housing_m
    from_camera, to_projector = view.once(
        "ways through air", lambda: tuple(np.linalg.norm(p, axis=-1) for p in (view.points(), view.projector_points()))
    )
    to_camera = np.maximum(from_camera - housing_m, 0.0)
    hit = view.depth_m > 0
    seen = np.where(hit, np.exp(-extinction_per_m * to_camera), 0.0)
    dots = np.where(hit, np.exp(-extinction_per_m * (to_camera + to_projector)), 1.0)
    ambient = np.where(hit, light.ambient * seen + (1.0 - seen), light.ambient)
    faded = replace(light.scale_projector(dots), ambient=ambient)
    # Henyey and Greenstein's phase function straight back, over isotropic scattering.
    backscatter = (1.0 - g) / (1.0 + g) ** 2
    beam = backscatter * extinction_per_m * glow(view, extinction_per_m, housing_m)
    return replace(faded, indirect=faded.indirect + beam)


def glow(view: View, extinction_per_m: float, from_m: float) -> np.ndarray:
    """Returns radiance [height][width] that isotropic single scattering of the projector's beam adds to each pixel. It
    is per scattering coefficient (1/m), at projector power 1. Each ray is integrated from from_m metres to the surface
    that it hits. Shadows in the medium are left out.

    Samples along a ray are evenly spaced in the angle at the projector, which takes 1 / distance^2 out of the integral
    (Kulla and Fajardo 2012, Importance sampling techniques for path tracing in participating media)."""
    rows, columns, *_ = view.once("coarse rays", lambda: _coarse_rays(view))
    # A scan varies the extinction; the samples along the rays stay the same.
    intensity, way, factor = view.latest("beam", None, lambda: _along_rays(view, from_m), choice=from_m, most=2)
    coarse = (intensity * np.exp(-extinction_per_m * way)).mean(axis=0) * factor
    for axis, kept in enumerate((rows, columns)):
        place = np.interp(np.arange(view.shape[axis]), kept, np.arange(len(kept)))
        before = np.minimum(place.astype(int), len(kept) - 2)
        share = np.expand_dims(place - before, 1 - axis)
        coarse = (1.0 - share) * coarse.take(before, axis) + share * coarse.take(before + 1, axis)
    return coarse


def _along_rays(view: View, from_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns intensity and path, each [samples][rows][columns], at samples along the coarse rays. The path leads from
    the projector to the sample and on to the ray's start at from_m, in metres. Then comes a factor [rows][columns]: a
    ray's integral is the factor times its samples' mean."""
    _, _, ray, end, foot, aside = view.once("coarse rays", lambda: _coarse_rays(view))
    first, last = np.arctan((from_m - foot) / aside), np.arctan((end - foot) / aside)
    share = ((np.arange(_PLACES) + 0.5) / _PLACES)[:, None, None]
    along = foot + aside * np.tan(first + share * (last - first))
    way = along - from_m + np.hypot(along - foot, aside)
    return _intensity(view, along[..., None] * ray), way, np.maximum(last - first, 0.0) / (4.0 * np.pi * aside)


def _coarse_rays(view: View) -> tuple[np.ndarray, ...]:
    """Returns the rows and columns of a coarse grid of pixels. Then, for each pixel's ray: the unit direction, the
    distance to the surface, the distance to the ray's point nearest to the projector, and the projector's distance from
    that point. Distances are in metres."""
    rows, columns = (np.append(np.arange(0, n - 1, _STEP_PX), n - 1) for n in view.shape)
    x, y = (image[np.ix_(rows, columns)] for image in view.rays())
    ray = np.stack([x, y, np.ones(x.shape)], axis=-1)
    length = np.linalg.norm(ray, axis=-1)
    ray /= length[..., None]
    depth = view.depth_m[np.ix_(rows, columns)]
    source = np.linalg.inv(view.camera_to_projector)[:3, 3]
    foot = ray @ source
    aside = np.maximum(np.linalg.norm(source - foot[..., None] * ray, axis=-1), _LEAST_ASIDE_M)
    return rows, columns, ray, np.where(depth > 0, depth * length, _FAR_M), foot, aside


def _intensity(view: View, points: np.ndarray) -> np.ndarray:
    """Returns the projector's relative intensity towards points [..., 3] in the camera's frame, smoothed over
    neighbouring dots. It is 0 beside and behind the projector."""
    x, y, z = np.moveaxis(transform(view.camera_to_projector, points), -1, 0)
    K, ahead = view.projector_K, np.where(z > 1e-6, z, 1.0)
    u, v = (K[0, 0] * x + K[0, 1] * y) / ahead + K[0, 2], K[1, 1] * y / ahead + K[1, 2]
    smooth = smooth_pattern(view.once("pattern", lambda: Pattern(view.pattern)), _DOTS_PX)
    return np.where(z > 1e-6, map_coordinates(smooth, [v, u], order=1, mode="constant"), 0.0)
