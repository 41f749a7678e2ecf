# SPDX-License-Identifier: Apache-2.0
"""Masks the known part of the scene in each image: measured surfaces, far from edges, that a second view has measured,
too. Views held out for the test do not count. A surface in one view alone would be predicted by that view itself."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.overlaps import Pose
from activestereo.calibrate.world.views import Mask, SceneView, near_edges, pixel_grid, places_of, points_of
from activestereo.capture.capture import Rig

_EDGE_PX = 9
_SAME_SURFACE = 0.015


def known_masks(
    views: Sequence[SceneView], poses: Sequence[Pose], is_train: Sequence[bool], rig: Rig
) -> dict[tuple[int, str], Mask]:
    """Returns {(frame id, side): mask [height, width]} of the views of one scene. is_train: whether each view is not
    held out."""
    out: dict[tuple[int, str], Mask] = {}
    for k, view in enumerate(views):
        known = (view.depth_m > 0) & ~near_edges(view.depth_m, _EDGE_PX)
        others = [j for j, used in enumerate(is_train) if used and j != k]
        if others:
            known &= np.any(
                [_overlap_mask(views[j], view, np.linalg.inv(poses[j]) @ poses[k], rig.left.K) for j in others], axis=0
            )
        out[view.frame.id, "left"] = known
        out[view.frame.id, "right"] = _warp_to_right(view, known, rig)
    return out


def _overlap_mask(other: SceneView, view: SceneView, to_other: Pose, K: NDArray[np.float64]) -> Mask:
    """Returns a mask of the view's pixels whose surface `other` has measured, too. to_other: 4x4 from the view's to the
    other's camera frame."""
    column, row, z = places_of(points_of(view.depth_m, K), to_other, K)
    depth = cv2.remap(other.depth_m, column, row, cv2.INTER_LINEAR)
    inside = cv2.remap(other.surface.astype(np.float32), column, row, cv2.INTER_LINEAR) > 0.99
    return np.asarray(inside & (np.abs(depth - z) < _SAME_SURFACE * z))


def _warp_to_right(view: SceneView, known: Mask, rig: Rig) -> Mask:
    """Warps a mask of the left image to the right image by the view's depth. Right pixels near surfaces outside the
    mask are left out."""
    column, row = pixel_grid(known.shape)
    disparity = rig.left.K[0, 0] * rig.baseline_m / np.maximum(view.depth_m, 1e-3)
    at = np.rint(column - disparity + rig.right.K[0, 2] - rig.left.K[0, 2]).astype(int)
    inside = (view.depth_m > 0) & (at >= 0) & (at < known.shape[1])
    hit, foreign = np.zeros(known.shape, np.uint8), np.zeros(known.shape, np.uint8)
    rows = row.astype(int)
    hit[rows[inside & known], at[inside & known]] = 1
    foreign[rows[inside & ~known], at[inside & ~known]] = 1
    square = np.ones((3, 3), np.uint8)
    return np.asarray((cv2.morphologyEx(hit, cv2.MORPH_CLOSE, square) > 0) & (cv2.dilate(foreign, square) == 0))
