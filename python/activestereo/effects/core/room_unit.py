# SPDX-License-Identifier: Apache-2.0
"""Finds starting values for a fit of a pattern projector that stands in the world.

The search first keeps the places whose light would fall onto the surfaces as strongly as the residual's dots show. From
each place, the residual by direction is correlated with the pattern at all pans and tilts. The best few places are then
polished, first with a blurred pattern, then with a sharper one.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from activestereo.effects.core.judging import StartImage
from activestereo.effects.core.unit_match import PlaneMatch, SeenPoints, SphereMatch

_IMAGES, _COARSE_PIXELS, _FINE_PIXELS = 4, 10000, 20000
# The grid of places: its margin around the seen points, its step (blurred dots match within some 3 cm), the least
# distance to a seen point, and the number of places that are matched with the pattern. Where a room would need more
# than _MOST_OF_GRID places, the step grows.
_BEYOND_M, _STEP_M, _NEAR_M, _PLACES = 0.7, 0.05, 0.15, 5000
_MOST_OF_GRID = 200_000
# The pattern's blur (Gaussian, radians) and resolution (focal length, pixels) in the search and in the polish.
_COARSE, _FINE = (4.0 / 592.0, 148.0), (2.0 / 592.0, 296.0)
_ROUGHLY_POLISHED, _POLISHED, _STARTS = 16, 3, 2
# Detail finer than this many pixels is dots or noise. Where its mean square is less than this multiple of the noise, no
# unit shows and nothing is searched.
_FINE_PX, _LEAST_CHI2 = 4.0, 1.1
# The least correlation of a place's light with the dots' size; below it nothing is searched. It is 0.33 to 0.49 where a
# unit shines, and 0.07 to 0.16 where the dots' size is random.
_LEAST_LIKENESS = 0.2
# Correlation with noise gives no such fall of chi2, even for the best of some 10^8 poses (2 ln 10^8 = 37).
_LEAST_GAIN = 100.0


def room_unit_starts(images: list[StartImage]) -> list[dict[str, float]]:
    """Returns the projector's intensity and pose at the best few places, {parameter: value} each. It uses the images in
    which the rig's own projector has its least power. Returns [{}], the neutral values, if the residual has no dots."""
    least = min((image.view.frame.projector_power for image in images), default=0.0)
    chosen = [image for image in images if image.view.frame.projector_power == least][:_IMAGES]
    # The mean square of each residual's fine part in units of its noise: about 1 where it is noise alone.
    fine = [image.residual - gaussian_filter(image.residual, _FINE_PX) for image in chosen]
    chi2 = [float(np.mean(image.weight * rest**2)) for image, rest in zip(chosen, fine, strict=True)]
    if not chosen or np.mean(chi2) < _LEAST_CHI2:
        return [{}]
    seen, view = SeenPoints.of(chosen, _FINE_PIXELS), chosen[0].view
    few = seen.some(_COARSE_PIXELS)
    places = _likely_places(few)
    if len(places) == 0:
        return [{}]
    found = SphereMatch(view, *_COARSE).best(few, places)
    coarse, exact = PlaneMatch(view, *_COARSE), PlaneMatch(view, *_FINE)
    poses = [pose for _, pose in _first(found, _ROUGHLY_POLISHED)]
    rough = [coarse.polished(few, pose, 0.02) for pose in poses]
    rough = [pose for _, pose in _first([(coarse.best(seen, pose)[0], pose) for pose in rough], _POLISHED)]
    starts = [exact.best(seen, exact.polished(seen, coarse.polished(seen, pose, 0.02), 0.01)) for pose in rough]
    names = "x_m", "y_m", "z_m", "azimuth_rad", "elevation_rad", "roll_rad"
    return [
        {"intensity_m2": strength} | dict(zip(names, map(float, pose), strict=True))
        for gain, strength, pose in sorted(starts, key=lambda one: -one[0])[:_STARTS]
        if gain > _LEAST_GAIN
    ] or [{}]


def _first(scored: list[tuple[float, np.ndarray]], most: int) -> list[tuple[float, np.ndarray]]:
    return sorted(scored, key=lambda one: -one[0])[:most]


def _likely_places(seen: SeenPoints) -> np.ndarray:
    """Returns candidate places [n][3] of the projector in the world, best first. From these, the light on the surfaces
    would vary as the dots' measured size does. Empty, [0][3], if none correlates. (Mean light does not count: the
    ambient light's fit has taken it.)"""
    if len(seen.points) == 0:
        return np.empty((0, 3))
    low, high = np.quantile(seen.points, 0.02, axis=0) - _BEYOND_M, np.quantile(seen.points, 0.98, axis=0) + _BEYOND_M
    step_m = max(_STEP_M, float(np.cbrt(np.prod(high - low) / _MOST_OF_GRID)))
    few, (xs, ys, zs) = seen.some(800), (np.arange(a, b, step_m) for a, b in zip(low, high, strict=True))
    points, normals, strength, dots = (
        x.astype(np.float32) for x in (few.points, few.normals, few.glow * np.sqrt(few.weight), few.dots)
    )
    dots -= dots.mean()
    places, likeness = [], []
    for x in xs:  # distances and cosines of a slab of places are matrix products
        slab = np.stack(np.meshgrid([x], ys, zs), axis=-1).reshape(-1, 3).astype(np.float32)
        square = (slab**2).sum(-1)[:, None] + (points**2).sum(-1) - 2.0 * slab @ points.T
        is_free = square.min(-1) > _NEAR_M**2
        slab, square = slab[is_free], square[is_free]
        cosine = np.maximum(slab @ normals.T - (points * normals).sum(-1), 0.0)
        shown = strength * cosine / (square * np.sqrt(square))
        shown -= shown.mean(axis=-1, keepdims=True)
        places.append(slab.astype(np.float64))
        likeness.append(shown @ dots / np.maximum(np.linalg.norm(shown, axis=-1) * np.linalg.norm(dots), 1e-30))
    of_all = np.concatenate(likeness)
    if of_all.max(initial=0.0) < _LEAST_LIKENESS:
        return np.empty((0, 3))
    return np.concatenate(places)[np.argsort(-of_all, kind="stable")[:_PLACES]]
