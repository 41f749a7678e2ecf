# SPDX-License-Identifier: Apache-2.0
"""Places the spots of both cameras on a flat wall in space, and measures the projector's light between its dots.

The wall is a plane in disparity, and a spot's position the best estimate from both cameras. Between the dots a camera
counts its black level, the room's light and the projector's light. Only the projector's light differs between walls at
two distances: it falls with the distance's square.

    counts = constant of the camera + background * (pattern pixels per camera pixel) / power_factor()
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from activestereo.calibrate.spots import Spots
from activestereo.common.lens import to_tangents

_LARGEST_ROW_ERROR_PX = 1.0
_LEAST_MATCHED = 30
_LARGEST_OFF_PLANE_PX = 0.7
_ROUNDS = 8


@dataclass(frozen=True)
class Wall:
    """A flat wall with spots. plane: [n, d] with n . X = d in the left camera's frame, metres. points: [spot, 3], of
    the left camera's spots. points_if_off: [3, spot, 3], the points if the plane were one standard deviation off, along
    each of its three independent errors. is_seen_by_both: mask of spots. flatness_px: RMS of the matched spots'
    disparity off the plane."""

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
        raise ValueError(
            f"{name}: only {len(pairs)} dots have a row in common: are the images rectified, and left and right not "
            "swapped?"
        )
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
    if both.sum() < max(_LEAST_MATCHED, 0.3 * len(left.u)):
        raise ValueError(
            f"{name}: only {both.sum()} of {len(left.u)} dots lie on one plane seen by both cameras: use a flat wall "
            "without objects, check K and the baseline, and that left and right are not swapped"
        )
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
        raise ValueError(
            f"{name}: the wall's disparity is {coefficients[0] - K[0, 2] + right_K[0, 2]:.2f} px: left and right are "
            "swapped, or the baseline's sign is wrong"
        )
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
    """Returns (counts, their gain per unit of background) of a wall's pixels within the pattern. background: [height,
    width], DN, the image without its dots. plane: [n, d] with n . X = d in the left camera's frame, metres. K,
    camera_m: the camera's K, and its origin in that frame. to_common: factor from this wall's powers to the first
    wall's."""
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
