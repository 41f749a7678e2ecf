# SPDX-License-Identifier: Apache-2.0
"""Joins a room with a session of the same views from when the camera was good. Images without the effect then give each
cell's radiance, so that an effect that changes all images of the room alike shows, too.

Views turned by 15 degrees are of no use here: their slow light differs, and looks like another response.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.cells import Room, RoomImage
from activestereo.calibrate.world.overlaps import Surface, find_overlap, surface_of
from activestereo.calibrate.world.views import SceneView, near_edges

# A tripod returns to its place within these bounds.
_SAME_TURN_RAD, _SAME_PLACE_M, _LEAST_SHARED = 0.05, 0.05, 0.05


class RoomBeside(Room):
    """A Room whose further views are those of a good session. capture: the good session's, since a flaw in the camera
    under test, such as a soft response, is in that one's black level and falloff. good_to_world: 4x4, from the good
    session's frame to the room's. scale: factor on its exposures."""

    def __init__(self, room: Room, good: Room, good_to_world: NDArray[np.float64], scale: float = 1.0) -> None:
        self.capture, self.rig, self.frames = good.capture, room.rig, [*room.frames, *good.frames]
        self._room, self._good, self._good_to_world, self.judged = room, good, good_to_world, room.views
        self.joint = room.joint
        further = [replace(i, view=i.view + room.views, exposure=scale * i.exposure) for i in good.images]
        self.images, self._places = [*room.images, *further], {}

    def pose(self, image: RoomImage) -> NDArray[np.float64]:
        if image.view < self.judged:
            return self._room.pose(image)
        return np.asarray(self._good_to_world @ self._good.pose(image))


def room_beside(room: Room, good: Room) -> RoomBeside | None:
    """Joins a room with a session of the good camera, as a RoomBeside. Returns None if their first views do not lie at
    the same pose and share enough pixels."""
    rng = np.random.default_rng(0)
    first, second = (_surface(session, rng) for session in (good, room))
    overlap = find_overlap(0, 1, first, second, room.capture.rig.left.K)
    if overlap is None:
        return None
    turned, moved = np.linalg.norm(cv2.Rodrigues(overlap.a_to_b[:3, :3])[0]), np.linalg.norm(overlap.a_to_b[:3, 3])
    if turned > _SAME_TURN_RAD or moved > _SAME_PLACE_M:
        return None
    to_world = room.pose(room.images[0]) @ overlap.a_to_b @ np.linalg.inv(good.pose(good.images[0]))
    both = RoomBeside(room, good, to_world)
    there = both.places(0, 2 * room.views)
    if there.seen.mean() < _LEAST_SHARED:
        return None
    black = good.capture.rig.black_dn[0] if good.capture.rig.black_dn else 0.0
    lit = [np.maximum(image[there.seen] - black, 1.0) for image in (room.images[0].dn, there.read(good.images[0].dn))]
    return RoomBeside(room, good, to_world, float(np.median(lit[1] / lit[0])))


def _surface(session: Room, rng: np.random.Generator) -> Surface:
    """Returns the surface points of a session's first view."""
    capture, frame = session.capture, session.frames[0]
    left, right = (capture.ir(frame, side).astype(np.float32) for side in ("left", "right"))
    depth = capture.depth(frame)
    assert depth is not None
    view = SceneView(frame, left, right, depth, (depth > 0) & ~near_edges(depth), 1.0)
    return surface_of(view, capture.rig.left.K, rng)
