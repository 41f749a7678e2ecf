# SPDX-License-Identifier: Apache-2.0
"""Samples the projector's pattern as the camera's pixels see it, so that effects move, blur or dim dots without new
rays."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from activestereo.common.computed_once import computed_once
from activestereo.common.lens import to_pixels
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import Pattern, disc_sampler
from activestereo.effects.core.view import PickedView, View

_SMALLEST_BOX = 1e-3
_LARGEST_BOX = 64.0


class DotView:
    """The projection of each camera pixel into the projector's pattern. Pixel (u, v) of the pattern lights the pixel's
    surface point; box_u x box_v pattern pixels cover the camera pixel. All are [height][width]."""

    @classmethod
    def of(cls, view: View) -> DotView:
        """Returns the DotView of a view, computed once per view."""
        return view.once(
            "dots", lambda: cls.of(view.source)._pick_pixels(view) if isinstance(view, PickedView) else cls(view)
        )

    def __init__(self, view: View) -> None:
        self._view = view
        self._pattern = Pattern(view.pattern)
        points = view.projector_points()
        self.z = points[..., 2]
        self.lit = (view.depth_m > 0) & (self.z > 0)
        self.u, self.v = self.project(points)
        self.box_u, self.box_v = self._footprint()

    def _pick_pixels(self, view: PickedView) -> DotView:
        """Returns the projector's dots as n selected pixels see them, arrays of [1][n]. Each pixel's footprint in the
        pattern is kept from the whole image."""
        some = copy(self)
        some.__dict__ = {"_view": view, "_pattern": self._pattern}
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
        return self._pattern if pattern is self._view.pattern else Pattern(pattern)

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

    def change(self, light: Light, before: np.ndarray, after: np.ndarray) -> Light:
        """Returns the light after the pattern changed. before, after: means of both patterns over each pixel's box,
        [height][width]. Only their difference is added to the direct light; bounced light stays."""
        change = np.where(self.lit, light.flat * (after - before), 0.0)
        return replace(light, direct=np.maximum(light.direct + change, 0.0))

    def _footprint(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (box_u, box_v), each [height][width] in pattern pixels. box_u is the step of u to the left or right
        neighbour; the smaller one counts, since edges of objects must not open huge boxes. box_v is the ratio of focal
        lengths."""
        K, view = self._view.projector_K, self._view
        ratio_u, ratio_v = K[0, 0] / view.K[0, 0], K[1, 1] / view.K[1, 1]
        # Along epipolar lines the step depends on slant; one-sided differences, the smaller of both sides.
        step = np.diff(self.u, axis=1)
        step = np.minimum(
            np.abs(np.pad(step, ((0, 0), (1, 0)), "edge")), np.abs(np.pad(step, ((0, 0), (0, 1)), "edge"))
        )
        box_u = np.clip(np.where(step > 0, step, ratio_u), 0.25 * ratio_u, 4 * ratio_u)
        box_v = np.full(self.v.shape, ratio_v)
        return np.clip(box_u, _SMALLEST_BOX, _LARGEST_BOX), np.clip(box_v, _SMALLEST_BOX, _LARGEST_BOX)
