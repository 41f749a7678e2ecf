# SPDX-License-Identifier: Apache-2.0
"""Finds starting values for the pose and intensity of a second projector that stands in the room (a "unit").

The search first keeps the places from which light would fall onto the surfaces as strongly as the residual's dots show.
At each place the residual is correlated with the pattern at all pans and tilts. The best few poses are polished, first
with a blurred pattern, then with a sharper one.

PlaneMatch: on the projector's image plane, a small pan or tilt nearly shifts the pattern, so one correlation finds the
best ones near a pose. A rotation by more than a few degrees bends the pattern. SphereMatch: on a grid of azimuths and
elevations around a place, a pan shifts the pattern exactly. For each of some tilts the pattern is drawn once on this
grid; correlation over the azimuth gives the gain of all pans."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from heapq import nlargest
from itertools import chain
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from scipy import fft
from scipy.ndimage import gaussian_filter, zoom
from scipy.optimize import minimize

from activestereo.effects.core.descriptor import StartImage
from activestereo.effects.core.engine import angles, axes
from activestereo.effects.core.shading import Facing, dot_products, reflectance_of
from activestereo.effects.core.view import View, transform

_SEED = 12
# The difference of these two Gaussians (sigma in pixels) keeps dots: it removes noise and smooth light.
_DOTS_PX = 0.8, 4.0


class SeenPoints(NamedTuple):
    """n pixels that see a surface. points, normals: [n][3], metres, in the world or another frame. glow: DN under
    irradiance 1. ambient: DN of ambient light. weight: inverse variance, 1/DN^2. residual: measured minus expected, DN.
    dots: size of the residual's detail that is as fine as dots, in a pixel's standard deviations."""

    points: np.ndarray
    normals: np.ndarray
    glow: np.ndarray
    ambient: np.ndarray
    weight: np.ndarray
    residual: np.ndarray
    dots: np.ndarray

    @classmethod
    def of(
        cls, images: list[StartImage], most: int,
        to_frame: Callable[[View], np.ndarray] = lambda v: v.frame.camera_to_world @ np.linalg.inv(v.left_to_camera),
    ) -> SeenPoints:  # fmt: skip
        """Returns at most `most` random pixels of the images, among those that see a surface. to_frame: maps a view to
        the pose [4][4] of its camera in the points' frame, by default the world."""
        columns = []
        for image in images:
            facing, reflectance = Facing.of(image.view), reflectance_of(image.light, image.view)
            to_own = to_frame(image.view)
            at = facing.hit & (reflectance > 0)
            sharp, smooth = (gaussian_filter(image.residual, size) for size in _DOTS_PX)
            columns.append(
                (
                    transform(to_own, facing.points[at]),
                    facing.normal[at] @ to_own[:3, :3].T,
                    image.ambient_dn * reflectance[at],
                    image.ambient_dn * image.light.ambient[at],
                    image.weight[at],
                    image.residual[at],
                    (np.abs(sharp - smooth) * np.sqrt(image.weight))[at],
                )
            )
        return cls(*(np.concatenate(column) for column in zip(*columns, strict=True))).some(most)

    def some(self, most: int) -> SeenPoints:
        pick = np.random.Generator(np.random.PCG64(_SEED)).permutation(len(self.residual))[:most]
        return SeenPoints(*(x[pick] for x in self))

    def lit_from(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns (vectors from a place [3], or from places [...][3], to the points; DN [n] that a source of radiant
        intensity 1 at the place gives each point)."""
        way = self.points - place[..., None, :]
        square = np.maximum(dot_products(way, way), 1e-6)
        return way, self.glow * np.maximum(-dot_products(way, self.normals), 0.0) / (square * np.sqrt(square))

    def fit_even_beam(self, lit: np.ndarray) -> np.ndarray:
        """Fits an even beam, without a pattern, to the residual; returns weight times the remaining residual, [n]. lit:
        each point's DN under that beam at intensity 1."""
        even = max(float(lit @ (self.weight * self.residual)), 0.0) / max(float(lit**2 @ self.weight), 1e-300)
        return self.weight * (self.residual - even * lit)


def blurred_pattern(view: View, sigma_rad: float, focal_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns the projector's pattern after a Gaussian blur, resized to a focal length in pixels, and its intrinsics
    [3][3]."""
    size = focal_px / view.projector_K[0, 0]
    blurred = gaussian_filter(np.asarray(view.pattern, dtype=np.float64), sigma_rad * view.projector_K[0, 0])
    pattern = zoom(blurred, size, order=1)
    K = view.projector_K.copy()
    K[:2] *= size
    return pattern, K


def pixels_of(
    beam: np.ndarray, K: np.ndarray, shape: tuple[int, ...], margin_px: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Projects directions [...][3] in a unit's frame onto an image plane of shape [rows, columns]. Returns (row,
    column, mask of those inside). margin_px: rows and columns of the plane before the pattern's first pixel."""
    z = np.where(beam[..., 2] > 0.05, beam[..., 2], np.inf)
    column = np.rint(K[0, 0] * beam[..., 0] / z + K[0, 2] + margin_px[1]).astype(int)
    row = np.rint(K[1, 1] * beam[..., 1] / z + K[1, 2] + margin_px[0]).astype(int)
    inside = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0]) & np.isfinite(z)
    return row, column, inside


class PlaneMatch:
    """Finds the pan and tilt, near a known pose, at which a projector's blurred pattern fits the residual best. It
    tries those that keep the pattern on an image plane `margin` times its size. Poses are (x, y, z, azimuth, elevation,
    roll), metres and radians."""

    def __init__(self, view: View, sigma_rad: float, focal_px: float, margin: float = 2.0) -> None:
        pattern, self._K = blurred_pattern(view, sigma_rad, focal_px)
        height, width = (fft.next_fast_len(round(margin * n), True) for n in pattern.shape)
        self._shape, self._before = (height, width), ((height - pattern.shape[0]) // 2, (width - pattern.shape[1]) // 2)
        plane = np.zeros(self._shape, np.float32)
        plane[: pattern.shape[0], : pattern.shape[1]] = pattern - pattern.mean()
        self._of_pattern, self._of_square = (np.conj(fft.rfft2(x)) for x in (plane, plane**2))
        # Tangents of the tilts and pans to which a shift of the pattern by so many rows and columns belongs.
        shifts = (np.arange(2 * before + 1) - before for before in self._before)
        self._tilts, self._pans = (k / focal for k, focal in zip(shifts, (self._K[1, 1], self._K[0, 0]), strict=True))

    def best(
        self, seen: SeenPoints, pose: np.ndarray, most: tuple[float, float] = (np.inf, np.inf)
    ) -> tuple[float, float, np.ndarray]:
        """Returns (decrease of chi squared, intensity, pose) at the best pan and tilt near `pose`, from the same place.
        most: tangents of the largest tilt and pan."""
        way, lit = seen.lit_from(pose[:3])
        turn = axes(*pose[3:])
        width = self._shape[1]
        row, column, inside = pixels_of(way @ turn, self._K, self._shape, self._before)
        inside &= lit > 0
        at, lit = (row * width + column)[inside], np.where(inside, lit, 0.0)
        left, lit, weight = seen.fit_even_beam(lit)[inside], lit[inside], seen.weight[inside]
        moment = self._correlated(at, lit * left, self._of_pattern)
        norm = self._correlated(at, lit**2 * weight, self._of_square)
        strength = np.maximum(moment, 0.0) / np.maximum(norm, 1e-2 * norm.max() + np.float32(1e-30))
        gain = strength * np.maximum(moment, 0.0)
        gain[np.abs(self._tilts) > most[0]] = 0.0
        gain[:, np.abs(self._pans) > most[1]] = 0.0
        i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
        ahead = np.array([self._pans[j], self._tilts[i], 1.0])
        turned = np.array([*pose[:3], *angles(turn @ ahead), pose[5]])
        return float(gain[i, j]), float(strength[i, j]), turned

    def _correlated(self, at: np.ndarray, values: np.ndarray, conjugate: np.ndarray) -> np.ndarray:
        plane = np.bincount(at, values, self._shape[0] * self._shape[1]).reshape(self._shape).astype(np.float32)
        circular = fft.irfft2(fft.rfft2(plane) * conjugate, self._shape)
        return circular[: len(self._tilts), : len(self._pans)]

    def polished(self, seen: SeenPoints, pose: np.ndarray, size: float, trials: int) -> np.ndarray:
        """Varies place and roll from `pose` by the simplex method, with the best pan and tilt for each. Returns the
        pose that decreases chi squared most. size: edge of the first simplex, metres and radians. trials: the largest
        number of poses to evaluate."""
        towards = pose[3:5]
        x0 = np.array([*pose[:3], pose[5]])
        options = {"initial_simplex": np.stack([x0, *(x0 + size * np.eye(4))]), "maxfev": trials}
        found = minimize(
            lambda x: -self.best(seen, np.array([*x[:3], *towards, x[3]]))[0], x0, method="Nelder-Mead", options=options
        ).x
        return self.best(seen, np.array([*found[:3], *towards, found[3]]))[2]


# Columns cover all azimuths. Rows go from straight down to the highest direction that the highest tilt sees.
_COLUMNS, _ROWS = 384, 160
_STEP_RAD = 2 * np.pi / _COLUMNS
# Fourier waves around the circle. Dots of 0.8 degrees have no finer ones; the norm varies with the pattern's outline.
_WAVES, _WAVES_OF_NORM, _COLUMNS_OF_NORM = 150, 24, 64
# Tilts that are correlated together, over the rows that the pattern covers at them.
_TILTS_TOGETHER = 24
# Tilts of a standing unit, from nearly straight down to well above the horizon; the step is a dot's width.
_TILTS_RAD = np.arange(-1.4, 0.4, 0.025)
_REACH_RAD, _AT_ONCE = 1.6, 32


class SphereMatch:
    """Finds the pan and tilt at which a projector's blurred pattern fits the residual best, for each of several places.
    It tries all azimuths and the tilts of _TILTS_RAD; roll is 0."""

    def __init__(self, view: View, sigma_rad: float, focal_px: float) -> None:
        pattern, K = blurred_pattern(view, sigma_rad, focal_px)
        column = (np.arange(_COLUMNS) + 0.5) * _STEP_RAD
        azimuth = np.where(column > np.pi, column - 2 * np.pi, column)
        near = np.abs(azimuth) < _REACH_RAD
        a, e = np.meshgrid(azimuth[near], (np.arange(_ROWS) + 0.5) * _STEP_RAD - np.pi / 2)
        ways = np.stack([np.cos(e) * np.sin(a), np.sin(e), np.cos(e) * np.cos(a)], axis=-1)
        drawn = np.zeros((len(_TILTS_RAD), _ROWS, _COLUMNS), np.float32)
        for tilted, tilt in zip(drawn, _TILTS_RAD, strict=True):
            row, at, inside = pixels_of(ways @ axes(0.0, tilt, 0.0), K, pattern.shape)
            values = (pattern - pattern.mean())[np.where(inside, row, 0), np.where(inside, at, 0)]
            tilted[:, near] = np.where(inside, values, 0.0)
        self._of_pattern, self._of_square = _spectra(drawn, _WAVES), _spectra(drawn**2, _WAVES_OF_NORM)

    def best(self, seen: SeenPoints, places: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """Returns (decrease of chi squared, pose) for each place [n][3], at its best pan and tilt. Poses are (x, y, z,
        azimuth, elevation, roll)."""
        # In single precision angles take a fifth of the time.
        seen = SeenPoints(*(np.ascontiguousarray(x.T, np.float32) for x in seen))
        places = places.astype(np.float32)

        def best_of(some: np.ndarray) -> list[tuple[float, np.ndarray]]:
            gradient, curvature = (
                np.empty((len(some), _ROWS, columns), np.float32) for columns in (_COLUMNS, _COLUMNS_OF_NORM)
            )
            for place, *images in zip(some, gradient, curvature, strict=True):
                _gather(seen, place, images)
            moment, norm = _correlated(gradient, self._of_pattern), _correlated(curvature, self._of_square)
            norm = np.maximum(norm, 0.1 * norm.max(axis=(1, 2), keepdims=True) + np.float32(1e-30))
            gain = np.maximum(moment, 0.0, out=moment)
            gain *= gain
            gain.reshape(*norm.shape, -1)[:] /= norm[..., None]
            best = gain.reshape(len(some), -1).argmax(axis=1)
            found = []
            for place, of_place, at in zip(some, gain, best, strict=True):
                tilt, column = divmod(int(at), _COLUMNS)
                azimuth = column * _STEP_RAD - (2 * np.pi if 2 * column > _COLUMNS else 0.0)
                found.append((float(of_place[tilt, column]), np.array([*place, azimuth, _TILTS_RAD[tilt], 0.0])))
            return found

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return list(chain(*pool.map(best_of, (places[k : k + _AT_ONCE] for k in range(0, len(places), _AT_ONCE)))))


def _gather(seen: SeenPoints, place: np.ndarray, images: Sequence[np.ndarray]) -> None:
    """Fills two images of directions from a place, [row][column] each; rows are elevations, columns azimuths. They are
    the gradient and curvature of chi squared by the intensity that a source at the place sends in each direction.
    points and normals of `seen` are [3][n] here, in single precision: this takes a third of the time."""
    (x, y, z), normals = (axis - at for axis, at in zip(seen.points, place, strict=True)), seen.normals
    square = np.maximum(x * x + y * y + z * z, np.float32(1e-6))
    lit = seen.glow * np.maximum(-(x * normals[0] + y * normals[1] + z * normals[2]), 0) / (square * np.sqrt(square))
    lights = np.stack([lit * seen.fit_even_beam(lit), lit * lit * seen.weight])
    at = np.flatnonzero(lit > 0)
    x, y, z = (values.take(at) for values in (x, y, z))
    row = ((np.arctan2(y, np.sqrt(x * x + z * z)) + np.float32(np.pi / 2)) / np.float32(_STEP_RAD)).astype(np.int32)
    turn = np.arctan2(x, z) / np.float32(_STEP_RAD)
    column = np.minimum(np.where(turn < 0, turn + _COLUMNS, turn), _COLUMNS - 1).astype(np.int32)
    # Rows above the highest one go into a last one, which is dropped.
    row = np.minimum(row, _ROWS)
    for image, values in zip(images, lights.take(at, axis=1), strict=True):
        columns = image.shape[1]
        to = row * columns + column // (_COLUMNS // columns)
        image[:] = np.bincount(to, values, (_ROWS + 1) * columns).reshape(-1, columns)[:_ROWS]


def _spectra(drawn: np.ndarray, waves: int) -> list[tuple[slice, np.ndarray]]:
    """Returns the conjugate spectra around the circle of images [tilt][row][column], in blocks of tilts: (the rows that
    the block covers, [wave][row][tilt])."""
    blocks = []
    for first in range(0, len(drawn), _TILTS_TOGETHER):
        some = drawn[first : first + _TILTS_TOGETHER]
        covered = np.flatnonzero(some.any(axis=(0, 2)))
        rows = slice(covered[0], covered[-1] + 1) if covered.size else slice(0, 1)  # a pattern without dots
        spectrum = np.conj(fft.rfft(some[:, rows], axis=2)[..., :waves])
        blocks.append((rows, np.ascontiguousarray(spectrum.transpose(2, 1, 0))))
    return blocks


def _correlated(gathered: np.ndarray, conjugates: list[tuple[slice, np.ndarray]]) -> np.ndarray:
    """Correlates measured images of directions [place][row][column] with the pattern, drawn at each tilt. Returns
    [place][tilt][pan], with as many pans as columns. conjugates: _spectra() of the drawn patterns."""
    columns, waves = gathered.shape[2], len(conjugates[0][1])
    of_gathered = np.ascontiguousarray(fft.rfft(gathered, axis=2)[..., :waves].transpose(2, 0, 1))
    spectrum = np.concatenate([of_gathered[:, :, rows] @ block for rows, block in conjugates], axis=2)
    return fft.irfft(spectrum.transpose(1, 2, 0), columns, axis=2) * np.float32(columns / _COLUMNS)


_IMAGES, _COARSE_PIXELS, _FINE_PIXELS = 4, 10000, 20000
# The grid of places: its margin around the seen points, its step (blurred dots match within some 3 cm), the least
# distance to a seen point, and the number of places that are matched with the pattern. Where a room would need more
# than _MOST_OF_GRID places, the step grows.
_BEYOND_M, _STEP_M, _NEAR_M, _PLACES = 0.7, 0.05, 0.15, 5000
_MOST_OF_GRID = 200_000
# The pattern's blur (Gaussian, radians) and resolution (focal length, pixels) in the search and in the polish.
COARSE, _FINE = (4.0 / 592.0, 148.0), (2.0 / 592.0, 296.0)
_ROUGHLY_POLISHED, _POLISHED, _STARTS = 16, 3, 2
# Places that a rough polish and a polish try. A place within a few centimetres turns the pattern by a few degrees.
_ROUGH_TRIALS, _TRIALS, _MARGIN = 40, 90, 1.25
# Detail finer than this many pixels is dots or noise. Where its mean square is less than this multiple of the noise, no
# unit shows and nothing is searched. Noise grows with light that the model lacks, which is as smooth as the second
# scale. Speckle is at most this share of light. Detail that follows the model's own is fitted in blocks of _BLOCK_PX.
# Blocks with less own detail than _LEAST_DETAIL, in noise variances, fit nothing.
_FINE_PX, _SMOOTH_PX, _LEAST_CHI2, _MOST_SPECKLE = 4.0, 8.0, 1.08, 0.25
_BLOCK_PX, _LEAST_DETAIL = 32, 1e-3
# The least correlation of a place's light with the dots' size; below it nothing is searched. It is 0.33 to 0.49 where a
# unit shines, and 0.07 to 0.16 where the dots' size is random.
_LEAST_LIKENESS = 0.2
# Correlation with noise gives no such fall of chi2, even for the best of some 10^8 poses (2 ln 10^8 = 37).
_LEAST_GAIN = 100.0
_gain = itemgetter(0)


def room_unit_starts(images: list[StartImage]) -> list[dict[str, float]]:
    """Returns the projector's intensity and pose at the best few places, {parameter: value} each. Returns [{}], the
    neutral values, if the residual has no dots. The images in which the rig's own projector has its least power count:
    in others errors of its own dots pass for a unit's."""
    least = min((image.view.frame.projector_power for image in images), default=0.0)
    darkest = [image for image in images if image.view.frame.projector_power == least][:_IMAGES]
    if not darkest or np.mean([_fine_chi2(image) for image in darkest]) < _LEAST_CHI2:
        return [{}]
    seen, view = SeenPoints.of(darkest, _FINE_PIXELS), darkest[0].view
    few = seen.some(_COARSE_PIXELS)
    places = _likely_places(few)
    if len(places) == 0:
        return [{}]
    found = SphereMatch(view, *COARSE).best(few, places)
    coarse, exact = PlaneMatch(view, *COARSE, _MARGIN), PlaneMatch(view, *_FINE, _MARGIN)
    poses = [pose for _, pose in nlargest(_ROUGHLY_POLISHED, found, _gain)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        rough = pool.map(lambda pose: coarse.polished(few, pose, 0.02, _ROUGH_TRIALS), poses)
        best = nlargest(_POLISHED, rough, lambda pose: coarse.best(seen, pose)[0])
        near = pool.map(lambda pose: coarse.polished(seen, pose, 0.02, _TRIALS), best)
        starts = pool.map(lambda pose: exact.best(seen, exact.polished(seen, pose, 0.01, _TRIALS)), near)
    names = "x_m", "y_m", "z_m", "azimuth_rad", "elevation_rad", "roll_rad"
    return [
        {"intensity_m2": strength} | dict(zip(names, map(float, pose), strict=True))
        for gain, strength, pose in nlargest(_STARTS, starts, _gain)
        if gain > _LEAST_GAIN
    ] or [{}]


def _fine_chi2(image: StartImage) -> float:
    """Returns the mean square of the residual's fine part in units of its noise, about 1 where it is noise alone.

    A wrong gain, place or blur of the model's own dots leaves detail, too. In each block, the multiples of own detail,
    of its slopes and of its blurs that fit best are subtracted first. Light that the model lacks, such as a lamp's, has
    noise of its own. No noise grows faster than the square of light."""
    own, residual = image.expected, image.residual
    before = np.maximum(own, 0.0)
    after = before + np.maximum(gaussian_filter(residual, _SMOOTH_PX), 0.0)
    speckle = np.minimum(1.0 / np.maximum(image.weight * before**2, 1e-12), _MOST_SPECKLE**2)
    root = np.sqrt(image.weight / (1.0 + image.weight * speckle * (after**2 - before**2)))
    sizes = 1.0, 2.0, _FINE_PX
    blurs = -np.diff([own, *(gaussian_filter(own, size) for size in sizes)], axis=0)
    images = root * np.stack([*blurs, *np.gradient(own), residual - gaussian_filter(residual, _FINE_PX)])
    size, count = min(_BLOCK_PX, *own.shape), len(images)
    rows, columns = (n // size for n in own.shape)
    blocks = images[:, : rows * size, : columns * size].reshape(count, rows, size, columns, size).swapaxes(2, 3)
    *shapes, fine = blocks.reshape(count, rows * columns, size**2)
    A = np.stack(shapes, axis=-1)
    gram = A.transpose(0, 2, 1) @ A + _LEAST_DETAIL * np.eye(count - 1)
    fine -= (A @ np.linalg.solve(gram, A.transpose(0, 2, 1) @ fine[..., None]))[..., 0]
    return float(np.mean(fine**2)) * size**2 / (size**2 - count + 1)


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
