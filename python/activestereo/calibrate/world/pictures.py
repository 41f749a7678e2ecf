# SPDX-License-Identifier: Apache-2.0
"""Draws pictures of each step's result, so that users can check it by eye."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.light import LightEstimate, Textures
from activestereo.calibrate.world.overlaps import Pose
from activestereo.calibrate.world.views import Image, SceneView, places_of, points_of

_CHECKER_PX = 40
_SMALL = np.s_[::2, ::2]


def poses_picture(views: Sequence[SceneView], poses: Sequence[Pose], K: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Draws a checkerboard whose fields alternate between the first view's image and the second's, warped to the first
    view. Contours are continuous if poses and K are right."""
    return _gray(_checker([view.left for view in views[:2]], views, poses, K))


def exposure_picture(
    views: Sequence[SceneView], poses: Sequence[Pose], K: NDArray[np.float64], light: LightEstimate
) -> NDArray[np.uint8]:
    """Draws the checkerboard of poses_picture() from the light above black, divided by exposure and falloff. Its fields
    are equally bright if these are right."""
    images = []
    for view, exposure in zip(views[:2], light.exposure, strict=False):
        tangent = points_of(np.ones_like(view.depth_m), K)[..., :2]
        lens = exposure * light.falloff((tangent**2).sum(axis=-1))
        images.append(np.asarray((view.left - light.black_dn[0]) / lens, np.float32))
    return _gray(_checker(images, views, poses, K))


def scene_pictures(
    views: Sequence[SceneView], masks: Mapping[tuple[int, str], NDArray[np.bool_]], textures: Sequence[Textures]
) -> dict[str, NDArray[np.uint8]]:
    """Returns two pictures. "albedo" has a row for each of the textures' views: its albedo on the left, the room's
    light on the right. "known" has each view's left image, darkened outside its mask."""
    kinds = [np.vstack([getattr(t, name)[_SMALL] for t in textures]) for name in ("albedo", "room")]
    rows = [np.where(masks[v.frame.id, "left"], 1.0, 0.3) * _gray(v.left) for v in views]
    return {"albedo": np.hstack([_gray(kind) for kind in kinds]), "known": np.vstack(rows).astype(np.uint8)[_SMALL]}


def _checker(
    images: Sequence[Image], views: Sequence[SceneView], poses: Sequence[Pose], K: NDArray[np.float64]
) -> Image:
    """Returns a checkerboard of images [0] and [1], the second one warped to the first view."""
    column, row, _ = places_of(points_of(views[0].depth_m, K), np.linalg.inv(poses[1]) @ poses[0], K)
    seen = cv2.remap(images[1], column, row, cv2.INTER_LINEAR)
    v, u = np.mgrid[0 : seen.shape[0], 0 : seen.shape[1]] // _CHECKER_PX
    return np.where(((u + v) % 2 == 0) | (seen == 0), images[0], seen).astype(np.float32)


def _gray(image: Image) -> NDArray[np.uint8]:
    """Scales an image to 0..255; its brightest hundredth is white."""
    return np.clip(image * (255.0 / max(float(np.percentile(image, 99)), 1e-6)), 0, 255).astype(np.uint8)
