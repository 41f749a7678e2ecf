# SPDX-License-Identifier: Apache-2.0
"""Adds views to a room: views of a session from when the camera was good, or simulated views of a planned recording.

Images without an effect show each cell's radiance, so an effect that changes all images of the room alike shows, too.
Views turned by 15 degrees are of no use for that: their slow light differs, and looks like another response.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.cells import Room, RoomImage
from activestereo.calibrate.world.overlaps import Surface, find_overlap, surface_of
from activestereo.calibrate.world.views import SceneView, near_edges
from activestereo.diagnose.room.bands import LEAST_GEOMETRY, MOST_GEOMETRY
from activestereo.diagnose.room.light import RoomLight

# A tripod returns to its place within these bounds.
_SAME_TURN_RAD, _SAME_PLACE_M, _LEAST_SHARED = 0.05, 0.05, 0.05


def with_turned_view(room: Room, light: RoomLight, turn_deg: tuple[float, float, float]) -> Room:
    """Returns a room with a simulated view: the first one, its cameras turned by turn_deg about their x, y, z axes.
    With no turn it stands for a session of the good camera. Light and dots are the estimated ones, without noise."""
    x, y, z = (cv2.Rodrigues(np.radians(turn_deg[i]) * np.eye(3)[i])[0] for i in range(3))
    turned = np.eye(4)
    turned[:3, :3] = np.linalg.inv(z @ y @ x)
    out = _with_views(room, [(_turned(room, light, k, turned[:3, :3]), room.pose(room.images[k]) @ turned)
                             for k in (0, 1)])  # fmt: skip
    out.judged += int(any(turn_deg))
    return out


def _turned(room: Room, light: RoomLight, k: int, turn: NDArray[np.float64]) -> RoomImage:
    """Simulates image k after a turn of its camera. turn: rotation from the turned camera's axes to its old ones."""
    old = room.images[k]
    rays = np.stack([*old.rays(), np.ones(room.shape)], axis=-1) @ turn.T
    ahead = np.where(rays[..., 2] > 0.1, rays[..., 2], np.nan)
    column, row = (
        np.float32(np.nan_to_num(old.K[i, i] * rays[..., i] / ahead + old.K[i, 2], nan=-1e4)) for i in (0, 1)
    )
    read = lambda image: cv2.remap(np.asarray(image, np.float32), column, row, cv2.INTER_LINEAR)  # noqa: E731
    usable, geometry = read(old.usable) > 0.99, read(old.geometry)
    albedo = light.looks[k].even(light.looks[k].amplitude(light.dots[k]))
    albedo /= light.gain[k] * np.clip(old.geometry, LEAST_GEOMETRY, MOST_GEOMETRY)
    dots = read(albedo) * np.minimum(geometry, MOST_GEOMETRY) * old.dots
    dn = light.gain[k] * (read(light.room[k] / light.gain[k]) + dots) + np.float32(light.black_dn)
    depth_m = np.where(usable, read(old.depth_m) / ahead, 0.0).astype(np.float32)
    return replace(old, dn=np.asarray(dn, np.float32), usable=usable, geometry=geometry, depth_m=depth_m)


def room_beside(room: Room, good: Room) -> Room | None:
    """Joins a room with a session of the good camera, whose views follow the room's. Returns None unless their first
    views have about the same pose and share enough pixels. The result has the good session's capture. A flaw in the
    camera under test, such as a soft response, would distort its black level and falloff."""
    rng = np.random.default_rng(0)
    first, second = (_surface(session, rng) for session in (good, room))
    overlap = find_overlap(0, 1, first, second, room.capture.rig.left.K)
    if overlap is None:
        return None
    turned, moved = np.linalg.norm(cv2.Rodrigues(overlap.a_to_b[:3, :3])[0]), np.linalg.norm(overlap.a_to_b[:3, 3])
    if turned > _SAME_TURN_RAD or moved > _SAME_PLACE_M:
        return None
    to_world = room.pose(room.images[0]) @ overlap.a_to_b @ np.linalg.inv(good.pose(good.images[0]))
    both = _with_views(room, [(image, to_world @ good.pose(image)) for image in good.images])
    there = both.places(0, 2 * room.views)
    if there.seen.mean() < _LEAST_SHARED:
        return None
    black = good.capture.rig.black_dn[0] if good.capture.rig.black_dn else 0.0
    lit = [np.maximum(image[there.seen] - black, 1.0) for image in (room.images[0].dn, there.read(good.images[0].dn))]
    scale, recorded = float(np.median(lit[1] / lit[0])), len(room.images)
    both.images[recorded:] = [replace(i, exposure=scale * i.exposure) for i in both.images[recorded:]]
    both.capture = good.capture
    return both


def _with_views(room: Room, further: Iterable[tuple[RoomImage, NDArray[np.float64]]]) -> Room:
    """Returns a room with more views. further: their images, each with its camera's 4x4 camera_to_world."""
    out = copy(room)
    out.images, out._places = list(room.images), dict(room._places)
    for image, pose in further:
        left = pose if image.side == "left" else pose @ room.rig.left_to_right
        frame = replace(image.frame, camera_to_world=left)
        out.images.append(replace(image, view=image.view + room.views, frame=frame))
    out.frames = [image.frame for image in out.images[::2]]
    return out


def _surface(session: Room, rng: np.random.Generator) -> Surface:
    """Returns the surface points that a session's first view shows."""
    capture, frame = session.capture, session.frames[0]
    left, right = (capture.ir(frame, side).astype(np.float32) for side in ("left", "right"))
    depth = capture.depth(frame)
    assert depth is not None
    view = SceneView(frame, left, right, depth, (depth > 0) & ~near_edges(depth))
    return surface_of(view, capture.rig.left.K, rng)
