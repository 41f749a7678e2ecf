# SPDX-License-Identifier: Apache-2.0
"""Reads the views of a recording with depth, and rejects those on which nothing can be measured.

Depth is checked against the infrared pair. The right camera's high-pass image, shifted by the disparity that depth
predicts, must equal the left one's. Depth from another camera or moment, or in other units, fails this check."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Capture, Frame, Rig
from activestereo.common.lens import to_tangents
from activestereo.common.progress_bar import Progress, silent

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Depth that changes by more than this share within a pixel's neighbourhood is an edge. A square of EDGE_PX around it is
# left out, because depth and image may be registered that badly.
_EDGE_SHARE = 0.02
EDGE_PX = 7
_HIGH_PASS_PX = 3.0
# The images correlate 0.85 to 0.94 at the depth of a laser or of the device itself, at most 0.21 at foreign depth.
_LEAST_AGREEMENT = 0.4
# Largest saturated share of a usable view, and the share above which there is a message.
_MOST_CLIPPED, _MUCH_CLIPPED = 0.2, 0.05
_LEAST_DEPTH = 0.2


@dataclass(frozen=True)
class SceneView:
    """A frame's images [height, width]. left, right: DN. depth_m: 0 = none. surface: mask of measured depth far from
    edges. clipped: saturated share of the left image."""

    frame: Frame
    left: Image
    right: Image
    depth_m: Image
    surface: Mask
    clipped: float = 0.0


def read_views(capture: Capture, progress: Progress = silent) -> tuple[list[SceneView], list[str]]:
    """Returns (a capture's usable views, messages). There is a message, with reason and remedy, for each frame that is
    rejected or much saturated. Raises ValueError with the first reason if fewer than two views are usable."""
    where = capture.path
    if not any(frame.depth_path for frame in capture.frames):
        raise ValueError(f"{where}: no frame has depth: record the depth stream, too, or a laser's depth of each view")
    views, refused = [], []
    for k, frame in enumerate(capture.frames):
        if frame.depth_path is not None and frame.has_infrared and frame.projector_power > 0:
            try:
                views.append(_read(capture, frame))
            except ValueError as error:
                refused.append(str(error))
        progress((k + 1) / len(capture.frames))
    if len(views) < 2 and refused:
        raise ValueError(refused[0])
    if not views:
        raise ValueError(
            f"{where}: no frame has infrared images, depth and the projector on: record all three together"
        )
    if len(views) < 2:
        raise ValueError(
            f"{where}: one view with depth: record two or more that overlap, and turn the camera between them"
        )
    bright_lines = [
        f"{100 * view.clipped:.0f} % of frame {view.frame.id}'s left image is saturated ({capture.rig.max_dn} DN) and "
        "tells nothing: record with less exposure, gain or laser power"
        for view in views
        if view.clipped > _MUCH_CLIPPED
    ]
    return views, [f"left out: {reason}" for reason in refused] + bright_lines


def _read(capture: Capture, frame: Frame) -> SceneView:
    left, right = capture.ir(frame, "left"), capture.ir(frame, "right")
    depth = capture.depth(frame)
    assert depth is not None
    name = f"{capture.path}: frame {frame.id}"
    clipped = float((left >= capture.rig.max_dn).mean())
    if clipped > _MOST_CLIPPED:
        raise ValueError(
            f"{name}: {100 * clipped:.0f} % of the left image is saturated ({capture.rig.max_dn} DN): record with less "
            "exposure, gain or laser power"
        )
    if (depth > 0).mean() < _LEAST_DEPTH:
        raise ValueError(
            f"{name}: only {100 * (depth > 0).mean():.0f} % of its depth is measured: come nearer, or leave it out"
        )
    view = SceneView(frame, left, right, depth, (depth > 0) & ~near_edges(depth), clipped)
    if (agreement := _agreement(view, capture.rig)) < _LEAST_AGREEMENT:
        raise ValueError(
            f"{name}: depth does not belong to the pair: at its disparity the images correlate {agreement:.2f} (0.85 "
            "and more where it does): check that depth is of the same moment, in the left camera's pixels, and "
            "its scale"
        )
    return view


def near_edges(depth_m: Image, width_px: int = EDGE_PX) -> Mask:
    """Returns a mask of the pixels near a step of the depth or near the end of measured depth."""
    around = np.ones((3, 3), np.uint8)
    step = cv2.dilate(depth_m, around) - cv2.erode(depth_m, around)
    edge = (step > _EDGE_SHARE * np.maximum(depth_m, 1e-3)).astype(np.uint8)
    return cv2.dilate(edge, np.ones((width_px, width_px), np.uint8)) > 0


def high_pass(image: Image, sigma_px: float = _HIGH_PASS_PX) -> Image:
    """Returns the image without its slow variations."""
    return image - blurred(image, sigma_px)


def blurred(image: Image, sigma_px: float) -> Image:
    """Blurs an image with a Gaussian, float32."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), np.float32)


def pixel_grid(shape: tuple[int, ...]) -> tuple[Image, Image]:
    """Returns (column, row) of every pixel, float32 [height, width]."""
    row, column = np.mgrid[0 : shape[0], 0 : shape[1]].astype(np.float32)
    return column, row


def points_of(depth_m: Image, K: NDArray[np.float64]) -> Image:
    """Converts a depth image to points in the camera's frame, metres [height, width, 3]."""
    column, row = pixel_grid(depth_m.shape)
    x, y = to_tangents(column, row, K)
    return np.stack([x * depth_m, y * depth_m, depth_m], axis=-1).astype(np.float32)


def places_of(points: Image, pose: NDArray[np.float64], K: NDArray[np.float64]) -> tuple[Image, Image, Image]:
    """Projects points [height, width, 3] into another camera. pose: 4x4 from the points' frame to that camera's.
    Returns (column, row, depth), each [height, width]; depth is at least 1 mm."""
    moved = points @ pose[:3, :3].T.astype(np.float32) + pose[:3, 3].astype(np.float32)
    z = np.maximum(moved[..., 2], 1e-3)
    column, row = (np.asarray(K[i, i] * moved[..., i] / z + K[i, 2], np.float32) for i in (0, 1))
    return column, row, z


def same_surface(
    points: Image, pose: NDArray[np.float64], K: NDArray[np.float64], depth_m: Image, share: float
) -> tuple[Image, Image, Mask]:
    """Projects points into another view, as places_of() does. Returns (column, row, mask of points that lie on the
    view's surface). There the view's depth_m differs from the point's depth by less than this share of it."""
    column, row, z = places_of(points, pose, K)
    depth = cv2.remap(depth_m, column, row, cv2.INTER_LINEAR)
    return column, row, (z > 0.05) & (np.abs(depth - z) < share * z)


def normals_of(points: Image) -> Image:
    """Returns unit normals towards the camera, float32, of points [height, width, 3] in camera axes: blurred by 1.5 px,
    then differenced over two pixels each way. The outer two pixels are wrong: they wrap around."""
    smooth = np.dstack([blurred(np.ascontiguousarray(points[..., k]), 1.5) for k in range(3)])
    across, down = (np.roll(smooth, -2, axis) - np.roll(smooth, 2, axis) for axis in (1, 0))
    normal = np.cross(down, across)
    return (normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)).astype(np.float32)


def right_at_depth(view: SceneView, rig: Rig, shift: tuple[float, float] = (0.0, 0.0)) -> tuple[Image, Mask]:
    """Warps the right camera's high-pass image to the left image by the measured depth, plus a shift (columns, rows) in
    pixels. Returns (the image, mask of pixels that are inside)."""
    column, row = pixel_grid(view.depth_m.shape)
    disparity = np.float32(rig.left.K[0, 0] * rig.baseline_m) / np.maximum(view.depth_m, 1e-3)
    at = column - disparity + np.float32(rig.right.K[0, 2] - rig.left.K[0, 2])
    there = cv2.remap(high_pass(view.right), at + np.float32(shift[0]), row + np.float32(shift[1]), cv2.INTER_LINEAR)
    return there, view.surface & (at > 2) & (at < view.left.shape[1] - 3)


def correlation(a: NDArray, b: NDArray) -> float:
    """Computes Pearson's r of two arrays of equal size; 0 if one of them is constant."""
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt((a * a).sum(dtype=np.float64) * (b * b).sum(dtype=np.float64)))
    return float((a * b).sum(dtype=np.float64)) / scale if scale > 0 else 0.0


def _agreement(view: SceneView, rig: Rig) -> float:
    """Returns the best correlation of both cameras' high-pass images, warped by depth, over a few column shifts. The
    nominal calibration may be off by a pixel or two."""
    left = high_pass(view.left)
    best = 0.0
    for shift in (0.0, -1.5, 1.5, -3.0, 3.0):
        there, inside = right_at_depth(view, rig, (shift, 0.0))
        if inside.sum() < 1000:
            return 0.0
        best = max(best, correlation(left[inside], there[inside]))
        if best > 2 * _LEAST_AGREEMENT:
            break
    return best
