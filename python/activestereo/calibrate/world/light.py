# SPDX-License-Identifier: Apache-2.0
"""Measures two images of each view: the albedo of surfaces and the room's light that they reflect. Both are free of
exposure and lens falloff.

The dots' amplitude is albedo times the projector's irradiance. The image without the dots is the room's light off the
surface. A surface in two views has one albedo and one room light. So the views' ratios give each view's exposure and
the lens's falloff, cos^n of the angle, and both are divided out. Ratios are of the whole light, dots included. Dots are
removed imperfectly, most so where they are small, which would bias the ratios towards the images' edges."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.overlaps import Pose
from activestereo.calibrate.world.pattern import PatternEstimate, sampled
from activestereo.calibrate.world.views import (
    Image,
    Mask,
    SceneView,
    blurred,
    correlation,
    normals_of,
    points_of,
    same_surface,
)

_SLOW_PX, _AMPLITUDE_PX, _WHOLE_PX = 4.0, 9.0, 8.0
# A bilateral filter of this width, and this many fine deviations, smooths the room's light: noise and remains of dots
# vanish, edges stay (Tomasi and Manduchi 1998).
_SMOOTH_PX, _SMOOTH_DEVIATIONS = 3.0, 8.0
# A change of more than this many fine deviations of the image is a texture's step, and no dot.
_TEXTURE_DEVIATIONS = 6.0
_LEAST_GEOMETRY = 0.02  # cosine over squared distance, 1/m^2, below which dots are too dim for measuring albedo
_LEAST_LIGHT_DN = 2.0
_SAME_SURFACE = 0.01  # views' depths that differ by less than this share are of one place
_BLOCK_PX = 64
_LEAST_RATIOS, _MOST_LOG_RATIO, _ROUNDS = 500, 3.0, 12
_DARKEST = 1e-3
# Ten pairs of one D415's views scatter by 0.09 in the exponent, more than the blocks of one pair suggest. A projector
# that is dimmer towards its edges by one cosine adds 0.1, bounced light in a path traced room 0.35. The black level
# of overlaps alone errs by 0.3 DN in drawn rooms, 1.5 in the traced one, 1.2 in real ones, told there by other means.
# Light that bounces between surfaces is no view's exposure: one of three drawn ones erred by 5 %.
_PAIR_EXPONENT, _PAIR_BLACK_DN, _PAIR_EXPOSURE = 0.25, 1.5, 0.05
# A camera's counts end at its black level. At least this share of an image has the smallest count, and at least this
# share of the next count's pixels, in this share of the images that end so. With light and noise alone, counts thin
# out towards dark, and dark surfaces end elsewhere at another exposure.
_LEAST_AT_FLOOR, _LEAST_STEP_AT_FLOOR, _LEAST_ALIKE = 1e-3, 0.2, 0.75
_FLOOR_DN = 0.4
# Noise takes the darkest thousandth of an image up to this far below its light, DN.
_NOISE_DN = 3.0
# Two exposures of one place: the least ratio's logarithm, and how well the pictures then correlate under this blur.
_LEAST_LOG_EXPOSURE, _SAME_PICTURE, _SAME_PLACE_PX, _LINEAR_TO = 0.25, 0.99, 1.0, 0.9
# Logarithm of the exponent of good imagers' responses: 1.4 % for twice the exposure. The black level is then told to
# this, DN.
LINEAR, BLACK_BY_EXPOSURES_DN = 0.02, 0.3
# This quantile of the pattern's image is taken as the darkness between dots; light there counts as room light.
_BETWEEN_DOTS = 0.02


@dataclass(frozen=True)
class LightView:
    """One view's light as images [height, width]. whole: mean light in DN of the surface around each pixel, with black
    level and dots. dots: the dots' part of it. room: room light in DN, black level included. amplitude: dots in DN per
    unit of the pattern's image. geometry: cosine over squared distance from the projector, 1/m^2. r2: squared
    tangent of the angle to the optical axis. known: mask where room and geometry are known."""

    view: SceneView
    points: Image
    whole: Image
    dots: Image
    room: Image
    amplitude: Image
    geometry: Image
    r2: Image
    known: Mask


@dataclass(frozen=True)
class LightEstimate:
    """Exposures, black level and lens falloff. exposure: of each view relative to the first, with standard deviations.
    black_dn: (value, deviation). exponent: (n of cos^n, deviation), None without overlapping views. scatter:
    log-deviation of the views' ratios without and with the exponent. covariance: joint, of the further views' log
    exposures, exponent and black level, where all were fitted."""

    exposure: NDArray[np.float64]
    exposure_deviation: NDArray[np.float64]
    black_dn: tuple[float, float]
    exponent: tuple[float, float] | None
    scatter: tuple[float, float]
    covariance: NDArray[np.float64] | None = None

    def falloff(self, r2: Image) -> Image:
        """Returns the share of light that the lens passes at squared tangents r2 of the angle to the axis."""
        n = 0.0 if self.exponent is None else self.exponent[0]
        return np.asarray((1.0 + r2) ** (-0.5 * n), np.float32)


def black_level(views: Sequence[SceneView]) -> tuple[float, float]:
    """Estimates (black level, its deviation), DN, from the darkest counts. If images' histograms end abruptly, three in
    four of them at the same count, it is that count. Otherwise it is uniform between 0 and the darkest thousandth plus
    noise: a scene may have nothing black."""
    counts = [np.bincount(np.rint(image).astype(int).ravel()) for view in views for image in (view.left, view.right)]
    floors = [floor for count in counts if (floor := _floor(count)) is not None]
    if floors and np.mean(np.array(floors) == np.median(floors)) >= _LEAST_ALIKE:
        return float(np.median(floors)), float(np.hypot(_FLOOR_DN, np.std(floors) / np.sqrt(len(floors))))
    most = float(min(np.quantile(view.left, _DARKEST) for view in views)) + _NOISE_DN
    return 0.5 * most, most / np.sqrt(12.0)


def response_of(views: Sequence[SceneView], max_dn: float) -> tuple[float, float] | None:
    """Returns (log of the response's exponent, black level in DN); None without two views of one place at different
    stated exposures. Between such views, each pixel's light above black grows by (ratio of exposures)^exponent. This
    holds for every scene, light and lens."""
    told = []
    for a, b in itertools.combinations(views, 2):
        ratio = float(np.log(b.frame.exposure_gain / a.frame.exposure_gain))
        if abs(ratio) <= _LEAST_LOG_EXPOSURE:
            continue
        for first, second in ((a.left, b.left), (a.right, b.right)):
            x, y = blurred(first, _SAME_PLACE_PX), blurred(second, _SAME_PLACE_PX)
            linear = np.maximum(x, y) < _LINEAR_TO * max_dn
            if correlation(x[linear], y[linear]) > _SAME_PICTURE:
                slope, offset = np.polyfit(x[linear], y[linear], 1)
                told.append((np.log(max(np.log(slope) / ratio, 1e-3)), offset / (1.0 - slope)))
    return None if not told else (float(np.median([e for e, _ in told])), float(np.median([b for _, b in told])))


def _floor(count: NDArray[np.int64]) -> int | None:
    """Returns the smallest count of an image if it is above 0 and the histogram ends there abruptly, else None. count:
    number of pixels of each count."""
    lowest = int(np.flatnonzero(count)[0])
    beside = count[lowest + 1] if len(count) > lowest + 1 else 0
    ends = count[lowest] > _LEAST_AT_FLOOR * count.sum() and count[lowest] > _LEAST_STEP_AT_FLOOR * beside
    return lowest if ends and lowest > 0 else None


def darkness(pattern: PatternEstimate) -> float:
    """Returns the offset to add to the pattern's image so that its value between dots is 0."""
    return -float(np.nanquantile(pattern.image, _BETWEEN_DOTS))


def light_view(view: SceneView, K: NDArray[np.float64], pattern: PatternEstimate) -> LightView:
    """Separates a view's image into the dots' amplitude and the room's light. K: 3x3 of the left camera."""
    points = points_of(view.depth_m, K)
    from_projector = points - pattern.place.astype(np.float32)
    z = np.maximum(from_projector[..., 2], 1e-3)
    f, cx, cy = pattern.K[0, 0], pattern.K[0, 2], pattern.K[1, 2]
    seen = sampled(pattern.image, f * from_projector[..., 0] / z + cx, f * from_projector[..., 1] / z + cy)
    lit = np.isfinite(seen)
    dots = np.where(lit, seen, 0.0).astype(np.float32)
    fine = 1.4826 * float(np.median(np.abs(view.left - blurred(view.left, _SLOW_PX))))
    slow = cv2.bilateralFilter(view.left, int(3 * _SLOW_PX), _TEXTURE_DEVIATIONS * fine, _SLOW_PX)
    fast, fast_dots = view.left - slow, dots - blurred(dots, _SLOW_PX)
    weight = (view.surface & lit).astype(np.float32)
    amplitude = blurred(fast * fast_dots * weight, _AMPLITUDE_PX) / np.maximum(
        blurred(fast_dots * fast_dots * weight, _AMPLITUDE_PX), 1e-3
    )
    amplitude = np.maximum(amplitude, 0.0)
    lit_by = amplitude * np.where(lit, seen + darkness(pattern), darkness(pattern)).astype(np.float32)
    room, surface = view.left - lit_by, view.surface.astype(np.float32)
    near = np.maximum(blurred(surface, _WHOLE_PX), 1e-3)
    whole, mean_dots = (blurred(image * surface, _WHOLE_PX) / near for image in (view.left, lit_by))
    fine = 1.4826 * float(np.median(np.abs(room - blurred(room, 0.5 * _SMOOTH_PX))))
    room = cv2.bilateralFilter(room, int(3 * _SMOOTH_PX), _SMOOTH_DEVIATIONS * fine, _SMOOTH_PX)
    normal = normals_of(points)
    distance = np.maximum(np.linalg.norm(from_projector, axis=-1), 0.05)
    geometry = np.abs((normal * from_projector).sum(axis=-1)) / distance**3
    tangent = (points[..., :2] / np.maximum(points[..., 2:], 1e-3)) ** 2
    known = view.surface & (geometry > _LEAST_GEOMETRY)
    own = view, points, whole, mean_dots, room, amplitude, geometry.astype(np.float32)
    return LightView(*own, tangent.sum(axis=-1), known)


def seen_by(first: LightView, second: LightView, a_to_b: Pose, K: NDArray[np.float64]) -> tuple[Image, Image, Mask]:
    """Projects each pixel of the first view into the second. Returns (column, row, mask of the pixels whose surface the
    second view shows, too). a_to_b: 4x4 from the first to the second camera's frame."""
    column, row, same = same_surface(first.points, a_to_b, K, second.view.depth_m, _SAME_SURFACE)
    return column, row, same & (cv2.remap(second.known.astype(np.float32), column, row, cv2.INTER_LINEAR) > 0.99)


def solve_light(
    views: Sequence[LightView], poses: Sequence[Pose], K: NDArray[np.float64], believed: tuple[float, float],
    held: LightEstimate | None = None,
) -> LightEstimate:  # fmt: skip
    """Estimates exposures, black level and falloff exponent from the light of surfaces in several views.

    believed: (black level, its deviation) known before. held: an estimate whose black level and exponent are kept;
    None: they are fitted. Exposures scale all ratios of light between views. A wrong black level changes those of dark
    surfaces most, so both can be fitted. Views without overlap get exposure 1."""
    n = len(views)
    pairs = [_ratios(views, poses, K, a, b) for a, b in itertools.combinations(range(n), 2)]
    rows = np.concatenate(pairs) if pairs else np.zeros((0, 6))
    if not len(rows):
        black_and_exponent = (believed, None) if held is None else (held.black_dn, held.exponent)
        return LightEstimate(np.ones(n), np.full(n, np.inf), *black_and_exponent, (np.nan, np.nan))
    first, second, here, there, lens, block = rows.T
    exposures = np.zeros((len(rows), n))
    exposures[np.arange(len(rows)), second.astype(int)] = 1.0
    exposures[np.arange(len(rows)), first.astype(int)] -= 1.0
    if held is not None:
        _, ratio = _log_ratio(here, there, held.black_dn[0])
        n_held = held.exponent[0] if held.exponent else 0.0
        solution, covariance, _ = _robust(exposures[:, 1:], ratio - lens * n_held, block)
        exposure = np.exp(np.r_[0.0, solution])
        deviation = np.r_[0.0, np.sqrt(np.diag(covariance))] * exposure
        return LightEstimate(exposure, deviation, held.black_dn, held.exponent, (np.nan, np.nan))
    black, free = believed[0], None
    most = believed[0] + 3.0 * believed[1]
    for _ in range(_ROUNDS):
        slope, ratio = _log_ratio(here, there, black)
        free = _robust(np.column_stack([exposures[:, 1:], lens, slope]), ratio, block)
        before, black = black, float(np.clip(black - free[0][-1], 0.0, most))
        if abs(black - before) < 0.02:
            break
    assert free is not None
    told = float(np.hypot(np.sqrt(free[1][-1, -1]), _PAIR_BLACK_DN))
    weight = np.array([told**-2, believed[1] ** -2])
    black = float(weight @ (black, believed[0]) / weight.sum())
    black_sd = float(weight.sum() ** -0.5)
    slope, ratio = _log_ratio(here, there, black)
    solution, covariance, keep = _robust(np.column_stack([exposures[:, 1:], lens]), ratio, block)
    moved = _robust(np.column_stack([exposures[:, 1:], lens]), _log_ratio(here, there, black + 0.1)[1], block)[0]
    by_black = np.r_[(moved - solution) / 0.1, 1.0]
    covariance = np.pad(covariance, (0, 1)) + black_sd**2 * np.outer(by_black, by_black)
    covariance[-2, -2] += _PAIR_EXPONENT**2
    errors = np.sqrt(np.diag(covariance))
    covariance += np.diag(np.r_[np.full(n - 1, _PAIR_EXPOSURE**2), 0.0, 0.0])
    flat = np.linalg.lstsq(exposures[keep][:, 1:], ratio[keep], rcond=None)[0]
    scatter = [(ratio[keep] - exposures[keep][:, 1:] @ flat).std()]
    scatter += [(ratio[keep] - exposures[keep][:, 1:] @ solution[:-1] - lens[keep] * solution[-1]).std()]
    exposure = np.exp(np.r_[0.0, solution[:-1]])
    exponent = float(solution[-1]), float(errors[-2])
    deviation, told_scatter = np.r_[0.0, errors[:-2]] * exposure, (float(scatter[0]), float(scatter[1]))
    return LightEstimate(exposure, deviation, (black, black_sd), exponent, told_scatter, covariance)


def _log_ratio(
    here: NDArray[np.float64], there: NDArray[np.float64], black_dn: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compares the light (DN) of the same surfaces in two views, `here` and `there`. Returns (minus the derivative of
    log(there / here) by the black level, that log ratio). The log ratio is infinite where either is too dark."""
    up, down = np.maximum(there - black_dn, 0.5), np.maximum(here - black_dn, 0.5)
    usable = np.minimum(here, there) > black_dn + _LEAST_LIGHT_DN
    return 1.0 / down - 1.0 / up, np.where(usable, np.log(up / down), np.inf)


def _ratios(
    views: Sequence[LightView], poses: Sequence[Pose], K: NDArray[np.float64], a: int, b: int
) -> NDArray[np.float64]:
    """Samples surfaces that views a and b both show. Returns [n, 6] with these columns: a; b; light in a and in b, DN;
    the log ratio per unit of falloff exponent; the image block's number. The dots' part of the light in b is scaled to
    the projector's distance and angle in a. Errors within a block are correlated."""
    first, second = views[a], views[b]
    column, row, same = seen_by(first, second, np.linalg.inv(poses[b]) @ poses[a], K)
    at = np.flatnonzero(same & first.known)[::11]
    if len(at) < _LEAST_RATIOS:
        return np.zeros((0, 6))
    there, dots, geometry, r2 = (
        cv2.remap(image, column, row, cv2.INTER_LINEAR).ravel()[at]
        for image in (second.whole, second.dots, second.geometry, second.r2)
    )
    here, there = first.whole.ravel()[at], there + dots * (first.geometry.ravel()[at] / geometry - 1.0)
    lens = -0.5 * (np.log1p(r2) - np.log1p(first.r2.ravel()[at]))
    width = same.shape[1]
    block = (a * len(views) + b) * 100_000 + at // width // _BLOCK_PX * 1000 + at % width // _BLOCK_PX
    return np.column_stack([np.full(len(at), a), np.full(len(at), b), here, there, lens, block])


def _robust(
    design: NDArray[np.float64], ratio: NDArray[np.float64], block: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], Mask]:
    """Solves design @ solution = ratio by least squares without outliers and infinite ratios. Returns (solution, its
    covariance by the sandwich estimator over blocks, mask of rows kept)."""
    keep = np.abs(ratio) < _MOST_LOG_RATIO
    usable = keep
    for _ in range(10):
        solution = np.linalg.lstsq(design[keep], ratio[keep], rcond=None)[0]
        rest = np.where(usable, ratio, 0.0) - design @ solution
        keep = usable & (np.abs(rest) < 2.5 * 1.4826 * max(float(np.median(np.abs(rest[usable]))), 1e-4))
    inverse = np.linalg.pinv(design[keep].T @ design[keep])
    _, place = np.unique(block[keep], return_inverse=True)
    gradient = np.zeros((place.max() + 1, design.shape[1]))
    np.add.at(gradient, place, design[keep] * rest[keep, None])
    return solution, inverse @ (gradient.T @ gradient) @ inverse, keep


@dataclass(frozen=True)
class Textures:
    """Images of one view, [height, width], merged from all views of the same surfaces. albedo, room: albedo and room
    light in arbitrary units. deviation: relative standard error of `room`, NaN where only one view saw the surface."""

    albedo: Image
    room: Image
    deviation: Image


def merged_textures(
    owner: int, views: Sequence[LightView], poses: Sequence[Pose], light: LightEstimate, K: NDArray[np.float64]
) -> Textures:
    """Returns the Textures of view number `owner`: albedo and room light, averaged over all views that show the same
    surfaces."""
    black = np.float32(light.black_dn[0])
    shape = views[owner].room.shape
    sums = np.zeros((6, *shape), np.float32)
    for k, other in enumerate(views):
        lens = float(light.exposure[k]) * light.falloff(other.r2)
        room, albedo = (other.room - black) / lens, other.amplitude / np.maximum(other.geometry * lens, 1e-6)
        if k == owner:
            w, wa = lens**2 * other.known, (lens * other.geometry) ** 2 * other.known
        else:
            column, row, same = seen_by(views[owner], other, np.linalg.inv(poses[k]) @ poses[owner], K)
            take = lambda image, u=column, v=row: cv2.remap(image, u, v, cv2.INTER_LINEAR)  # noqa: E731
            w, wa = take(lens) ** 2 * same, take(lens * other.geometry) ** 2 * same
            room, albedo = take(room), take(albedo)
        sums += np.stack([w * room, w, w * room**2, (w > 0).astype(np.float32), wa * albedo, wa])
    room = _filled(sums[0], sums[1])
    smooth_albedo = _filled(blurred(sums[4], 1.0), blurred(sums[5], 1.0))
    # Dots give albedo at the distance between them; finer detail comes from the room's light.
    detail = np.clip(room / np.maximum(blurred(room, _AMPLITUDE_PX), 0.5), 0.4, 2.0)
    spread = np.sqrt(np.maximum(sums[2] / np.maximum(sums[1], 1e-9) - room**2, 0.0)) / np.maximum(room, 0.5)
    deviation = np.where(sums[3] > 1, spread / np.sqrt(np.maximum(sums[3] - 1, 1)), np.nan).astype(np.float32)
    return Textures(np.maximum(smooth_albedo * detail, 0.0), np.maximum(room, 0.0), deviation)


def _filled(total: Image, weight: Image) -> Image:
    """Returns the image total / weight. Pixels without weight take the mean of their surroundings."""
    out, known = total / np.maximum(weight, 1e-9), weight > 1e-9
    for sigma in (2.0, 8.0, 32.0, 128.0):
        around = blurred(known.astype(np.float32), sigma)
        near = blurred(np.where(known, out, 0.0).astype(np.float32), sigma) / np.maximum(around, 1e-6)
        fresh = ~known & (around > 0.02)
        out, known = np.where(fresh, near, out), known | fresh
    return np.where(known, out, float(np.median(out[known])) if known.any() else 0.0).astype(np.float32)
