# SPDX-License-Identifier: Apache-2.0
"""Finds which views show the same surfaces, and the motion between them.

Image features are computed without the dots; depth makes them 3D points. They are matched, and a rigid motion is
fitted. Point-to-plane ICP with projective association refines it (Blais and Levine 1995)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.least_squares import motion
from activestereo.calibrate.world.views import Image, Mask, SceneView, blurred, correlation, normals_of, points_of
from activestereo.common.lens import to_pixels

Pose = NDArray[np.float64]
Features = tuple[NDArray[np.float32], NDArray[np.float32]]

# Dots are finer than this. They move with the camera, so matching them would suggest that it stands still. So would
# gaps where dots are dead: if views seem not to overlap, gaps up to this size are closed.
_DOTS_PX, _GAP_PX = 4.0, 25
_MOST_FEATURES = 1500
_RATIOS = 0.85, 0.95  # a ghost over the picture makes descriptors less distinct
# This many matches prove a motion. Fewer do, as reflections in the lens leave, if the images correlate this much.
_SURE_MATCHES, _LEAST_MATCHES, _SAME_LIGHT = 12, 6, 0.7
_SAMPLES = 15000
# ICP: distances beyond which a point is another surface, from the first round to the last, and the robust scale, m.
_REACH_M = (0.15, 0.15, 0.08, 0.08, 0.05, 0.05, 0.03, 0.03, 0.03, 0.03)
_ROBUST_M = 0.004
# Views overlap if this share of the samples finds a surface, and this share of those lies on it within the reach.
_LEAST_SEEN, _LEAST_ON = 0.12, 0.7
# Views whose features match, but of whose samples only this share lies on the surface, show a scene that moved.
MOVED_ON = 0.2


@dataclass(frozen=True)
class Surface:
    """A view's geometry under an assumed camera matrix K. points, normals: [height, width, 3] in the camera's frame.
    known: mask of valid ones. pick: flat indices of randomly chosen pixels. features: SIFT features of the left image,
    and of that image with small dark gaps closed."""

    view: SceneView
    points: Image
    normals: Image
    known: Mask
    pick: NDArray[np.int64]
    features: tuple[Features, ...]


@dataclass(frozen=True)
class Overlap:
    """The motion between two views that show the same surfaces. a, b: indices of the views. a_to_b: 4x4. seen: share of
    a's points that fall on b's known pixels. on: share of those that lie on b's surface. distance_m: median distance
    from b's planes."""

    a: int
    b: int
    a_to_b: Pose
    seen: float
    on: float
    distance_m: float


def surface_of(view: SceneView, K: NDArray[np.float64], rng: np.random.Generator) -> Surface:
    points = points_of(view.depth_m, K)
    known = view.surface.copy()
    known[:3], known[-3:], known[:, :3], known[:, -3:] = False, False, False, False
    at = np.flatnonzero(known)
    pick = np.sort(rng.choice(at, min(_SAMPLES, at.size), replace=False))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_GAP_PX, _GAP_PX))
    images = view.left, cv2.morphologyEx(view.left, cv2.MORPH_CLOSE, disc)
    features = tuple(_features(image, points) for image in images)
    return Surface(view, points, normals_of(points), known, pick, features)


def find_overlap(
    a: int, b: int, first: Surface, second: Surface, K: NDArray[np.float64], least_on: float = _LEAST_ON
) -> Overlap | None:
    """Estimates the motion between two views and returns their Overlap; None if they show different surfaces. a, b: the
    views' indices; first, second: their surfaces. least_on: an overlap's `on` must be larger."""
    for ratio, (here, there) in product(_RATIOS, list(zip(first.features, second.features, strict=True))):
        start, matches = _by_features(here, there, K, ratio)
        overlap = None if start is None else _icp(a, b, first, second, start, K)
        if overlap is None or overlap.seen <= _LEAST_SEEN or overlap.on <= least_on:
            continue
        if matches >= _SURE_MATCHES:
            return overlap
        # Few matches: does the light without dots correlate on the surfaces that both views show?
        c = contact(first, second, overlap.a_to_b, K, _REACH_M[-1])
        x, y, z = c.there.T
        column, row = (np.rint(place).astype(int) for place in to_pixels(x / z, y / z, K))
        left, right = (blurred(surface.view.left, _DOTS_PX) for surface in (first, second))
        if correlation(left.ravel()[c.pixel], right[row, column]) > _SAME_LIGHT:
            return overlap
    return None


def _features(image: Image, points: Image) -> Features:
    """Returns (3D points [n, 3] in the camera's frame, SIFT descriptors) of the image at half size without its dots."""
    slow = cv2.resize(blurred(image, _DOTS_PX), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    bright = np.clip(slow * (255.0 / max(float(np.percentile(slow, 99.5)), 1.0)), 0, 255).astype(np.uint8)
    keys, described = cv2.SIFT_create(_MOST_FEATURES, contrastThreshold=0.01).detectAndCompute(
        cv2.createCLAHE(3.0, (8, 8)).apply(bright), None
    )
    if not keys:
        return np.zeros((0, 3), np.float32), np.zeros((0, 128), np.float32)
    at = np.rint(2.0 * np.array([key.pt for key in keys])).astype(int)
    at = np.clip(at, 0, np.array(image.shape[::-1]) - 1)
    place = points[at[:, 1], at[:, 0]]
    return place[place[:, 2] > 0], described[place[:, 2] > 0]


def _by_features(first: Features, second: Features, K: NDArray[np.float64], ratio: float) -> tuple[Pose | None, int]:
    """Returns (the motion from matched features, the number of matches that agree with it), or (None, 0) for too few
    matches. ratio: largest allowed ratio of the nearest descriptor's distance to the second nearest's."""
    (here, a), (there, b) = first, second
    if min(len(a), len(b)) < _LEAST_MATCHES:
        return None, 0
    pairs = cv2.BFMatcher().knnMatch(a, b, k=2)
    good = [(m.queryIdx, m.trainIdx) for m, n in (p for p in pairs if len(p) == 2) if m.distance < ratio * n.distance]
    if len(good) < _LEAST_MATCHES:
        return None, 0
    here, there = here[[i for i, _ in good]].astype(float), there[[j for _, j in good]].astype(float)
    pixels = there[:, :2] / there[:, 2:] * (K[0, 0], K[1, 1]) + (K[0, 2], K[1, 2])
    cv2.setRNGSeed(0)
    is_found, turn, place, inliers = cv2.solvePnPRansac(
        here, pixels, K, None, iterationsCount=3000, reprojectionError=8.0, confidence=0.9999
    )
    if not is_found or inliers is None or len(inliers) < _LEAST_MATCHES:
        return None, 0
    return motion(np.concatenate([turn, place])), len(inliers)


@dataclass(frozen=True)
class Contact:
    """Pairs of points of two overlapping surfaces, in the second camera's frame, metres. pixel: flat index in the first
    image. point: the first surface's point. there, normal: the second surface's point and normal at the pixel where the
    second camera sees `point`. distance: from `point` to `there` along `normal`. seen: share of the first surface's
    samples that fall on known pixels of the second image."""

    pixel: NDArray[np.int64]
    point: NDArray[np.float64]
    there: NDArray[np.float64]
    normal: NDArray[np.float64]
    distance: NDArray[np.float64]
    seen: float


def contact(first: Surface, second: Surface, a_to_b: Pose, K: NDArray[np.float64], reach_m: float) -> Contact:
    """Moves the first surface's sampled points by a_to_b and pairs each with the second's point at the same pixel. A
    pair's distance is below reach_m along the second's normal, and below 4 reach_m in all. K: 3x3 of both cameras."""
    start = first.points.reshape(-1, 3)[first.pick].astype(np.float64)
    moved = start @ a_to_b[:3, :3].T + a_to_b[:3, 3]
    z = np.maximum(moved[:, 2], 1e-3)
    column = np.rint(K[0, 0] * moved[:, 0] / z + K[0, 2]).astype(int)
    row = np.rint(K[1, 1] * moved[:, 1] / z + K[1, 2]).astype(int)
    height, width = second.known.shape
    inside = (moved[:, 2] > 0.05) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    inside[inside] &= second.known[row[inside], column[inside]]
    seen = float(inside.mean())
    index = np.flatnonzero(inside)
    normal = second.normals[row[index], column[index]].astype(np.float64)
    target = second.points[row[index], column[index]].astype(np.float64)
    distance = ((target - moved[index]) * normal).sum(axis=1)
    near = np.abs(distance) < reach_m
    near &= np.linalg.norm(target - moved[index], axis=1) < 4 * reach_m
    chosen = index[near]
    return Contact(first.pick[chosen], moved[chosen], target[near], normal[near], distance[near], seen)


def robust_weight(distance_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the Cauchy weight 0..1, for robust least squares, of distances from a plane in metres."""
    return np.asarray(1.0 / (1.0 + (distance_m / _ROBUST_M) ** 2))


def _icp(a: int, b: int, first: Surface, second: Surface, pose: Pose, K: NDArray[np.float64]) -> Overlap:
    for reach in _REACH_M:
        c = contact(first, second, pose, K, reach)
        if len(c.distance) < 100:
            break
        jacobian = np.concatenate([np.cross(c.point, c.normal), c.normal], axis=1)
        weighted = jacobian * robust_weight(c.distance)[:, None]
        step = np.linalg.solve(weighted.T @ jacobian + 1e-9 * np.eye(6), weighted.T @ c.distance)
        pose = motion(step) @ pose
    c = contact(first, second, pose, K, _REACH_M[-1])
    on = len(c.distance) / max(c.seen * len(first.pick), 1.0)
    return Overlap(a, b, pose, c.seen, on, float(np.median(np.abs(c.distance))) if len(c.distance) else np.inf)
