# SPDX-License-Identifier: Apache-2.0
"""Estimates each view's pose and the camera's focal length and principal point. One least-squares fit for each scene
brings points of all overlapping views onto each other's planes; so loops of views close. Surfaces agree only under the
true focal length and principal point, as far as views are rotated enough to determine them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.least_squares import motion
from activestereo.calibrate.world.overlaps import (
    Contact,
    Overlap,
    Pose,
    Surface,
    contact,
    find_overlap,
    robust_weight,
    surface_of,
)
from activestereo.calibrate.world.views import SceneView, points_of
from activestereo.common.progress_bar import Progress, silent

_ROUNDS = 12
_REACH_M = 0.03
_MAD = 1.4826  # a normal distribution's deviation over its median distance from the middle
_LEAST_DISTANCE_M = 5e-5
# Errors of depth are correlated within blocks of this side; a block counts once in the intervals.
_BLOCK_PX = 80
# Scenes of one camera agree to this, px. No scene's own interval includes common errors of depth.
_SCENE_PX = 0.4
# A scene with a larger deviation than this, px, does not determine the camera.
_MOST_DEVIATION_PX = 6.0
_Z90 = 1.645


@dataclass(frozen=True)
class PoseEstimate:
    """The poses of one scene's views. views: their indices among all views. view_to_world: 4x4 each; the first view's
    frame is the world. covariance: [6n, 6n] of rotation vector and position in the world, 0 for the first view.
    by_camera: [6n, 3], derivative of these by (f, cx, cy). overlaps: those between these views. distance_m: median
    distance of a point from another view's plane. camera: (mean, covariance) of (f, cx, cy)."""

    views: tuple[int, ...]
    view_to_world: tuple[Pose, ...]
    covariance: NDArray[np.float64]
    by_camera: NDArray[np.float64]
    overlaps: tuple[Overlap, ...]
    distance_m: float
    camera: tuple[NDArray[np.float64], NDArray[np.float64]]


def group_views(
    views: Sequence[SceneView], K: NDArray[np.float64], seed: int = 0, progress: Progress = silent
) -> tuple[list[Surface], list[Overlap], list[list[int]]]:
    """Finds the overlaps of all views and groups the views into scenes. Returns (surfaces, overlaps, lists of view
    indices, the largest scene first)."""
    rng = np.random.default_rng(seed)
    surfaces = [surface_of(view, K, rng) for view in views]
    pairs = list(itertools.combinations(range(len(views)), 2))
    overlaps = []
    for k, (a, b) in enumerate(pairs):
        overlap = find_overlap(a, b, surfaces[a], surfaces[b], K)
        if overlap is not None:
            overlaps.append(overlap)
        progress((k + 1) / len(pairs))
    scene = list(range(len(views)))
    for overlap in overlaps:
        old, new = scene[overlap.b], scene[overlap.a]
        scene = [new if s == old else s for s in scene]
    groups = [[v for v in range(len(views)) if scene[v] == s] for s in sorted(set(scene))]
    return surfaces, overlaps, sorted(groups, key=len, reverse=True)


def solve_poses(
    surfaces: Sequence[Surface], overlaps: Sequence[Overlap], group: Sequence[int], K: NDArray[np.float64],
    prior: NDArray[np.float64],
) -> PoseEstimate:  # fmt: skip
    """Estimates the poses of one scene's views `group`. prior: [3, 3], inverse covariance of (f, cx, cy) around K."""
    own = [o for o in overlaps if o.a in group and o.b in group]
    order = {view: k for k, view in enumerate(group)}
    # The start: motions from the first view along the widest overlaps.
    known: dict[int, Pose] = {group[0]: np.eye(4)}
    wide = sorted(own, key=lambda o: -o.seen * o.on)
    while len(known) < len(group):
        o = next(o for o in wide if (o.a in known) != (o.b in known))
        if o.a in known:
            known[o.b] = known[o.a] @ np.linalg.inv(o.a_to_b)
        else:
            known[o.a] = known[o.b] @ o.a_to_b
    poses = [known[view] for view in group]
    k0 = np.array([K[0, 0], K[0, 2], K[1, 2]])
    camera = k0.copy()
    for _ in range(_ROUNDS):
        hessian, gradient, blocks, distance_m = _normal_equations(surfaces, own, order, poses, camera)
        hessian[:3, :3] += prior
        gradient[:3] += prior @ (k0 - camera)
        free = np.r_[0:3, 9 : len(gradient)]  # the first view is the world
        inverse = np.linalg.inv(hessian[np.ix_(free, free)])
        moved = np.zeros(len(gradient))
        moved[free] = inverse @ gradient[free]
        camera = camera + moved[:3]
        poses = [motion(moved[3 + 6 * k : 9 + 6 * k]) @ pose for k, pose in enumerate(poses)]
        if np.abs(moved[3:]).max() < 1e-6 and np.abs(moved[:3]).max() < 1e-3:
            break
    scatter = blocks[:, free].T @ blocks[:, free]
    scatter[:3, :3] += prior
    covariance = np.zeros((len(gradient), len(gradient)))
    covariance[np.ix_(free, free)] = inverse @ scatter @ inverse
    by_camera = np.zeros((len(gradient) - 3, 3))
    by_camera[6:] = -np.linalg.solve(hessian[9:, 9:], hessian[9:, :3])
    told = camera, covariance[:3, :3]
    return PoseEstimate(tuple(group), tuple(poses), covariance[3:, 3:], by_camera, tuple(own), distance_m, told)


def _normal_equations(
    surfaces: Sequence[Surface], overlaps: Sequence[Overlap], order: dict[int, int], poses: Sequence[Pose],
    camera: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:  # fmt: skip
    """Sums the Gauss-Newton equations of all points' distances from the planes of the overlapping view, in both
    directions. Returns (hessian, gradient, gradients of single image blocks, median distance in metres). Unknowns are
    f, cx, cy, then each view's rotation and translation. order: {view's index: its index in poses}."""
    size = 3 + 6 * len(poses)
    hessian, gradient, blocks, distances = np.zeros((size, size)), np.zeros(size), [], []
    K = np.array([[camera[0], 0, camera[1]], [0, camera[0], camera[2]], [0, 0, 1.0]])
    for overlap in overlaps:
        pair = (overlap.a, overlap.b)  # under K, which changes the normals too little to matter
        under = {i: replace(surfaces[i], points=points_of(surfaces[i].view.depth_m, K)) for i in pair}
        for a, b in (pair, pair[::-1]):
            first, second = poses[order[a]], poses[order[b]]
            c = contact(under[a], under[b], np.linalg.inv(second) @ first, K, _REACH_M)
            jacobian = np.zeros((len(c.distance), size))
            jacobian[:, :3] = _camera_derivatives(c, np.linalg.inv(second) @ first, camera)
            normal = c.normal @ second[:3, :3].T
            point = c.point @ second[:3, :3].T + second[:3, 3]
            turn = np.concatenate([np.cross(point, normal), normal], axis=1)
            jacobian[:, 3 + 6 * order[a] : 9 + 6 * order[a]] = turn
            jacobian[:, 3 + 6 * order[b] : 9 + 6 * order[b]] = -turn
            weighted = jacobian * robust_weight(c.distance)[:, None]
            hessian += weighted.T @ jacobian
            each = weighted * c.distance[:, None]
            gradient += each.sum(axis=0)
            width = under[a].known.shape[1]
            tile = c.pixel // width // _BLOCK_PX * 1000 + c.pixel % width // _BLOCK_PX
            _, place = np.unique(tile, return_inverse=True)
            own = np.zeros((place.max() + 1, size))
            np.add.at(own, place, each)
            blocks.append(own)
            distances.append(np.abs(c.distance))
    median = float(np.median(np.concatenate(distances)))
    weight = 1.0 / (_MAD * max(median, _LEAST_DISTANCE_M)) ** 2
    # Both directions see the same pairs of surfaces: they count as one.
    return weight * hessian / 2, weight * gradient / 2, weight * np.concatenate(blocks) / np.sqrt(2.0), median


def _camera_derivatives(c: Contact, a_to_b: Pose, camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns minus the derivatives [n, 3] of the points' distances from planes by f, cx, cy. They move both the point
    and its plane. camera: (f, cx, cy)."""
    start = (c.point - a_to_b[:3, 3]) @ a_to_b[:3, :3]
    out = np.zeros((len(c.distance), 3))
    for points, normal, sign in ((start, c.normal @ a_to_b[:3, :3], 1.0), (c.there, c.normal, -1.0)):
        x, y, z = points.T
        out[:, 0] += sign * -(normal[:, 0] * x + normal[:, 1] * y) / camera[0]
        out[:, 1] += sign * -normal[:, 0] * z / camera[0]
        out[:, 2] += sign * -normal[:, 1] * z / camera[0]
    return out


@dataclass(frozen=True)
class CameraEstimate:
    """The estimated intrinsics. mean: (focal length, centre's column, centre's row), px. covariance: [3, 3]. source:
    'overlaps' or 'nominal'. text: a line for the user."""

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    source: str
    text: str

    @property
    def K(self) -> NDArray[np.float64]:
        f, cx, cy = self.mean
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])


def camera_from_overlaps(scenes: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> CameraEstimate | None:
    """Combines the scenes' estimates of the camera to one; None if no scene determines it. scenes: (mean, covariance)
    of (f, cx, cy). Scenes that differ by more than their intervals widen the result's (Birge 1932)."""
    told = [(m, c) for m, c in scenes if np.sqrt(np.diag(c)).max() < _MOST_DEVIATION_PX]
    if not told:
        return None
    weights = [np.linalg.inv(c + _SCENE_PX**2 * np.eye(3)) for _, c in told]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    mean = covariance @ np.sum([w @ m for w, (m, _) in zip(weights, told, strict=True)], axis=0)
    misfit = sum(float((m - mean) @ w @ (m - mean)) for w, (m, _) in zip(weights, told, strict=True))
    covariance *= max(1.0, misfit / max(3 * (len(told) - 1), 1))
    (f, cx, cy), sd = mean, _Z90 * np.sqrt(np.diag(covariance))
    text = (
        f"camera: f {f:.1f} +- {sd[0]:.1f} px, centre ({cx:.1f} +- {sd[1]:.1f}, {cy:.1f} +- {sd[2]:.1f}) px, from "
        f"overlaps of views in {len(told)} scene{'s' * (len(told) > 1)} (90 %)"
    )
    return CameraEstimate(mean, covariance, "overlaps", text)
