# SPDX-License-Identifier: Apache-2.0
"""A scene's contours over a camera's pictures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

import kuafu

_ORANGE = (255, 140, 0)
_STRENGTH = 0.85
_CREASE = 0.82
_STEP = 0.02
_WINDOW = "activestereo overlay (q ends)"


class Overlay:
    """Contours of a scene, rendered once for each camera: blending alone follows every picture."""

    def __init__(self, scene_path: Path, device: str | int = "auto") -> None:
        self._device = kuafu.Device(device)
        self._scene, self._renderer = kuafu.Scene(self._device), kuafu.Renderer(self._device)
        self._scene.load(scene_path)
        self._path = scene_path
        self._kept: tuple[bytes, NDArray[np.bool_]] | None = None

    def blend(
        self, picture: NDArray[np.uint8], K: NDArray[np.float64] | None, camera_to_world: NDArray[np.float64] | None
    ) -> NDArray[np.uint8]:
        """picture: uint8 [h][w][1 or 3]. K, camera_to_world: None for those of the scene's first camera. Returns uint8
        [h][w][3]."""
        picture = np.broadcast_to(picture, (*picture.shape[:2], 3))
        lines = self._contours(picture.shape[1], picture.shape[0], K, camera_to_world)
        out = picture.astype(np.float32)
        out[lines] = (1.0 - _STRENGTH) * out[lines] + _STRENGTH * np.array(_ORANGE, np.float32)
        return np.rint(out).astype(np.uint8)

    def _contours(
        self, width: int, height: int, K: NDArray[np.float64] | None, pose: NDArray[np.float64] | None
    ) -> NDArray[np.bool_]:
        if K is None or pose is None:
            if self._scene.summary.camera_count == 0:
                raise ValueError(f"{self._path}: has no camera: lay it over a capture, or add one to the scene")
            own = self._scene.camera(0)
            if K is None:  # a file's camera has a field of view and no pixels: its k is that of an image of height 1
                scale = height / max(own.height, 1)
                K = np.array(
                    [[scale * own.k[0, 0], 0, (width - 1) / 2], [0, scale * own.k[1, 1], (height - 1) / 2], [0, 0, 1]]
                )
            pose = own.camera_to_world if pose is None else pose
        key = np.concatenate([K.ravel(), np.asarray(pose).ravel(), [width, height]]).tobytes()
        if self._kept is None or self._kept[0] != key:
            camera = kuafu.Camera(width, height, K, pose)
            images = self._renderer.render(self._scene, [camera], ("depth", "normal", "instance_id"), spp=1)
            self._kept = (
                key,
                contours(images["depth"][0, ..., 0], images["normal"][0], images["instance_id"][0, ..., 0]),
            )
        return self._kept[1]


def contours(depth: NDArray, normal: NDArray, instance: NDArray) -> NDArray[np.bool_]:
    """Pixels where depth jumps, a surface bends or another object begins, [h][w]."""
    out = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        far, near = (np.where(d > 0, d, 1e3) for d in (depth, np.roll(depth, -1, axis=axis)))
        jump = np.abs(far - near) > _STEP * np.minimum(far, near)
        bend = (np.einsum("ijk,ijk->ij", normal, np.roll(normal, -1, axis=axis)) < _CREASE) & (far < 1e3) & (near < 1e3)
        other = instance != np.roll(instance, -1, axis=axis)
        edge = jump | bend | other
        edge[(-1, slice(None)) if axis == 0 else (slice(None), -1)] = False
        out |= edge
    return np.asarray(maximum_filter(out, 2))


def show_window(pictures: Iterable[NDArray[np.uint8]]) -> None:
    """Each picture as it comes, until q. RuntimeError where OpenCV has no window to open."""
    import cv2

    try:
        cv2.namedWindow(_WINDOW, cv2.WINDOW_NORMAL)
    except cv2.error as error:
        raise RuntimeError("no window can be opened here: give --out, and pictures are saved") from error
    for picture in pictures:
        cv2.imshow(_WINDOW, picture[..., ::-1])
        if cv2.waitKey(1) & 0xFF == ord("q"):
            break
    cv2.destroyAllWindows()


def live_pictures(size: tuple[int, int]) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.float64]]]:
    """(colour image, K) of a connected D4xx, until the reader stops. ValueError where pyrealsense2 is missing."""
    try:
        import pyrealsense2 as rs
    except ImportError as error:
        raise ValueError("live: needs the package pyrealsense2, which is missing: pip install pyrealsense2") from error
    config, pipeline = rs.config(), rs.pipeline()
    config.enable_stream(rs.stream.color, *size, rs.format.rgb8, 30)
    profile = pipeline.start(config)
    try:
        lens = profile.get_stream(rs.stream.color).as_video_stream_profile().get_intrinsics()
        K = np.array([[lens.fx, 0.0, lens.ppx], [0.0, lens.fy, lens.ppy], [0.0, 0.0, 1.0]])
        while True:
            yield np.array(pipeline.wait_for_frames().get_color_frame().get_data()), K
    finally:
        pipeline.stop()
