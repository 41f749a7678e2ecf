# SPDX-License-Identifier: Apache-2.0
"""Pictures of what each step found, for a look before the numbers are believed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.poses import PoseEstimate
from activestereo.calibrate.world.views import SceneView, points_of
from activestereo.common.output_files import write_png

_CHECKER_PX = 40


def write_pictures(
    folder: Path, views: Sequence[SceneView], K: NDArray[np.float64], poses: PoseEstimate | None,
    masks: Mapping[tuple[int, str], NDArray[np.bool_]],
) -> None:  # fmt: skip
    """Makes the folder with poses.png, the first view and the next one drawn from its place in a checker, and
    known.png, each view's left image, dark where the scene is not known."""
    folder.mkdir()
    if poses is not None:
        write_png(folder / "poses.png", _checker(views, K, poses))
    known = [
        _gray(view.left) * np.where(masks[view.frame.id, "left"], 1.0, 0.3)
        for view in views
        if (view.frame.id, "left") in masks
    ]
    if known:
        write_png(folder / "known.png", np.vstack(known).astype(np.uint8)[::2, ::2])


def _checker(views: Sequence[SceneView], K: NDArray[np.float64], estimate: PoseEstimate) -> NDArray[np.uint8]:
    """Fields of the first view and of the one that overlaps it most, from the first's place: contours run on."""
    poses = dict(zip(estimate.views, estimate.view_to_world, strict=True))
    first = estimate.views[0]
    widest = max((o for o in estimate.overlaps if first in (o.a, o.b)), key=lambda o: o.seen)
    other = widest.b if widest.a == first else widest.a
    here, there = views[first], views[other]
    to = np.linalg.inv(poses[other]) @ poses[first]
    moved = points_of(here.depth_m, K) @ to[:3, :3].T.astype(np.float32) + to[:3, 3].astype(np.float32)
    z = np.maximum(moved[..., 2], 1e-3)
    column, row = K[0, 0] * moved[..., 0] / z + K[0, 2], K[1, 1] * moved[..., 1] / z + K[1, 2]
    seen = cv2.remap(_gray(there.left), column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR)
    v, u = np.mgrid[0 : here.left.shape[0], 0 : here.left.shape[1]] // _CHECKER_PX
    return np.where(((u + v) % 2 == 0) | (seen == 0), _gray(here.left), seen).astype(np.uint8)


def _gray(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """0..255, the brightest hundredth white."""
    return np.clip(image * (255.0 / max(float(np.percentile(image, 99)), 1.0)), 0, 255).astype(np.float32)
