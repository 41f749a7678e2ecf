# SPDX-License-Identifier: Apache-2.0
"""Finds which pixels of a measured room's images show the same piece of surface. No image is a reference for the
others.

A surface cell is a pixel of a view's left image with measured depth. Images have half the size, since a quarter of the
pixels is enough to measure the light; other modules need whole dots and rows."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.joint import joint_covariance
from activestereo.calibrate.world.views import (
    Image,
    Mask,
    blurred,
    near_edges,
    normals_of,
    pixel_grid,
    places_of,
    points_of,
    same_surface,
)
from activestereo.capture.capture import SIDES, Capture, Frame, binned
from activestereo.common.computed_once import computed_once
from activestereo.common.lens import to_tangents

# Depths that differ by less than this share are of one place; a surface is seen at no flatter angle than this cosine.
_SAME_SURFACE, _LEAST_COSINE = 0.012, 0.25
_BORDER_PX, _CLEAR_PX = 3, 5
_SATURATED, _AROUND_SATURATED_PX = 0.92, 9
_PATTERN_BLUR, _DARK = 1.0, 0.02
_MOST_VIEWS = 4
_HALF = 2


@dataclass(frozen=True)
class RoomImage:
    """One camera's image of one frame at half size; arrays are [height, width]. dn: counts. depth_m: 0 = none. usable:
    mask of unsaturated pixels with depth. dots: the pattern's value 0..1 on the surface, less a dark level. geometry:
    cosine over squared distance from the projector, 1/m^2. exposure: relative to the first frame's. whole: the image as
    recorded. view: index of the frame, which has two images."""

    frame: Frame
    side: str
    view: int
    K: NDArray[np.float64]
    whole: Image
    dn: Image
    depth_m: Image
    usable: Mask
    dots: Image
    geometry: Image
    exposure: float

    @computed_once
    def rays(self) -> tuple[Image, Image]:
        """Returns (x, y) of the ray with z = 1 through every pixel."""
        x, y = to_tangents(*pixel_grid(self.dn.shape), self.K)
        return x.astype(np.float32), y.astype(np.float32)

    def r2(self) -> Image:
        """Returns the squared tangent of every ray's angle to the optical axis."""
        x, y = self.rays()
        return np.asarray(x * x + y * y)


@dataclass(frozen=True)
class Places:
    """Positions in image b of the surface that each pixel of image a shows; arrays of a's size. column, row: pixels of
    b. seen: mask of the pixels whose surface is visible in b, too."""

    column: Image
    row: Image
    seen: Mask

    def read(self, image: Image, order: int = cv2.INTER_LINEAR) -> Image:
        """Samples image b at these positions."""
        return np.asarray(cv2.remap(image, self.column, self.row, order, borderMode=cv2.BORDER_REPLICATE))


class Room:
    """The images of one scene's views with depth, and the positions of their pixels in each other.

    capture: as `calibrate world` writes it. frames: ids of the views; None: the first four training frames with a
    measured pose. judged: number of views, at the start of the list, from the camera under test. Later views are of the
    same camera when it was good. joint: parameter names and covariance from the tested session's calibration."""

    def __init__(self, capture: Capture, frames: list[int] | None = None) -> None:
        told = capture.measured.get("poses", {}).get("frames")
        chosen = [f for f in capture.frames if f.has_infrared and f.depth_path is not None]
        if frames is not None:
            chosen = [f for f in chosen if f.id in frames]
        elif told is not None:
            chosen = [f for f in chosen if f.id in told and f.split == "train"][:_MOST_VIEWS]
        self.capture, self.frames, self.judged = capture, chosen, len(chosen)
        self.joint = joint_covariance(capture)
        self.rig = binned(capture, _HALF).rig
        pattern = blurred(capture.rig.projector.pattern().astype(np.float32), _PATTERN_BLUR)
        self.images: list[RoomImage] = []
        left_camera = self.rig.camera("left")
        for number, frame in enumerate(chosen):
            depth = capture.depth(frame)
            assert depth is not None
            left = np.where(near_edges(depth), 0.0, depth).astype(np.float32)[::_HALF, ::_HALF]
            left = np.ascontiguousarray(left[: left_camera.height, : left_camera.width])
            depths = {"left": left, "right": self._seen_right(left)}
            self.images += [self._image(number, frame, side, depths[side], pattern) for side in SIDES]
        self._places: dict[tuple[int, int], Places] = {}

    @property
    def shape(self) -> tuple[int, int]:
        height, width = self.images[0].dn.shape
        return height, width

    @property
    def views(self) -> int:
        return len(self.frames)

    def name(self, view: int) -> str:
        """Returns a view's name: its frame's id, as in `joint`, or 'good ID' for a view of the good session."""
        return f"good {self.frames[view].id}" if view >= self.judged else str(self.frames[view].id)

    def _image(self, number: int, frame: Frame, side: str, depth_m: Image, pattern: Image) -> RoomImage:
        K, whole = self.rig.camera(side).K, self.capture.ir(frame, side).astype(np.float32)
        height, width = depth_m.shape
        dn = cv2.resize(whole[: _HALF * height, : _HALF * width], (width, height), interpolation=cv2.INTER_AREA)
        projector = self.rig.projector
        to_left = np.eye(4) if side == "left" else np.linalg.inv(self.rig.left_to_right)
        points = points_of(depth_m, K)
        there = _moved(points, projector.left_to_projector @ to_left)
        u, v, _ = places_of(points, projector.left_to_projector @ to_left, projector.K)
        dots = cv2.remap(pattern, u, v, cv2.INTER_LINEAR, borderValue=0.0)
        normal = normals_of(points) @ (projector.left_to_projector @ to_left)[:3, :3].T.astype(np.float32)
        distance = np.maximum(np.linalg.norm(there, axis=-1), 0.05)
        geometry = np.abs((normal * there).sum(axis=-1)) / distance**3
        bright = (dn > _SATURATED * self.capture.rig.max_dn).astype(np.uint8)
        saturated = cv2.dilate(bright, np.ones((_AROUND_SATURATED_PX,) * 2, np.uint8)) > 0
        first = self.frames[0].exposure_gain
        return RoomImage(
            frame, side, number, K, whole, dn.astype(np.float32), depth_m, (depth_m > 0) & ~saturated,
            dots - np.float32(_DARK), geometry.astype(np.float32), frame.exposure_gain / first,
        )  # fmt: skip

    def _seen_right(self, left_depth: Image) -> Image:
        """Warps the left camera's depth image to the right camera. The nearest surface wins, and gaps of one pixel are
        closed."""
        points = _moved(points_of(left_depth, self.rig.camera("left").K), self.rig.left_to_right)
        z, K = points[..., 2], self.rig.camera("right").K
        column = np.rint(K[0, 0] * points[..., 0] / np.maximum(z, 0.05) + K[0, 2]).astype(int)
        row = np.rint(K[1, 1] * points[..., 1] / np.maximum(z, 0.05) + K[1, 2]).astype(int)
        height, width = left_depth.shape
        inside = (left_depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        order = np.argsort(-z[inside], kind="stable")
        out = np.zeros(left_depth.shape, np.float32)
        out[row[inside][order], column[inside][order]] = z[inside][order]
        filled = cv2.blur((out > 0).astype(np.float32), (3, 3)) > 0.5
        return np.where((out == 0) & filled, cv2.dilate(out, np.ones((3, 3), np.uint8)), out)

    def pose(self, image: RoomImage) -> NDArray[np.float64]:
        """Returns the 4x4 camera_to_world of an image's own camera."""
        world = image.frame.camera_to_world
        return world if image.side == "left" else world @ np.linalg.inv(self.rig.left_to_right)

    def places(self, a: int, b: int) -> Places:
        """Returns the positions of image a's pixels in image b. a, b: indices into `images`."""
        if (a, b) not in self._places:
            self._places[a, b] = self._find(self.images[a], self.images[b])
        return self._places[a, b]

    def _find(self, a: RoomImage, b: RoomImage) -> Places:
        a_to_b = np.linalg.inv(self.pose(b)) @ self.pose(a)
        points = points_of(a.depth_m, a.K)
        there = _moved(points, a_to_b)
        column, row, same = same_surface(points, a_to_b, b.K, b.depth_m, _SAME_SURFACE)
        height, width = b.dn.shape
        seen = same & a.usable & (column > _BORDER_PX) & (column < width - _BORDER_PX - 1)
        seen &= (row > _BORDER_PX) & (row < height - _BORDER_PX - 1)
        clear = cv2.erode(b.usable.astype(np.uint8), np.ones((_CLEAR_PX,) * 2, np.uint8)).astype(np.float32)
        seen &= cv2.remap(clear, column, row, cv2.INTER_LINEAR) > 0.99
        normal = normals_of(points) @ a_to_b[:3, :3].T.astype(np.float32)
        distance = np.maximum(np.linalg.norm(there, axis=-1), 0.05)
        seen &= np.abs((normal * there).sum(axis=-1)) / distance > _LEAST_COSINE
        return Places(column, row, seen)


def _moved(points: Image, pose: NDArray[np.float64]) -> Image:
    return points @ pose[:3, :3].T.astype(np.float32) + pose[:3, 3].astype(np.float32)
