# SPDX-License-Identifier: Apache-2.0
"""Finds the spots of a dot pattern in an image, locates those of both cameras on a flat wall in space, and measures the
projector's light between its dots.

All spots are fitted jointly as Gaussians; then the residual is searched for spots that were fitted as one.

    image = background + sum of a_i exp(-|x - x_i|^2 / (2 sigma^2)) + noise

All spots share one sigma. Positions, amplitudes and sigma are fitted by Gauss-Newton on a sparse Jacobian, weighted by
the noise.

The wall is a plane, so disparity is linear in the pixel. A spot's position combines both cameras' measurements. Between
the dots a camera counts its black level, the room's light and the projector's light. Only the projector's light differs
between walls at two distances: it falls with the square of the distance.

    counts = constant of the camera + background * (pattern pixels per camera pixel) / power_factor()
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_laplace, maximum_filter, minimum_filter
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import lsqr
from scipy.spatial import cKDTree

from activestereo.common.lens import to_tangents
from activestereo.common.parabola import vertex
from activestereo.common.progress_bar import Progress, silent

_SCALES_PX = (0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0)
_LEAST_SPOTS = 50
# A spot's response is at least this share of the strong spots' around it, and this many deviations above noise.
_LEAST_RESPONSE, _LEAST_MERGED, _SIGNIFICANT = 0.12, 0.12, 5.0
_TILE_PX = 64
_LEAST_AMPLITUDE = 0.15
_FIRST_STEPS, _PEEL_STEPS, _PEELS, _LAST_STEPS = 5, 3, 3, 4
_LARGEST_STEP_PX = 0.4
_LSQR_STEPS = 40
# A spot's middle lies at most this far outside the image, in sigmas.
_OUTSIDE = 1.5
# Two spots closer than this, in sigmas, are merged.
_ONE_SPOT = 0.9


@dataclass(frozen=True)
class Spots:
    """Spots of an image. u, v: centres, pixels. flux: a spot's integral, DN px^2. sigma_px: the common width, which
    includes the pixel's own blur. background: the image without spots, DN [height, width]."""

    u: np.ndarray
    v: np.ndarray
    flux: np.ndarray
    sigma_px: float
    background: np.ndarray

    def __len__(self) -> int:
        return len(self.u)

    @property
    def border_px(self) -> int:
        """Distance from the image's border, pixels, within which the border cuts off part of a spot."""
        return _reach(self.sigma_px)

    @property
    def is_whole(self) -> np.ndarray:
        """Mask of the spots that the border does not cut, whose position and flux are therefore reliable."""
        height, width = self.background.shape
        border = self.border_px
        across = (self.u > border) & (self.u < width - 1 - border)
        return np.asarray(across & (self.v > border) & (self.v < height - 1 - border))

    def selected(self, which: np.ndarray) -> Spots:
        return replace(self, u=self.u[which], v=self.v[which], flux=self.flux[which])


def find_spots(image: np.ndarray, variance: np.ndarray, progress: Progress = silent) -> Spots:
    """Finds the spots of an averaged image [height, width], DN, including those that its border cuts. variance: of its
    pixels, DN^2. Raises ValueError for fewer than 50 spots."""
    image = np.asarray(image, dtype=np.float64)
    # 1. Find the scale of the strong spots' largest response (Lindeberg 1998: a Gaussian's is at its own sigma).
    first = -gaussian_laplace(image, 1.25)
    v, u = _peaks(first, np.full(image.shape, 0.0))
    order = np.argsort(-first[v, u])[: max(len(u) // 4, 1)]
    answer = [np.median(-(scale**2) * gaussian_laplace(image, scale)[v[order], u[order]]) for scale in _SCALES_PX]
    sigma = float(_SCALES_PX[int(np.argmax(answer))])
    # 2. Peaks of the response at this scale, each moved to its parabola's top.
    size = int(np.ceil(12.0 * sigma)) | 1
    background = gaussian_filter(minimum_filter(gaussian_filter(image, 0.6 * sigma), size), 0.5 * size)
    response = -gaussian_laplace(image, sigma)
    noise = _response_noise(variance, sigma)
    # The 90th percentile of the peaks around each pixel, smooth.
    is_peak = (response == maximum_filter(response, 3)) & (response > 0)
    (height, width), whole = image.shape, np.quantile(response[is_peak], 0.9) if is_peak.any() else 0.0
    tiles = np.full((-(-height // _TILE_PX), -(-width // _TILE_PX)), whole)
    for r, c in np.ndindex(*tiles.shape):
        part = np.s_[r * _TILE_PX : (r + 1) * _TILE_PX, c * _TILE_PX : (c + 1) * _TILE_PX]
        if is_peak[part].sum() >= 8:
            tiles[r, c] = np.quantile(response[part][is_peak[part]], 0.9)
    strong = gaussian_filter(np.kron(tiles, np.ones((_TILE_PX, _TILE_PX)))[:height, :width], 0.5 * _TILE_PX)
    v, u = _peaks(response, np.maximum(_LEAST_RESPONSE * strong, _SIGNIFICANT * noise))
    if len(u) < _LEAST_SPOTS:
        told = f"only {len(u)} dots are seen, at least {_LEAST_SPOTS} are needed"
        raise ValueError(f"{told}: is the projector on, and the wall in focus?")
    wide = np.pad(response, 1, mode="edge")  # the border's last pixel is repeated
    here = wide[v + 1, u + 1]
    across, down = vertex(wide[v + 1, u], here, wide[v + 1, u + 2]), vertex(wide[v, u + 1], here, wide[v + 2, u + 1])
    # 3. Fit all spots, then search the residual for merged ones.
    fit = _Fit(image, background, variance, sigma)
    fit.add(u + across, v + down)
    fit.run(_FIRST_STEPS)
    progress(0.3)
    for peel in range(_PEELS):
        scale = 0.8 * fit.sigma
        left = -gaussian_laplace(fit.residual(), scale)
        v, u = _peaks(left, np.maximum(_LEAST_MERGED * strong, _SIGNIFICANT * _response_noise(variance, scale)))
        fit.add(u.astype(float), v.astype(float))
        fit.run(_PEEL_STEPS)
        fit.drop_weak()
        progress(0.3 + 0.2 * (peel + 1))
    fit.run(_LAST_STEPS)
    fit.drop_weak()
    progress(1.0)
    return Spots(fit.u, fit.v, 2.0 * np.pi * fit.sigma**2 * fit.amplitude, float(fit.sigma), fit.background)


class _Fit:
    """A joint least-squares fit of all spots, their common width and a smooth background to an image."""

    def __init__(self, image: np.ndarray, background: np.ndarray, variance: np.ndarray, sigma: float) -> None:
        self.image, self.background, self.sigma = image, background, sigma
        self.deviation = np.sqrt(variance)
        self.weight = 1.0 / self.deviation
        self.u, self.v, self.amplitude = np.empty(0), np.empty(0), np.empty(0)

    def add(self, u: np.ndarray, v: np.ndarray) -> None:
        left = self.residual()
        at = left[self._pixel(u, v)]
        self.u, self.v, self.amplitude = np.r_[self.u, u], np.r_[self.v, v], np.r_[self.amplitude, np.maximum(at, 0.3)]

    def _pixel(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the row and column of the nearest pixel inside the image."""
        height, width = self.image.shape
        return np.rint(v).astype(int).clip(0, height - 1), np.rint(u).astype(int).clip(0, width - 1)

    def _patches(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Returns (pixel numbers, offsets in u, offsets in v, the spot's Gaussian), each [spot, pixel of the patch
        around it]. The Gaussian is 0 outside the image."""
        reach, (height, width) = _reach(self.sigma), self.image.shape
        y, x = (part.ravel() for part in np.mgrid[-reach : reach + 1, -reach : reach + 1])
        column, row = np.rint(self.u).astype(int)[:, None] + x, np.rint(self.v).astype(int)[:, None] + y
        du, dv = column - self.u[:, None], row - self.v[:, None]
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        column, row = column.clip(0, width - 1), row.clip(0, height - 1)
        return row * width + column, du, dv, inside * np.exp(-0.5 * (du**2 + dv**2) / self.sigma**2)

    def residual(self) -> np.ndarray:
        if not len(self.u):
            return self.image - self.background
        pixel, _, _, gauss = self._patches()
        model = np.bincount(pixel.ravel(), (self.amplitude[:, None] * gauss).ravel(), self.image.size)
        return self.image - self.background - model.reshape(self.image.shape)

    def run(self, steps: int) -> None:
        """Makes Gauss-Newton steps. After each, the smooth part of the residual moves to the background."""
        for _ in range(steps):
            pixel, du, dv, gauss = self._patches()
            count, of = len(self.u), np.repeat(np.arange(len(self.u)), gauss.shape[1])
            high = self.amplitude[:, None] * gauss / self.sigma**2
            wide = high * (du**2 + dv**2) / self.sigma
            values = np.concatenate([gauss.ravel(), (high * du).ravel(), (high * dv).ravel(), wide.ravel()])
            columns = np.concatenate([of, of + count, of + 2 * count, np.full(of.size, 3 * count)])
            places, shape = (np.tile(pixel.ravel(), 4), columns), (self.image.size, 3 * count + 1)
            weighted = diags(self.weight.ravel()) @ csr_matrix((values, places), shape=shape)
            # Columns of equal norm, with which the solver needs few steps.
            size = np.sqrt(np.asarray(weighted.multiply(weighted).sum(axis=0)).ravel()) + 1e-9
            left = (self.weight * self.residual()).ravel()
            step = lsqr(weighted @ diags(1.0 / size), left, damp=0.02, iter_lim=_LSQR_STEPS)[0] / size
            self.amplitude = np.maximum(self.amplitude + step[:count], 0.05)
            height, width = self.image.shape
            outside = _OUTSIDE * self.sigma
            u = self.u + np.clip(step[count : 2 * count], -_LARGEST_STEP_PX, _LARGEST_STEP_PX)
            v = self.v + np.clip(step[2 * count : 3 * count], -_LARGEST_STEP_PX, _LARGEST_STEP_PX)
            self.u, self.v = u.clip(-outside, width - 1 + outside), v.clip(-outside, height - 1 + outside)
            self.sigma = float(np.clip(self.sigma + np.clip(step[-1], -0.1, 0.1), 0.4, 8.0))
            self.background = self.background + gaussian_filter(self.residual(), 6.0 * self.sigma)

    def drop_weak(self) -> None:
        """Drops spots far weaker than their neighbours or within the noise, and merges spots closer than 0.9 sigma."""
        tree = cKDTree(np.column_stack([self.u, self.v]))
        _, near = tree.query(tree.data, k=min(30, len(self.u)))
        keep = self.amplitude > _LEAST_AMPLITUDE * np.median(self.amplitude[near], axis=1)
        # The amplitude's error from noise alone; a Gaussian's square sums to pi sigma^2 over the pixels.
        error = self.deviation[self._pixel(self.u, self.v)] / (np.sqrt(np.pi) * self.sigma)
        keep &= self.amplitude > _SIGNIFICANT * error
        for a, b in tree.query_pairs(_ONE_SPOT * self.sigma):
            if keep[a] and keep[b]:
                strong, weak = (a, b) if self.amplitude[a] >= self.amplitude[b] else (b, a)
                share = self.amplitude[weak] / (self.amplitude[a] + self.amplitude[b])
                self.u[strong] += share * (self.u[weak] - self.u[strong])
                self.v[strong] += share * (self.v[weak] - self.v[strong])
                self.amplitude[strong] += self.amplitude[weak]
                keep[weak] = False
        self.u, self.v, self.amplitude = self.u[keep], self.v[keep], self.amplitude[keep]


def _reach(sigma: float) -> int:
    """Returns the radius in pixels of the patch on which a spot is drawn."""
    return int(np.ceil(3.5 * sigma))


def _response_noise(variance: np.ndarray, sigma: float) -> np.ndarray:
    """Returns the standard deviation that pixel noise of this variance causes in the response of a Laplacian of
    Gaussian, from the sampled filter's energy. For a sigma well above a pixel the energy is 1 / (2 pi sigma^6)."""
    impulse = np.zeros((31, 31))
    impulse[15, 15] = 1.0
    energy = float(np.sum(gaussian_laplace(impulse, sigma) ** 2))
    return np.sqrt(gaussian_filter(variance, 2.0 * sigma) * energy)


def _peaks(response: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns (rows, columns) of local maxima above `least`."""
    rows, columns = np.nonzero((response == maximum_filter(response, 3)) & (response > least))
    return rows, columns


_LARGEST_ROW_ERROR_PX = 1.0
_LEAST_MATCHED = 30
_LARGEST_OFF_PLANE_PX = 0.7
_ROUNDS = 8


@dataclass(frozen=True)
class Wall:
    """A flat wall with spots. plane: [n, d] with n . X = d in the left camera's frame, metres. points: [spot, 3], of
    the left camera's spots. points_if_off: [3, spot, 3]. The plane's error has three independent components; these are
    the points after a shift of each by one standard deviation. is_seen_by_both: mask of spots. flatness_px: RMS
    distance of the matched spots' disparities from the plane."""

    plane: np.ndarray
    points: np.ndarray
    points_if_off: np.ndarray
    is_seen_by_both: np.ndarray
    flatness_px: float

    @property
    def distance_m(self) -> float:
        """Distance from the left camera along the wall's normal."""
        return float(abs(self.plane[3]))


def find_wall(left: Spots, right: Spots, K: np.ndarray, right_K: np.ndarray, baseline_m: float, name: str) -> Wall:
    """Finds the wall's plane from the spots of a rectified pair of images. K, right_K: 3x3 of the left and the right
    camera. Raises ValueError, which begins with `name`, if too few spots match or if they do not lie on a plane."""
    # 1. Pairs of spots whose rows agree and whose disparity is not negative.
    near_rows = cKDTree(right.v[:, None]).query_ball_point(left.v[:, None], _LARGEST_ROW_ERROR_PX)
    pairs = np.array([(i, j) for i, near in enumerate(near_rows) for j in near]).reshape(-1, 2)
    pairs = pairs[left.u[pairs[:, 0]] > right.u[pairs[:, 1]] - 1.0]
    if len(pairs) < _LEAST_MATCHED:
        told = f"only {len(pairs)} pairs of dots lie in one row, at least {_LEAST_MATCHED} are needed"
        raise ValueError(f"{name}: {told}: are the images rectified, and left and right not swapped?")
    i, j = pairs.T
    disparity = left.u[i] - right.u[j]
    column = np.column_stack([np.ones(len(left.u)), left.u - K[0, 2], left.v - K[1, 2]])
    # 2. Fit the plane, starting at the most frequent disparity; a tilted wall's disparities spread over a few pixels.
    bins = np.arange(0.0, max(disparity.max(), 4.0) + 2.0, 0.5)
    tally = np.histogram(disparity, bins)[0].astype(float)
    chance = np.convolve(np.pad(tally, 40, mode="edge"), np.ones(81) / 81.0, mode="valid")
    score = np.convolve(tally - chance, np.ones(5), mode="same")
    coefficients = np.array([float(bins[int(np.argmax(score))] + 0.25), 0.0, 0.0])
    reach = 4.0
    for _ in range(_ROUNDS):
        off = disparity - column[i] @ coefficients
        near = np.abs(off) < reach
        if near.sum() < _LEAST_MATCHED:
            break
        coefficients = np.linalg.lstsq(column[i][near], disparity[near], rcond=None)[0]
        deviation = 1.4826 * np.median(np.abs(disparity[near] - column[i][near] @ coefficients))
        reach = float(np.clip(6.0 * deviation, 0.3, reach))
    off = disparity - column[i] @ coefficients
    order = np.argsort(np.abs(off))
    near = order[np.abs(off[order]) < min(reach, _LARGEST_OFF_PLANE_PX)]
    both = np.zeros(len(left.u), dtype=bool)
    match = np.full(len(left.u), -1)
    for place in near[::-1]:  # the nearest to the plane is written last
        both[i[place]], match[i[place]] = True, j[place]
    least = np.ceil(max(_LEAST_MATCHED, 0.3 * len(left.u)))
    if both.sum() < least:
        told = f"only {both.sum()} of {len(left.u)} dots lie on one plane seen by both cameras, {least:.0f} are needed"
        remedy = "use a flat wall without objects, check K and the baseline, and that left and right are not swapped"
        raise ValueError(f"{name}: {told}: {remedy}")
    flatness = float(np.sqrt(np.mean((left.u[both] - right.u[match[both]] - column[both] @ coefficients) ** 2)))
    # Correct the left ray by half of the disparity's deviation from the plane; the other half is the right camera's.
    v = left.v.copy()
    v[both] = 0.5 * (v[both] + (right.v[match[both]] - right_K[1, 2]) * K[1, 1] / right_K[1, 1] + K[1, 2])

    def placed(plane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Converts a plane in disparity [3] to space: returns (n [3] of n . X = 1, the left spots' points [n, 3]).
        Disparity is fx B / Z + cx - cx', so it is a plane, too."""
        slope = np.array([plane[1] * K[0, 0], plane[2] * K[1, 1], plane[0] - K[0, 2] + right_K[0, 2]])
        normal, u = slope / (K[0, 0] * baseline_m), left.u.copy()
        u[both] += 0.5 * (right.u[match[both]] + column[both] @ plane - left.u[both])
        ray = np.column_stack([*to_tangents(u, v, K), np.ones(len(u))])
        return normal, ray / (ray @ normal)[:, None]

    normal, points = placed(coefficients)
    if normal[2] <= 0:
        told = f"the wall's disparity is {coefficients[0] - K[0, 2] + right_K[0, 2]:.2f} px"
        raise ValueError(f"{name}: {told}: left and right are swapped, or the baseline's sign is wrong")
    variances, ways = np.linalg.eigh(flatness**2 * np.linalg.inv(column[both].T @ column[both]))
    if_off = np.stack([placed(coefficients + step)[1] for step in (np.sqrt(variances) * ways).T])
    length = np.linalg.norm(normal)
    plane = np.append(normal / length, 1.0 / length)
    return Wall(plane, points, if_off, both, flatness)


def wall_points(plane: np.ndarray, K: np.ndarray, camera_m: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Intersects rays through the pixels u, v of a camera at camera_m with the plane [n, d]. Returns points [n, 3] in
    the left camera's frame."""
    ray = np.column_stack([*to_tangents(u, v, K), np.ones(len(u))])
    return np.asarray(camera_m + ((plane[3] - plane[:3] @ camera_m) / (ray @ plane[:3]))[:, None] * ray)


# Pixels between samples, and the width of the border strips of image and pattern that are left out: a filter found the
# background, and it is too low there.
_STRIDE_PX, _BORDER_PX = 4, 24
_OUTLIER = 4.0  # in median absolute deviations


@dataclass(frozen=True)
class ProjectorView:
    """The projector's geometry: its origin in the left camera's frame, the rotation from there to its own axes, its K,
    and the pattern's (width, height) in pixels."""

    position_m: NDArray[np.float64]
    rotation: NDArray[np.float64]
    K: NDArray[np.float64]
    size: tuple[int, int]

    def pixels(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Projects points [n, 3] in the left camera's frame. Returns (pattern pixels u, v [n, 2], beams [n, 3] in the
        projector's axes)."""
        beam = (points - self.position_m) @ self.rotation.T
        u = self.K[0, 0] * beam[:, 0] / beam[:, 2] + self.K[0, 2]
        v = self.K[1, 1] * beam[:, 1] / beam[:, 2] + self.K[1, 2]
        return np.column_stack([u, v]), beam


def power_factor(
    points: NDArray[np.float64], normal: NDArray[np.float64], beam: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the factor that converts a spot's flux in the camera to its integral over the pattern's pixels, up to a
    constant. points: [n, 3] from the camera.

    A matt wall turns a beam's power, watts, into the same radiance times area, whatever the beam's angle. The camera
    integrates it over du dv = f^2 dOmega / cos^3 a with dOmega = dA cos(c) / r^2. Here a is its angle off the axis and
    c off the wall's normal. The pattern holds power per solid angle, over du dv = f^2 dOmega / cos^3 b."""
    distance = np.linalg.norm(points, axis=1)
    off_axis, off_normal = points[:, 2] / distance, np.abs(points @ normal) / distance
    off_beam = beam[:, 2] / np.linalg.norm(beam, axis=1)
    return np.asarray(distance**2 * off_axis**3 / (off_normal * off_beam**3))


def light_between_dots(counts: NDArray[np.float64], shares: NDArray[np.float64]) -> float:
    """Fits the projector's light between its dots, per square pixel of the pattern, in the unit of the dots' powers.
    counts, shares: background_samples() of one camera for all walls, concatenated."""
    columns = np.column_stack([np.ones(len(shares)), shares])
    use = np.ones(len(shares), dtype=bool)
    for _ in range(3):
        solution = np.linalg.lstsq(columns[use], counts[use], rcond=None)[0]
        off = np.abs(counts - columns @ solution)
        use = off <= _OUTLIER * 1.4826 * np.median(off[use])
    return float(solution[1])


def background_samples(
    background: NDArray[np.float64], plane: NDArray[np.float64], K: NDArray[np.float64], camera_m: NDArray[np.float64],
    to_common: float, projector: ProjectorView,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """Returns (counts, gains) of a wall's pixels within the pattern. A gain is the count per unit of the pattern's
    light between dots. background: [height, width], DN, the image without its dots. plane: [n, d] with n . X = d in the
    left camera's frame, metres. K, camera_m: the camera's K, and its origin in that frame. to_common: factor from this
    wall's powers to the first wall's."""
    height, width = background.shape
    rows, columns = (np.arange(_BORDER_PX, size - _BORDER_PX, _STRIDE_PX) for size in (height, width))
    v, u = (part.ravel() for part in np.meshgrid(rows, columns, indexing="ij"))
    points = wall_points(plane, K, camera_m, u, v)
    place, beam = projector.pixels(points)
    nexts = (wall_points(plane, K, camera_m, *shifted) for shifted in ((u + 1, v), (u, v + 1)))
    along_u, along_v = (projector.pixels(shifted)[0] - place for shifted in nexts)
    pattern_pixels = np.abs(along_u[:, 0] * along_v[:, 1] - along_u[:, 1] * along_v[:, 0])
    margin = _BORDER_PX * np.sqrt(pattern_pixels)[:, None]
    inside = np.all((place > margin) & (place < np.array(projector.size) - margin), axis=1)
    shares = pattern_pixels / (power_factor(points - camera_m, plane[:3], beam) * to_common)
    return background[v, u][inside], shares[inside]
