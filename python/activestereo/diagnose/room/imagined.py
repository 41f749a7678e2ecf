# SPDX-License-Identifier: Apache-2.0
"""Adds a pair of images to a measured room before they are recorded: its first view, turned about the left camera, or
of the good unit. Light and dots are those that were found, without noise."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from activestereo.calibrate.world.cells import Places, Room, RoomImage
from activestereo.calibrate.world.views import Image, pixel_grid
from activestereo.diagnose.room.light import RoomLight

_BORDER_PX, _LEAST_GEOMETRY, _MOST_GEOMETRY = 3, 0.02, 5.0


class ImaginedRoom(Room):
    """A Room with one more view: the first one turned by turn_deg about the camera's x, y, z; not turned, it is of when
    the camera was good. Columns and cells are computed as for any room."""

    def __init__(self, room: Room, light: RoomLight, turn_deg: tuple[float, float, float]) -> None:
        self.capture, self.rig, self._room, self.joint = room.capture, room.rig, room, room.joint
        self.frames = [*room.frames, room.frames[0]]
        self.judged = self.views if any(turn_deg) else room.views
        x, y, z = (cv2.Rodrigues(np.radians(turn_deg[i]) * np.eye(3)[i])[0] for i in range(3))
        self._turn = [image.K @ z @ y @ x @ np.linalg.inv(image.K) for image in room.images[:2]]
        self._places = {}
        self.images = [*room.images, *(self._taken(light, side) for side in (0, 1))]

    def _taken(self, light: RoomLight, side: int) -> RoomImage:
        """Simulates the planned image of one camera (side 0 = left, 1 = right) from its image of the first view."""
        old = self._room.images[side]
        column, row = self._moved(side, *pixel_grid(old.dn.shape))
        read = lambda image: cv2.remap(np.asarray(image, np.float32), column, row, cv2.INTER_LINEAR)  # noqa: E731
        usable = read(old.usable) > 0.99
        albedo = light.looks[side].even(light.looks[side].amplitude(light.dots[side]))
        albedo /= light.gain[side] * np.clip(old.geometry, _LEAST_GEOMETRY, _MOST_GEOMETRY)
        geometry = read(old.geometry)
        dots = read(albedo) * np.minimum(geometry, _MOST_GEOMETRY) * old.dots
        dn = light.gain[side] * (read(light.room[side] / light.gain[side]) + dots) + np.float32(light.black_dn)
        return replace(
            old, view=self._room.views, dn=np.asarray(dn, np.float32), usable=usable, geometry=geometry,
            depth_m=np.where(usable, read(old.depth_m), 0.0).astype(np.float32),
        )  # fmt: skip

    def _moved(self, side: int, column: Image, row: Image, back: bool = False) -> tuple[Image, Image]:
        """Maps pixels (column, row) of the planned image to the first view's image, by rotation; `back` maps in the
        other direction."""
        H = np.linalg.inv(self._turn[side]) if not back else self._turn[side]
        u, v, w = (H[i, 0] * column + H[i, 1] * row + H[i, 2] for i in range(3))
        z = np.where(w > 0.1, w, np.inf)
        nowhere = np.where(w > 0.1, 0.0, -1e4)  # behind the camera
        return (u / z + nowhere).astype(np.float32), (v / z + nowhere).astype(np.float32)

    def _base(self, k: int) -> int:
        """Returns the number of the recorded image from which image k is made."""
        return k if k < len(self._room.images) else k - len(self._room.images)

    def places(self, a: int, b: int) -> Places:
        """Returns the positions of image a's pixels in image b, through the recorded images that they are made of."""
        if (a, b) not in self._places:
            self._places[a, b] = self._compute_places(a, b)
        return self._places[a, b]

    def _compute_places(self, a: int, b: int) -> Places:
        base_a, base_b, recorded = self._base(a), self._base(b), len(self._room.images)
        if a < recorded and b < recorded:
            return self._room.places(a, b)
        column, row = (grid.astype(np.float32) for grid in pixel_grid(self.shape))
        seen = self.images[a].usable.copy()
        if a >= recorded:
            column, row = self._moved(base_a, column, row)
        if base_a != base_b:
            step = self._room.places(base_a, base_b)
            read = lambda image: cv2.remap(image, column, row, cv2.INTER_LINEAR)  # noqa: E731
            column, row, seen = read(step.column), read(step.row), seen & (read(step.seen.astype(np.float32)) > 0.99)
        if b >= recorded:
            column, row = self._moved(base_b, column, row, back=True)
        height, width = self.shape
        seen &= (column > _BORDER_PX) & (column < width - _BORDER_PX - 1)
        seen &= (row > _BORDER_PX) & (row < height - _BORDER_PX - 1)
        usable = self.images[b].usable.astype(np.float32)
        seen &= cv2.remap(usable, column, row, cv2.INTER_LINEAR) > 0.99
        return Places(column, row, seen)
