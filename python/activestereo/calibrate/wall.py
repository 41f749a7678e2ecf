# SPDX-License-Identifier: Apache-2.0
"""From spots of both cameras on a flat wall to points in space: the wall is a plane in disparity, and a spot's place
the best of both cameras."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from activestereo.calibrate.spots import Spots

_LARGEST_ROW_ERROR_PX = 1.0
_LEAST_MATCHED = 30
_LARGEST_OFF_PLANE_PX = 0.7
_ROUNDS = 8


@dataclass(frozen=True)
class Wall:
    """plane: [n, d] with n . X = d in the left camera's frame, metres. points [spot][3]: where the left spots lie.
    points_if_off [3][spot][3]: where they would lie, were the plane one standard deviation off in each of the three
    ways in which it errs independently. is_seen_by_both [spot]. flatness_px: RMS of the matched spots' disparity off
    the plane."""

    plane: np.ndarray
    points: np.ndarray
    points_if_off: np.ndarray
    is_seen_by_both: np.ndarray
    flatness_px: float

    @property
    def distance_m(self) -> float:
        """From the left camera, along the wall's normal."""
        return float(abs(self.plane[3]))


def find_wall(left: Spots, right: Spots, K: np.ndarray, right_K: np.ndarray, baseline_m: float, name: str) -> Wall:
    """The wall that rectified spots lie on. ValueError where too few match, or where what they lie on is not flat."""
    pairs = _pairs(left, right)
    if len(pairs) < _LEAST_MATCHED:
        raise ValueError(
            f"{name}: only {len(pairs)} dots have a row in common: are the images rectified, and left and right not "
            "swapped?"
        )
    i, j = pairs.T
    disparity = left.u[i] - right.u[j]
    column = np.column_stack([np.ones(len(left.u)), left.u - K[0, 2], left.v - K[1, 2]])
    coefficients = np.array([_common_disparity(disparity), 0.0, 0.0])
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
    # The left ray, with the right camera's opinion of its column: half of the disparity's deviation belongs to each.
    v = left.v.copy()
    v[both] = 0.5 * (v[both] + (right.v[match[both]] - right_K[1, 2]) * K[1, 1] / right_K[1, 1] + K[1, 2])

    def points_on(plane: np.ndarray) -> np.ndarray:
        u = left.u.copy()
        u[both] += 0.5 * (right.u[match[both]] + column[both] @ plane - left.u[both])
        ray = np.column_stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(len(u))])
        return ray / (ray @ _normal(plane, K, right_K, baseline_m))[:, None]

    normal = _normal(coefficients, K, right_K, baseline_m)
    if normal[2] <= 0:
        raise ValueError(
            f"{name}: the wall's disparity is {coefficients[0] - K[0, 2] + right_K[0, 2]:.2f} px: left and right are "
            "swapped, or the baseline's sign is wrong"
        )
    variances, ways = np.linalg.eigh(flatness**2 * np.linalg.inv(column[both].T @ column[both]))
    if_off = np.stack([points_on(coefficients + step) for step in (np.sqrt(variances) * ways).T])
    length = np.linalg.norm(normal)
    plane = np.append(normal / length, 1.0 / length)
    return Wall(plane, points_on(coefficients), if_off, both, flatness)


def wall_points(plane: np.ndarray, K: np.ndarray, camera_m: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """[n][3], in the left camera's frame: where rays of a camera at camera_m meet the plane [n, offset]."""
    ray = np.column_stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(len(u))])
    return np.asarray(camera_m + ((plane[3] - plane[:3] @ camera_m) / (ray @ plane[:3]))[:, None] * ray)


def _normal(coefficients: np.ndarray, K: np.ndarray, right_K: np.ndarray, baseline_m: float) -> np.ndarray:
    """n of n . X = 1: disparity = fx B / Z + cx - cx', so that a plane in it is a plane in space."""
    level = coefficients[0] - K[0, 2] + right_K[0, 2]
    return np.array([coefficients[1] * K[0, 0], coefficients[2] * K[1, 1], level]) / (K[0, 0] * baseline_m)


def _pairs(left: Spots, right: Spots) -> np.ndarray:
    """[pair][2] of spots whose rows agree and whose disparity is not negative."""
    rows = cKDTree(right.v[:, None])
    found = [
        (i, j) for i, near in enumerate(rows.query_ball_point(left.v[:, None], _LARGEST_ROW_ERROR_PX)) for j in near
    ]
    pairs = np.array(found).reshape(-1, 2)
    return pairs[left.u[pairs[:, 0]] > right.u[pairs[:, 1]] - 1.0]


def _common_disparity(disparity: np.ndarray) -> float:
    """The most frequent one; a tilted wall's are spread over a few pixels."""
    bins = np.arange(0.0, max(disparity.max(), 4.0) + 2.0, 0.5)
    tally = np.histogram(disparity, bins)[0].astype(float)
    chance = np.convolve(np.pad(tally, 40, mode="edge"), np.ones(81) / 81.0, mode="valid")
    score = np.convolve(tally - chance, np.ones(5), mode="same")
    return float(bins[int(np.argmax(score))] + 0.25)
