# SPDX-License-Identifier: Apache-2.0
"""Draws a scene's contours over a camera's pictures."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.scene_io.scene_files import load_scene_file

_ORANGE = (255, 140, 0)
_STRENGTH = 0.85
_CREASE = 0.82
_STEP = 0.02
_NOTHING_M = 1e3  # depth of pixels without a surface
_WINDOW = "activestereo overlay (q ends)"
_WINDOW_SECONDS = 30.0


class Overlay:
    """Draws a scene over pictures. It renders once per camera; further pictures of the same camera take the same
    contours."""

    def __init__(self, scene_path: Path, device: str | int = "auto") -> None:
        self._device = kuafu.Device(device)
        self._scene, self._renderer = kuafu.Scene(self._device), kuafu.Renderer(self._device)
        load_scene_file(self._scene, scene_path)
        self._path = scene_path
        self._kept: tuple[bytes, NDArray[np.bool_]] | None = None

    def draw(
        self, picture: NDArray[np.uint8], K: NDArray[np.float64] | None, camera_to_world: NDArray[np.float64] | None
    ) -> NDArray[np.uint8]:
        """Returns the picture with the scene drawn over it, uint8 [h][w][3]. picture: uint8 [h][w][1 or 3]. K,
        camera_to_world: None for the scene's first camera."""
        out = np.array(np.broadcast_to(picture, (*picture.shape[:2], 3)))
        lines = self._contours(out.shape[1], out.shape[0], K, camera_to_world)
        out[lines] = np.rint((1.0 - _STRENGTH) * out[lines] + _STRENGTH * np.array(_ORANGE))
        return out

    def _contours(
        self, width: int, height: int, K: NDArray[np.float64] | None, pose: NDArray[np.float64] | None
    ) -> NDArray[np.bool_]:
        """Renders a view and returns its contours [h][w]."""
        if K is None or pose is None:
            if self._scene.summary.camera_count == 0:
                raise ValueError(f"{self._path}: has no camera: lay it over a capture, or add one to the scene")
            own = self._scene.camera(0)
            if K is None:  # a scene file's camera has no pixels: its k is for an image of height 1
                scale = height / max(own.height, 1)
                K = np.array(
                    [[scale * own.k[0, 0], 0, (width - 1) / 2], [0, scale * own.k[1, 1], (height - 1) / 2], [0, 0, 1]]
                )
            pose = own.camera_to_world if pose is None else pose
        key = np.concatenate([K.ravel(), np.asarray(pose).ravel(), [width, height]]).tobytes()
        if self._kept is None or self._kept[0] != key:
            camera = kuafu.Camera(width, height, K, pose)
            outputs = ["depth", "normal", "instance_id"]
            images = self._renderer.render(self._scene, [camera], outputs, band="visible", spp=1)
            depth, normal, instance = (np.asarray(images[name][0]) for name in outputs)
            self._kept = key, contours(depth[..., 0], normal, instance[..., 0])
        return self._kept[1]


def contours(depth: NDArray, normal: NDArray, instance: NDArray) -> NDArray[np.bool_]:
    """Returns a mask [h][w] of pixels at which depth jumps, a surface bends or another object begins."""
    depth = np.where(depth > 0, depth, np.float32(_NOTHING_M))
    is_surface = depth < _NOTHING_M
    x, y, z = np.ascontiguousarray(np.moveaxis(normal, -1, 0))
    out = np.zeros(depth.shape, np.uint8)
    whole, first, last = slice(None), slice(-1), slice(1, None)
    for here, there in (((first, whole), (last, whole)), ((whole, first), (whole, last))):
        jump = np.abs(depth[here] - depth[there]) > _STEP * np.minimum(depth[here], depth[there])
        cosine = x[here] * x[there] + y[here] * y[there] + z[here] * z[there]
        bend = (cosine < _CREASE) & is_surface[here] & is_surface[there]
        out[here] |= jump | bend | (instance[here] != instance[there])
    return cv2.dilate(out, np.ones((2, 2), np.uint8)) > 0


def can_show_windows() -> bool:
    """Returns whether OpenCV can open windows here. Another process tries it, because Qt aborts without a display."""
    program = [sys.executable, "-c", "import cv2; cv2.namedWindow('')"]
    try:
        return subprocess.run(program, capture_output=True, timeout=_WINDOW_SECONDS).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def show_window(pictures: Iterable[NDArray[np.uint8]]) -> None:
    """Shows each picture in a window as it arrives, until q is pressed."""
    cv2.namedWindow(_WINDOW, cv2.WINDOW_NORMAL)
    for picture in pictures:
        cv2.imshow(_WINDOW, picture[..., ::-1])
        if cv2.waitKey(1) & 0xFF == ord("q"):
            break
    cv2.destroyAllWindows()
