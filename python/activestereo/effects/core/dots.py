# SPDX-License-Identifier: Apache-2.0
"""Computes the projector's light without tracing rays: its dots on the surfaces that a camera sees, and its glow in
air."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
from scipy.ndimage import map_coordinates

import kuafu
from activestereo.common.computed_once import computed_once
from activestereo.common.lens import to_pixels
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import Pattern, disc_sampler, smooth_pattern
from activestereo.effects.core.view import PickedView, View, transform

_SMALLEST_BOX = 1e-3
_LARGEST_BOX = 64.0


class DotView:
    """The projection of each camera pixel into the projector's pattern, arrays [height][width]. Pattern position (u, v)
    lights the pixel's surface point, whose depth from the projector is z (m). The camera pixel covers box_u x box_v
    pattern pixels. lit: mask of pixels with a surface before the projector."""

    @classmethod
    def of(cls, view: View) -> DotView:
        """Returns the DotView of a view, computed once per view."""
        return view.once(
            "dots", lambda: cls.of(view.whole)._pick_pixels(view) if isinstance(view, PickedView) else cls(view)
        )

    def __init__(self, view: View) -> None:
        self._view = view
        self.pattern = Pattern(view.pattern)
        points = view.projector_points()
        self.z = points[..., 2]
        self.lit = (view.depth_m > 0) & (self.z > 0)
        self.u, self.v = self.project(points)
        self.box_u, self.box_v = self._footprint()

    def _pick_pixels(self, view: PickedView) -> DotView:
        """Returns the projector's dots as n selected pixels see them, arrays of [1][n]. Each pixel's footprint in the
        pattern is kept from the whole image."""
        some = copy(self)
        some.__dict__ = {"_view": view, "pattern": self.pattern}
        for name in ("z", "lit", "u", "v", "box_u", "box_v"):
            setattr(some, name, getattr(self, name).ravel()[view.pick][None])
        return some

    def project(self, projector_points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        K, z = self._view.projector_K, np.where(projector_points[..., 2] > 0, projector_points[..., 2], 1.0)
        return to_pixels(projector_points[..., 0] / z, projector_points[..., 1] / z, K)

    @computed_once
    def nominal(self) -> np.ndarray:
        """Returns the mean of the view's own pattern over each pixel's box, [height][width]."""
        return self.mean(self._view.pattern)

    def _known(self, pattern: np.ndarray) -> Pattern:
        return self.pattern if pattern is self._view.pattern else Pattern(pattern)

    def mean(self, pattern: np.ndarray, u: np.ndarray | None = None, v: np.ndarray | None = None) -> np.ndarray:
        """Returns [height][width]: the mean of a pattern image over each camera pixel's box. u, v: the boxes' centres
        in pattern pixels; None = the view's own."""
        sampler = disc_sampler(self._known(pattern), 0.0)
        return sampler(self.u if u is None else u, self.v if v is None else v, self.box_u, self.box_v)

    def mean_of_discs(self, pattern: np.ndarray, diameter_px: np.ndarray) -> np.ndarray:
        """Returns [height][width]: the mean, over each camera pixel's box, of the pattern blurred by a disc.
        diameter_px: the disc's diameter for each camera pixel, [height][width], in pattern pixels; interpolated between
        whole diameters."""
        known, lit = self._known(pattern), np.flatnonzero(self.lit)
        low = np.floor(diameter_px.ravel()[lit]).astype(int)
        order = lit[np.argsort(low, kind="stable")]
        low, share = np.sort(low), (diameter_px % 1.0).ravel()[order]
        at = [image.ravel()[order] for image in (self.u, self.v, self.box_u, self.box_v)]
        means = np.zeros(len(order))
        for level in np.unique(np.concatenate([low, low + 1])):
            first, middle, last = np.searchsorted(low, (level - 1, level, level + 1))
            here = slice(first, last)  # pixels with a diameter below this level, then those above
            weight = np.concatenate([share[first:middle], 1.0 - share[middle:last]])
            means[here] += weight * disc_sampler(known, float(level))(*(image[here] for image in at))
        out = np.zeros(self.u.shape)
        out.ravel()[order] = means
        return out

    def change(self, light: Light, after: np.ndarray) -> Light:
        """Returns the light after the view's own pattern changed. after: means of the new pattern over each pixel's
        box, [height][width]. Only the difference is added to the direct light; bounced light stays."""
        change = np.where(self.lit, light.flat * (after - self.nominal()), 0.0)
        return replace(light, direct=np.maximum(light.direct + change, 0.0))

    def _footprint(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (box_u, box_v), each [height][width] in pattern pixels. box_u is the step of u to the left or right
        neighbour; the smaller one counts, since edges of objects must not open huge boxes. box_v is the ratio of focal
        lengths."""
        K, view = self._view.projector_K, self._view
        ratio_u, ratio_v = K[0, 0] / view.K[0, 0], K[1, 1] / view.K[1, 1]
        # Along epipolar lines the step depends on the surface's slant. It is the smaller of both one-sided differences.
        step = np.diff(self.u, axis=1)
        step = np.minimum(
            np.abs(np.pad(step, ((0, 0), (1, 0)), "edge")), np.abs(np.pad(step, ((0, 0), (0, 1)), "edge"))
        )
        box_u = np.clip(np.where(step > 0, step, ratio_u), 0.25 * ratio_u, 4 * ratio_u)
        box_v = np.full(self.v.shape, ratio_v)
        return np.clip(box_u, _SMALLEST_BOX, _LARGEST_BOX), np.clip(box_v, _SMALLEST_BOX, _LARGEST_BOX)


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
    # A scan varies the extinction; the samples along the rays stay the same.
    rays = view.latest("beam", None, lambda: _along_rays(view, from_m), choice=from_m, most=2)
    rows, columns, intensity, way, factor = rays
    coarse = (intensity * np.exp(-extinction_per_m * way)).mean(axis=0) * factor
    places = (np.interp(np.arange(n), x, np.arange(len(x))) for n, x in zip(view.shape, (rows, columns), strict=True))
    return map_coordinates(coarse, np.meshgrid(*places, indexing="ij"), order=1)


def _along_rays(view: View, from_m: float) -> tuple[np.ndarray, ...]:
    """Returns (rows, columns, intensity, path, factor) of samples along the rays of a coarse grid of pixels. intensity,
    path: [samples][rows][columns]. The path, in metres, leads from the projector to the sample and back along the ray
    to from_m. A ray's integral is its factor [rows][columns] times the mean of its samples."""
    rows, columns = (np.append(np.arange(0, n - 1, _STEP_PX), n - 1) for n in view.shape)
    x, y = (image[np.ix_(rows, columns)] for image in view.rays())
    ray = np.stack([x, y, np.ones(x.shape)], axis=-1)
    length = np.linalg.norm(ray, axis=-1)
    ray /= length[..., None]
    depth = view.depth_m[np.ix_(rows, columns)]
    end = np.where(depth > 0, depth * length, _FAR_M)
    # The ray's point nearest to the projector, and the projector's distance from it.
    source = np.linalg.inv(view.camera_to_projector)[:3, 3]
    foot = ray @ source
    aside = np.maximum(np.linalg.norm(source - foot[..., None] * ray, axis=-1), _LEAST_ASIDE_M)
    first, last = np.arctan((from_m - foot) / aside), np.arctan((end - foot) / aside)
    share = ((np.arange(_PLACES) + 0.5) / _PLACES)[:, None, None]
    along = foot + aside * np.tan(first + share * (last - first))
    way = along - from_m + np.hypot(along - foot, aside)
    factor = np.maximum(last - first, 0.0) / (4.0 * np.pi * aside)
    # The projector's relative intensity, smoothed over neighbouring dots; 0 beside and behind the projector.
    dots, points = DotView.of(view), transform(view.camera_to_projector, along[..., None] * ray)
    u, v = dots.project(points)
    seen = map_coordinates(smooth_pattern(dots.pattern, _DOTS_PX), [v, u], order=1, mode="constant")
    return rows, columns, np.where(points[..., 2] > 0, seen, 0.0), way, factor
