# SPDX-License-Identifier: Apache-2.0
"""The pose of a CAD part from its contours in all views together, without markers and without depth.

A wide search scores poses by how near contours lie to image edges of the same direction (chamfer matching by direction,
Liu et al., CVPR 2010), by the cross-entropy method (Rubinstein 1999) with contours rendered again after each round.
Then Gauss-Newton on the distance of contours to the strongest edge across them (Drummond and Cipolla, PAMI 2002), with
Tukey's weights. A direction that no contour resists is free: the part is symmetric about it.

Intervals are the jackknife's over the camera's places (Miller, Biometrika 1974): what one place of the camera errs in,
a highlight taken for an edge or a contour that a shadow moves, is the same for all of its contour points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates, maximum_filter
from scipy.spatial.transform import Rotation
from scipy.stats import t as student_t

from activestereo.calibrate.object_contours import Contours, PartRenderer
from activestereo.calibrate.object_views import View, gradient
from activestereo.scene_io.meshes import Mesh

_DIRECTIONS = 6
_FARTHEST_PX = 30.0
_EDGE_SHARE = 0.12  # of an image's pixels that count as edges
# Rounds of the wide search: reach of an edge in pixels, deviations of the start in metres and degrees.
_ROUNDS = ((10.0, 0.012, 3.5), (6.0, 0.008, 2.5), (3.0, 0.004, 1.5))
_GENERATIONS, _POPULATION, _ELITE = 6, 256, 24
_FINE_RANGES_PX = (6.0, 5.0, 4.0, 3.0, 3.0, 2.5, 2.5, 2.5)
_FREE = 0.015  # of the largest eigenvalue: facets of a round part give 0.004, a box has 0.13
# With fewer places of the camera intervals rest on the residuals: neighbouring contour points see the same edge, and so
# many tell as much as one.
_LEAST_PLACES, _ALIKE = 4, 8.0
# What all places err in alike, a deviation in pixels: a contour's place in the supersampled image, shade where a part
# touches the table. The root mean square of what tests/bench/bench_pose.py finds on boxes of four materials, 0.07 to
# 0.2 px.
_COMMON_PX = 0.14


@dataclass(frozen=True)
class PartPose:
    """part_to_world; error_m, error_deg: half widths of 90 % intervals, of the largest direction that is not free;
    free_axes: unit vectors in the part's frame about which it may be turned; matched: share of contours with an edge;
    views: in which it is seen."""

    part_to_world: NDArray[np.float64]
    error_m: float
    error_deg: float
    free_axes: tuple[NDArray[np.float64], ...]
    residual_px: float
    matched: float
    views: int


def refine_pose(
    mesh: Mesh,
    views: Sequence[View],
    start: NDArray[np.float64],
    seed: int = 0,
    progress: Callable[[float], object] | None = None,
) -> PartPose:
    """start: part_to_world within about 2 cm and 5 degrees. ValueError where no view sees the part."""
    fit = _Fit(mesh, views, seed)
    tell = progress or (lambda fraction: None)
    pose = np.array(start, dtype=np.float64)
    for number, (reach_px, sigma_m, sigma_deg) in enumerate(_ROUNDS):
        pose = fit.search(pose, reach_px, sigma_m, np.deg2rad(sigma_deg))
        tell(0.7 * (number + 1) / len(_ROUNDS))
    for number, reach_px in enumerate(_FINE_RANGES_PX):
        pose = fit.step(pose, reach_px)
        tell(0.7 + 0.3 * (number + 1) / len(_FINE_RANGES_PX))
    return fit.result(pose)


@dataclass(frozen=True)
class _Step:
    """The limits of a step of Gauss-Newton, in turns times the part's radius and shifts, m. free: [6][k], directions
    that no contour resists; extent: [6][6], covariance times the square of a 90 % interval's half width in
    deviations."""

    free: NDArray[np.float64]
    extent: NDArray[np.float64]
    rms_px: float


class _Fit:
    def __init__(self, mesh: Mesh, views: Sequence[View], seed: int) -> None:
        self._part, self._views = PartRenderer(mesh), views
        low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
        self._centre = 0.5 * (low + high).astype(np.float64)
        self._radius = 0.5 * float(np.linalg.norm(high - low))
        self._random = np.random.default_rng(seed)
        self._gradients = [gradient(view) for view in views]
        self._distances = [_distances(*pair) for pair in self._gradients]
        names = [np.round(view.frame.camera_to_world, 7).tobytes() for view in views]
        self._places = [names.index(name) for name in names]  # views of one place of the camera have one number
        self._last: _Step | None = None

    def search(self, pose: NDArray, reach_px: float, sigma_m: float, sigma_rad: float) -> NDArray:
        """The best pose about one, with its contours."""
        contours = self._contours(pose)
        nearness = [np.exp(-0.5 * (distances / reach_px) ** 2) for distances in self._distances]
        mean, spread = np.zeros(6), np.diag([sigma_rad**2] * 3 + [sigma_m**2] * 3)
        best, best_score = mean, self._scores(mean[None], contours, pose, nearness)[0]
        for _ in range(_GENERATIONS):
            drawn = self._random.multivariate_normal(mean, spread, _POPULATION)
            scores = self._scores(drawn, contours, pose, nearness)
            elite = drawn[np.argsort(scores)[-_ELITE:]]
            if scores.max() > best_score:
                best, best_score = drawn[np.argmax(scores)], float(scores.max())
            mean = elite.mean(axis=0)
            floor = np.diag([(0.05 * sigma_rad) ** 2] * 3 + [(0.05 * sigma_m) ** 2] * 3)
            spread = np.cov(elite.T) + floor
        return self._moved(pose, best)

    def step(self, pose: NDArray, reach_px: float) -> NDArray:
        """One step of Gauss-Newton."""
        contours = self._contours(pose)
        rows, rest, weights, places = [], [], [], []
        total = 0
        for place, view, pair, found in zip(self._places, self._views, self._gradients, contours, strict=True):
            if found is None:
                continue
            offsets, strength = _nearest_edges(*pair, found, reach_px)
            total += len(offsets)
            kept = np.isfinite(offsets)
            places.append(np.full(kept.sum(), place))
            rows.append(self._jacobian(view, pose, found)[kept])
            rest.append(offsets[kept])
            weights.append(found.weights[kept] * strength[kept])
        A, r, w = np.concatenate(rows), np.concatenate(rest), np.concatenate(weights)
        scale = max(1.4826 * float(np.median(np.abs(r))), 0.15)
        u = r / (4.0 * scale)
        w = w * np.where(np.abs(u) < 1.0, (1.0 - u**2) ** 2, 0.0)
        weighted, of_place = A * w[:, None], np.concatenate(places)
        chosen = [of_place == place for place in np.unique(of_place)]
        each_H = np.array([weighted[part].T @ A[part] for part in chosen])
        each_b = np.array([weighted[part].T @ r[part] for part in chosen])
        H, b = each_H.sum(axis=0), each_b.sum(axis=0)
        values, vectors = np.linalg.eigh(H)
        is_free = values <= _FREE * values[-1]
        held = vectors[:, ~is_free]
        delta = held @ ((held.T @ b) / values[~is_free])
        rms = float(np.sqrt((w * r**2).sum() / max(w.sum(), 1e-9)))
        if len(chosen) < _LEAST_PLACES:
            spread, reach = held @ np.diag(_ALIKE * rms**2 / values[~is_free]) @ held.T, student_t.ppf(0.95, np.inf)
        else:
            spread, reach = _jackknife(each_H, each_b, held), student_t.ppf(0.95, len(chosen) - 1)
        self._last = _Step(vectors[:, is_free], spread * reach**2, rms)
        self._matched = float((w > 0).sum()) / max(total, 1)
        limit = np.array([0.03] * 3 + [0.006] * 3)
        delta[:3] /= self._radius
        return self._moved(pose, np.clip(delta, -limit, limit))

    def result(self, pose: NDArray) -> PartPose:
        assert self._last is not None
        step = self._last
        common_m = student_t.ppf(0.95, np.inf) * _COMMON_PX * self._m_per_px(pose)
        turn, move = (
            np.hypot(np.sqrt(np.linalg.eigvalsh(step.extent[s, s])[-1]), common_m) for s in (slice(0, 3), slice(3, 6))
        )
        axes = tuple(v[:3] / np.linalg.norm(v[:3]) for v in step.free.T if np.linalg.norm(v[:3]) > 0.5)
        seen = sum(found is not None for found in self._contours(pose))
        return PartPose(
            pose,
            float(move),
            float(np.rad2deg(turn / self._radius)),
            axes,
            step.rms_px,
            self._matched,
            seen,
        )

    # ---- inside ----

    def _m_per_px(self, pose: NDArray) -> float:
        """Metres per pixel at the part's middle, over the views."""
        middle = np.append(self._centre, 1.0)
        away = [(np.linalg.inv(view.camera_to_world) @ pose @ middle)[2] / view.K[0, 0] for view in self._views]
        return float(np.median(np.abs(away)))

    def _contours(self, pose: NDArray) -> list[Contours | None]:
        found = self._part.contours(self._views, pose)
        if all(contours is None for contours in found):
            raise ValueError(
                f"the part is out of view in all {len(found)} images at its start: give --start, or check the poses"
            )
        return found

    def _moved(self, pose: NDArray, delta: NDArray) -> NDArray:
        """pose with a turn (rad) and a shift (m) in the part's frame, about its centre."""
        change = np.eye(4)
        change[:3, :3] = Rotation.from_rotvec(delta[:3]).as_matrix()
        change[:3, 3] = delta[3:] + self._centre - change[:3, :3] @ self._centre
        return np.asarray(pose @ change)

    def _scores(
        self, deltas: NDArray, contours: list[Contours | None], pose: NDArray, nearness: list[NDArray[np.float32]]
    ) -> NDArray:
        """[n]: mean over views of how near contours lie to edges, 0..1. nearness: of each view
        [direction][height][width]."""
        turns = Rotation.from_rotvec(deltas[:, :3]).as_matrix()
        out, count = np.zeros(len(deltas)), 0
        for view, near, found in zip(self._views, nearness, contours, strict=True):
            if found is None:
                continue
            there = np.linalg.inv(view.camera_to_world) @ pose
            KR = view.K @ there[:3, :3]
            place = (self._centre + deltas[:, 3:]) @ KR.T + view.K @ there[:3, 3]
            from_centre = (found.points - self._centre).T.astype(np.float32)
            uvw = (KR @ turns).astype(np.float32) @ from_centre + place[:, :, None].astype(np.float32)
            # The contour's place rests on the supersampled image: its own rounding is kept.
            home = found.points @ KR.T + view.K @ there[:3, 3]
            rounding = (found.places - home[:, :2] / home[:, 2:]).T.astype(np.float32)
            uv = np.rint(uvw[:, :2] / uvw[:, 2:] + rounding)
            width, height = view.size
            u, v = uv[:, 0].clip(0, width - 1).astype(int), uv[:, 1].clip(0, height - 1).astype(int)
            place_in_map = (_direction(found.normals) * height + v) * width + u
            out += near.ravel().take(place_in_map) @ found.weights / found.weights.sum()
            count += 1
        return out / max(count, 1)

    def _jacobian(self, view: View, pose: NDArray, found: Contours) -> NDArray:
        """[n][6]: how far a contour moves along its normal, px, with a turn (times the part's radius, m) and a shift
        (m)."""
        there = np.linalg.inv(view.camera_to_world) @ pose
        R, points = there[:3, :3], found.points
        Y = points @ R.T + there[:3, 3]
        fx, fy, s = view.K[0, 0], view.K[1, 1], view.K[0, 1]
        x, y, z = Y.T
        across = found.normals[:, :1] * np.stack([fx / z, s / z, -(fx * x + s * y) / z**2], axis=1)
        down = found.normals[:, 1:] * np.stack([0 * z, fy / z, -fy * y / z**2], axis=1)
        move = (across + down) @ R
        arm = points - self._centre
        turn = np.cross(arm, move)
        return np.concatenate([turn / self._radius, move], axis=1)


def _jackknife(each_H: NDArray, each_b: NDArray, held: NDArray) -> NDArray:
    """Covariance of a step's solution, [6][6], from how it changes when one place of the camera is left out. each_H
    [place][6][6], each_b [place][6]: normal equations; held [6][k]: the directions that are determined."""
    rest_H = held.T @ (each_H.sum(axis=0) - each_H) @ held
    rest_b = (each_b.sum(axis=0) - each_b) @ held
    without = np.linalg.solve(rest_H, rest_b[..., None])[..., 0]
    off = without - without.mean(axis=0)
    count = len(each_H)
    return np.asarray(held @ ((count - 1) / count * off.T @ off) @ held.T)


def _direction(normals: NDArray) -> NDArray:
    angle = np.arctan2(normals[:, 1], normals[:, 0]) % np.pi
    return np.rint(angle / np.pi * _DIRECTIONS).astype(int) % _DIRECTIONS


def _distances(across: NDArray, down: NDArray) -> NDArray[np.float32]:
    """[direction][height][width]: px to the next edge of this direction or one beside it."""
    size = np.hypot(across, down)
    threshold = max(float(np.quantile(size, 1.0 - _EDGE_SHARE)), 1e-4)
    angle = np.arctan2(down, across) % np.pi
    # Thinned: larger than both neighbours across the edge.
    v, u = np.mgrid[0 : size.shape[0], 0 : size.shape[1]].astype(np.float32)
    unit = np.stack([across, down]) / np.maximum(size, 1e-9)
    beside = [map_coordinates(size, [v + s * unit[1], u + s * unit[0]], order=1, mode="nearest") for s in (-1, 1)]
    edge = (size > threshold) & (size >= beside[0]) & (size >= beside[1])
    number = np.rint(angle / np.pi * _DIRECTIONS).astype(int) % _DIRECTIONS
    out = np.full((_DIRECTIONS, *size.shape), _FARTHEST_PX, np.float32)
    for k in range(_DIRECTIONS):
        apart = np.abs(number - k)
        chosen = edge & (np.minimum(apart, _DIRECTIONS - apart) <= 1)
        if chosen.any():
            out[k] = np.minimum(distance_transform_edt(~chosen), _FARTHEST_PX)
    return out


def _nearest_edges(
    across: NDArray, down: NDArray, found: Contours, reach_px: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(px from each contour to the edge across it, NaN where there is none; its weight 0..1)."""
    step = 0.5
    offsets = np.arange(-reach_px - 1, reach_px + 1 + step, step)
    places = found.places[:, None] + offsets[None, :, None] * found.normals[:, None]
    gu, gv = (map_coordinates(g, [places[..., 1], places[..., 0]], order=1, mode="nearest") for g in (across, down))
    size = np.abs(gu * found.normals[:, :1] + gv * found.normals[:, 1:])
    peak = (size == maximum_filter(size, (0, 3))) & (np.abs(offsets) <= reach_px)[None]
    noise = float(np.quantile(np.hypot(across, down), 0.5)) + 1e-4
    score = np.where(peak & (size > 2.0 * noise), size * np.exp(-((offsets / reach_px) ** 2))[None], 0.0)
    best = np.argmax(score, axis=1)
    row = np.arange(len(best))
    best = np.clip(best, 1, len(offsets) - 2)
    low, mid, high = (size[row, best + k] for k in (-1, 0, 1))
    bend = low - 2 * mid + high
    fine = np.where(np.abs(bend) > 1e-9, 0.5 * (low - high) / np.where(np.abs(bend) > 1e-9, bend, 1.0), 0.0)
    out = np.where(score[row, best] > 0, offsets[best] + step * np.clip(fine, -1, 1), np.nan)
    return out, mid / (mid + 4.0 * noise)
