# SPDX-License-Identifier: Apache-2.0
"""Chooses a camera pose for a scene file without a camera, and adds a lamp to a closed room without lamps. World:
metres, y up, as in glTF."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.pose import look_at, rigid_motion
from activestereo.scene_io.scene_files import likely_unit
from activestereo.scene_io.staging import LAMPS, LUMENS_PER_WATT, ROOM_LUX, has_lamps

if TYPE_CHECKING:
    import kuafu

# Largest distance of the view's middle. There a D400's dots are some 6 % of the infrared light of a lit room, and its
# depth errs by some 10 mm.
MIDDLE_M = 2.0
_HALF_VIEW = 0.9 * np.tan(np.deg2rad((69.0, 42.0)) / 2.0)  # nine tenths of half a D400 colour camera's view
_SIDE = 32  # pixels, width and height of the depth images that are rendered to choose a view
_UP = (0.0, 1.0, 0.0)
_AHEAD = np.array([0.0, -0.5, -1.0]) / np.hypot(0.5, 1.0)  # forwards and down
_LEAST_ROOM_M = 1.5  # side of the smallest room
_LEAST_CLOSED = 0.6  # least share of the pixels around a place that show a surface, in a closed room


def overall_view(scene: kuafu.Scene, least_m: float = 0.0) -> tuple[NDArray[np.float64], str]:
    """Returns camera_to_world [4, 4] of a camera for a scene, and a text that describes its view. The camera looks
    forwards and down. In a closed room it is at room_place(). Otherwise it is as near as possible with the whole scene
    in view. If the middle of the view is farther than MIDDLE_M, the camera moves ahead to that distance; in an open
    scene only if the scene's size is 2 mm to 50 m.

    least_m: the shortest distance that the camera measures."""
    low, high = np.array(scene.summary.bounds_min_m), np.array(scene.summary.bounds_max_m)
    place = room_place(scene)
    if place is not None:
        views = [look_at(place, place + _turned(_AHEAD, turn), _UP) for turn in range(4)]
        middles = [_middle_m(depth) for depth in _depths(scene, views, _HALF_VIEW)]
        best = int(np.argmin(np.abs(np.subtract(middles, MIDDLE_M))))
        return _approached(scene, views[best], least_m), "from inside the closed room"
    centre = 0.5 * (low + high)
    axes = look_at(-_AHEAD, np.zeros(3), _UP)[:3, :3]
    corners = np.array(list(itertools.product(*zip(low - centre, high - centre, strict=True)))) @ axes
    nearest = np.maximum(np.max(np.abs(corners[:, :2]) / _HALF_VIEW, axis=1), 1.5 * least_m) - corners[:, 2]
    view = look_at(centre - max(float(nearest.max()), 0.13) * _AHEAD, centre, _UP)
    if (
        likely_unit(float(np.max(high - low))) == 1.0
        and (near := _approached(scene, view, least_m))[2, 3] != view[2, 3]
    ):
        return near, f"a part of it, {MIDDLE_M:g} m away"
    return view, "all of it"


def light_closed_room(scene: kuafu.Scene) -> None:
    """Adds a lamp to a closed room without lamps, because light from the surroundings does not come in. The lamp hangs
    at 0.9 of the room's height. The floor below it gets ROOM_LUX. Does nothing in other scenes."""
    import kuafu

    place = None if has_lamps(scene) else room_place(scene)
    if place is None:
        return
    low, high = scene.summary.bounds_min_m[1], scene.summary.bounds_max_m[1]
    drop_m = 0.9 * (high - low)
    pose = rigid_motion((place[0], low + drop_m, place[2]))
    level = ROOM_LUX / LUMENS_PER_WATT * drop_m**2
    scene.add_light(kuafu.Light(name="the added lamp", intensity=(level,) * 3, light_to_world=pose, light_group=LAMPS))


def room_place(scene: kuafu.Scene) -> NDArray[np.float64] | None:
    """Returns the one of five positions, at half a closed room's height, that is farthest from visible surfaces; None
    if the scene is no room. In a room surfaces are visible all around, and _enclosed_m3() is below half of the scene's
    box."""
    low, high = np.array(scene.summary.bounds_min_m), np.array(scene.summary.bounds_max_m)
    if np.min(high - low) < _LEAST_ROOM_M:
        return None
    shares = np.array([[0.5, 0.5, 0.5], *([x, 0.5, z] for x in (0.3, 0.7) for z in (0.3, 0.7))])
    places = low + shares * (high - low)
    around = [look_at(place, place + _turned(_AHEAD * (1, 0, 1), turn), _UP) for place in places for turn in range(4)]
    depth = _depths(scene, around, np.ones(2)).reshape(len(places), -1)
    space = np.where(
        np.mean(depth > 0.0, axis=1) < _LEAST_CLOSED, 0.0, np.min(depth, axis=1, where=depth > 0.0, initial=np.inf)
    )
    best = int(np.argmax(space))
    is_room = space[best] > 0.0 and _enclosed_m3(scene, places[0]) < 0.5 * float(np.prod(high - low))
    return places[best] if is_room else None


def _enclosed_m3(scene: kuafu.Scene, origin: NDArray[np.float64]) -> float:
    """Returns the volume inside the scene's surfaces, by the divergence theorem about the point `origin`. It is
    negative for a room whose surfaces face inwards."""
    total = 0.0
    for number in range(scene.summary.instance_count):
        instance = scene.get_instance(number)
        mesh, pose = scene.get_mesh(instance["mesh"]), np.asarray(instance["local_to_world"])
        corners = (mesh["positions"] @ pose[:3, :3].T + pose[:3, 3] - origin)[mesh["indices"]]
        total += float(np.sum(corners[:, 0] * np.cross(corners[:, 1], corners[:, 2]))) / 6.0
    return total


def _approached(scene: kuafu.Scene, view: NDArray[np.float64], least_m: float) -> NDArray[np.float64]:
    """Returns the view, moved ahead in a few steps until its middle is MIDDLE_M away at most. It stops before the
    nearest visible surface."""
    near = view.copy()
    for _ in range(4):
        [depth] = _depths(scene, [near], _HALF_VIEW)
        free_m = float(np.min(depth, where=depth > 0.0, initial=np.inf)) - 1.5 * least_m
        step_m = min(_middle_m(depth) - MIDDLE_M, free_m)
        if not 0.0 < step_m < np.inf:
            break
        near[:3, 3] += step_m * near[:3, 2]
    return near


def _middle_m(depth: NDArray[np.float32]) -> float:
    """Returns the median depth in the middle third of a depth image, infinite if no surface is visible there."""
    middle = depth[_SIDE // 3 : -(_SIDE // 3), _SIDE // 3 : -(_SIDE // 3)]
    return float(np.median(middle[middle > 0.0])) if np.any(middle > 0.0) else np.inf


def _turned(direction: NDArray[np.float64], quarters: int) -> NDArray[np.float64]:
    """Returns a direction turned about the vertical by quarters of a turn."""
    cos, sin = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarters]
    return np.array([cos * direction[0] + sin * direction[2], direction[1], cos * direction[2] - sin * direction[0]])


def _depths(scene: kuafu.Scene, views: Sequence[NDArray[np.float64]], half_view: NDArray[np.float64]) -> NDArray[Any]:
    """Returns float32 depth [view, _SIDE, _SIDE] in metres, 0 = nothing. half_view: tangents of half the views."""
    import kuafu

    focal, middle = 0.5 * _SIDE / half_view, 0.5 * (_SIDE - 1)
    k = [[focal[0], 0, middle], [0, focal[1], middle], [0, 0, 1]]
    cameras = [kuafu.Camera(_SIDE, _SIDE, k, view) for view in views]
    environments = [0] * len(cameras)
    seen = kuafu.Renderer(scene.device).render(
        scene, cameras, ["depth"], band="visible", environments=environments, spp=1, max_bounces=0
    )
    return np.array(seen["depth"][..., 0])
