# SPDX-License-Identifier: Apache-2.0
"""Measures the projector's dots and position from arbitrary scenes with depth.

A pixel's high-pass value over its local RMS does not depend on albedo or distance. Projected back through depth to the
projector's true position, all views' high-pass images agree, so their average is sharpest there. The projector's
rotation cannot be told from a rotation of its pattern, so its axes are set to the left camera's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import t as student

from activestereo.calibrate.world.views import Image, Mask, SceneView, blurred, correlation, points_of
from activestereo.common.progress_bar import Progress, silent

Vector = NDArray[np.float64]

# The pattern's image: samples per camera pixel, and how far beyond the camera's field it reaches.
_SCALE, _BEYOND = 2, 1.12
_SLOW_PX, _RMS_PX = 4.0, 12.0
_LEAST_RMS_DN, _RMS_FLOOR_DN = 1.0, 0.5
# Dots are compared after this blur of the pattern's image (its pixels), where a pixel has at least so many samples.
_BLUR, _LEAST_COUNT = 1.0, 0.15
# The position is sought with a part of the samples, and at first of the views, in steps of these metres.
_STEPS_M = np.array([1.0e-3, 1.0e-3, 3.0e-3])
_SOUGHT_VIEWS = 8
_WALK = 35
_MOST_PIXELS = 250_000
# Below this correlation the views show no common pattern. Dots are everywhere, textures are not: fine contrast that
# covers this share of the surfaces comes from dots.
_LEAST_R, _COVERED = 0.25, 0.5


@dataclass(frozen=True)
class DotView:
    """The usable pixels of one view. value: [n], normalised high-pass image. points: [n, 3] in the left camera's frame.
    used: their mask [height, width]."""

    value: NDArray[np.float32]
    points: NDArray[np.float32]
    used: Mask


@dataclass(frozen=True)
class PatternEstimate:
    """The measured pattern. image: mean normalised high-pass image under the pattern's K, NaN = no view lit it. place:
    the projector's position in the left camera's frame, m. covariance: [3, 3], of place. r: {frame id: correlation of
    its dots with the other views' prediction}. is_common: whether all views show the same dots. If not, the image is
    the mean of the views' different dots."""

    image: Image
    K: NDArray[np.float64]
    place: Vector
    covariance: NDArray[np.float64]
    r: dict[int, float]
    is_common: bool = True

    def r_median(self) -> float:
        """Returns the median over the views of r, their dots' correlation with the other views' prediction."""
        return float(np.median(list(self.r.values())))


def dot_view(view: SceneView, K: NDArray[np.float64], max_dn: float) -> DotView:
    """Computes a view's normalised high-pass values and points. K: 3x3 of the left camera. max_dn: the saturated
    count."""
    slow = blurred(view.left, _SLOW_PX)
    fast = view.left - slow
    rms = np.sqrt(blurred(fast * fast, _RMS_PX))
    used = view.surface & (rms > _LEAST_RMS_DN) & (view.left < 0.98 * max_dn)
    value = np.clip(fast / (rms + _RMS_FLOOR_DN), -3.0, 4.0)
    return DotView(value[used].astype(np.float32), points_of(view.depth_m, K)[used], used)


class _Canvas:
    """The pixel grid of the pattern's image. Surface points are projected onto it from an assumed position of the
    projector."""

    def __init__(self, K: NDArray[np.float64], size: tuple[int, int]) -> None:
        self.width, self.height = (int(_SCALE * _BEYOND * side) for side in size)
        f = _SCALE * K[0, 0]
        self.K = np.array([[f, 0, self.width / 2 - 0.5], [0, f, self.height / 2 - 0.5], [0, 0, 1.0]])

    def pixels(self, points: NDArray[np.float32], place: Vector) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        x, y, z = (points[:, k] - np.float32(place[k]) for k in range(3))
        f = np.float32(self.K[0, 0])
        return f * x / z + np.float32(self.K[0, 2]), f * y / z + np.float32(self.K[1, 2])

    def sums(self, view: DotView, place: Vector) -> tuple[Image, Image]:
        """Projects a view's points into the pattern from the position `place` (left camera's frame, m). Returns two
        images: each pattern pixel's sum of the view's values, and their number."""
        u, v = self.pixels(view.points, place)
        column, row = np.rint(u).astype(np.int32), np.rint(v).astype(np.int32)
        inside = (column >= 0) & (column < self.width) & (row >= 0) & (row < self.height)
        index, size = row[inside] * self.width + column[inside], self.width * self.height
        shape = (self.height, self.width)
        total = np.bincount(index, view.value[inside], size).reshape(shape).astype(np.float32)
        return total, np.bincount(index, minlength=size).reshape(shape).astype(np.float32)


def _mean(total: Image, count: Image) -> Image:
    total, count = blurred(total, _BLUR), blurred(count, _BLUR)
    return np.where(count > _LEAST_COUNT, total / np.maximum(count, 1e-6), np.nan).astype(np.float32)


def recover_pattern(
    views: Sequence[SceneView], K: NDArray[np.float64], start: Vector, max_dn: float, seed: int = 0,
    scenes: Sequence[int] | None = None, progress: Progress = silent,
) -> PatternEstimate:  # fmt: skip
    """Estimates the pattern and the projector's position from views. K: 3x3 of the left camera. start: the projector's
    nominal position in the left camera's frame, m. scenes: scene number of each view, because errors within a scene are
    correlated. None, or fewer than three: views count singly. Views whose dots differ keep the nominal position. Raises
    ValueError if the views neither share dots nor show their own."""
    rng = np.random.default_rng(seed)
    dots = [dot_view(view, K, max_dn) for view in views]
    if not any(len(f.value) for f in dots):
        raise ValueError(
            "no dots in any view: the images have no fine contrast where there is depth: switch the projector on"
        )
    size = views[0].left.shape[1], views[0].left.shape[0]
    canvas = _Canvas(K, size)
    chosen = list(dots)
    for number, f in enumerate(dots):
        if len(f.value) > _MOST_PIXELS:
            # Stripes, not single pixels: dots must stay whole.
            stripes = np.arange(len(f.value) // 64 * 64).reshape(-1, 64)
            index = stripes[np.sort(rng.choice(len(stripes), _MOST_PIXELS // 64, replace=False))].ravel()
            chosen[number] = DotView(f.value[index], f.points[index], f.used)
    apart = scenes if scenes is not None and len(set(scenes)) > 2 else range(len(dots))
    place, covariance = _sharpest(canvas, chosen, apart, np.asarray(start, float), progress)
    sums = [canvas.sums(f, place) for f in dots]
    total, count = (np.sum([s[k] for s in sums], axis=0, dtype=np.float32) for k in (0, 1))
    r = {}
    for view, f, (own, hits) in zip(views, dots, sums, strict=True):
        others = _mean(total - own, count - hits)
        seen = sampled(others, *canvas.pixels(f.points, place))
        known = np.isfinite(seen)
        r[view.frame.id] = correlation(seen[known], f.value[known]) if known.sum() > 1000 else 0.0
    estimate = PatternEstimate(_mean(total, count), canvas.K, place, covariance, r)
    if not estimate.r_median() > _LEAST_R:
        covered = [f.used.sum() / max(view.surface.sum(), 1) for view, f in zip(views, dots, strict=True)]
        if np.median(covered) > _COVERED:
            stated = np.asarray(start, float)
            sums = [canvas.sums(f, stated) for f in dots]
            total, count = (np.sum([s[k] for s in sums], axis=0, dtype=np.float32) for k in (0, 1))
            return PatternEstimate(_mean(total, count), canvas.K, stated, np.diag(_STEPS_M**2), r, is_common=False)
        raise ValueError(
            f"the views have no dots in common (each view's dots correlate {estimate.r_median():.2f} in the median "
            "with what the others predict, 0.5 and more where they do): switch the projector on, and record one device"
        )
    return estimate


def sampled(image: Image, u: NDArray, v: NDArray) -> NDArray[np.float32]:
    """Samples an image bilinearly at positions of any shape; NaN outside and where the image is NaN."""
    flat = np.asarray(u, np.float32).reshape(1, -1), np.asarray(v, np.float32).reshape(1, -1)
    out = np.empty(flat[0].size, np.float32)
    for first in range(0, out.size, 30000):  # OpenCV's remap takes at most 32767 columns
        part = np.s_[:, first : first + 30000]
        out[first : first + 30000] = cv2.remap(
            image, flat[0][part], flat[1][part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=np.nan
        )
    return out.reshape(np.shape(u))


def _sharpest(
    canvas: _Canvas, views: Sequence[DotView], scenes: Sequence[int], start: Vector,
    progress: Progress,
) -> tuple[Vector, NDArray[np.float64]]:  # fmt: skip
    """Returns (position at which the views agree most, its covariance [3, 3] by a jackknife over scenes)."""
    numbers = sorted(set(scenes))
    done, most = 0, _WALK + 19

    def agreement(place: Vector, views: Sequence[DotView], left_out: bool) -> NDArray[np.float64]:
        """Computes how well the views' dots agree for a projector at `place` (left camera's frame, m): first for all
        views, then, if left_out, without each scene. A view's agreement with itself is excluded."""
        nonlocal done
        done += 1
        progress(min(done / most, 1.0))
        whole = [np.zeros((canvas.height, canvas.width), np.float32) for _ in range(4)]
        own = {number: [image.copy() for image in whole] for number in numbers} if left_out else {}
        for view, number in zip(views, scenes, strict=False):
            t, c = (blurred(image, _BLUR) for image in canvas.sums(view, place))
            for k, image in enumerate((t, c, t * t, c * c)):
                whole[k] += image
                if left_out:
                    own[number][k] += image
        rest = ([all_of - part for all_of, part in zip(whole, parts, strict=True)] for parts in own.values())
        return np.array([_agreement(*sums) for sums in (whole, *rest)])

    # A coarse search on some views comes first, then a paraboloid for all views and for each scene left out.
    some = views[:: max(1, -(-len(views) // _SOUGHT_VIEWS))]
    simplex = np.vstack([np.zeros(3), 2.0 * np.eye(3)])
    found = minimize(
        lambda s: -agreement(start + s * _STEPS_M, some, False)[0],
        np.zeros(3),
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 0.05, "fatol": 1e-5, "maxfev": _WALK},
    )
    middle = start + found.x * _STEPS_M
    design = np.array([step for step in product((-1, 0, 1), repeat=3) if np.abs(step).sum() <= 2])
    step, n = 0.4 * _STEPS_M, len(numbers)
    values = np.array([agreement(middle + d * step, views, n > 2) for d in design])
    peaks = np.array([_peak(design, column) for column in values.T])
    place = middle + peaks[0] * step
    if n < 3:
        return place, np.diag(_STEPS_M**2)
    left_out = peaks[1:] * step
    spread = left_out - left_out.mean(axis=0)
    # A deviation of few scenes is itself hardly known: intervals are Student's.
    few = (student.ppf(0.95, n - 1) / 1.645) ** 2
    return place, few * (n - 1) / n * spread.T @ spread


def _agreement(total: Image, count: Image, square: Image, count2: Image) -> float:
    """Computes the mean product of different views' high-pass values over pattern pixels that two views or more share.
    total, count: sums over views of values and of sample numbers. square, count2: sums over views of their squares."""
    pairs = count * count - count2
    known = pairs > 0.05
    return float((total * total - square)[known].sum(dtype=np.float64) / pairs[known].sum(dtype=np.float64))


def _peak(design: NDArray, values: Vector) -> Vector:
    """Fits a paraboloid to values at the points design [n, 3], and returns its top [3], within two steps; zeros if it
    has none."""
    i, j, k = design.T.astype(float)
    columns = np.stack([np.ones_like(i), i, j, k, i * i, j * j, k * k, i * j, i * k, j * k], axis=1)
    c = np.linalg.lstsq(columns, values, rcond=None)[0]
    hessian = np.array([[2 * c[4], c[7], c[8]], [c[7], 2 * c[5], c[9]], [c[8], c[9], 2 * c[6]]])
    if np.linalg.eigvalsh(hessian).max() >= 0:
        return np.zeros(3)
    return np.clip(-np.linalg.solve(hessian, c[1:4]), -2.0, 2.0)
