# SPDX-License-Identifier: Apache-2.0
"""A scene of any size without a camera is seen from where a depth camera measures; a closed room, from inside, lit."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

import kuafu
from activestereo.scene_io.defaults import MIDDLE_M, light_closed_room, overall_view, room_place
from activestereo.scene_io.staging import LUMENS_PER_WATT, ROOM_LUX

_BOX = list(itertools.product((-0.5, 0.5), (0, 1), (-0.5, 0.5)))
_OUTWARDS = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]


def _scene(path: Path, size_m: tuple[float, float, float], is_room: bool = False) -> kuafu.Scene:
    """An OBJ file with a box that shows its outside, or its inside as a room does."""
    corners = "".join("v {} {} {}\n".format(*np.multiply(corner, size_m)) for corner in _BOX)
    faces = "".join("f {} {} {} {}\n".format(*(face[::-1] if is_room else face)) for face in _OUTWARDS)
    path.write_text(corners + faces)
    scene = kuafu.Scene(kuafu.Device("cpu"))
    scene.load(path)
    return scene


def _seen(scene: kuafu.Scene, view: np.ndarray) -> dict[str, np.ndarray]:
    k = [[46, 0, 31.5], [0, 46, 17.5], [0, 0, 1]]
    camera, names = kuafu.Camera(64, 36, k, view), ["depth", "albedo", "radiance"]
    images = kuafu.Renderer(scene.device).render(scene, camera, names, band="visible", spp=16)
    return {name: image[0] for name, image in images.items()}


@pytest.mark.parametrize("size_m", [0.02, 0.05, 0.5, 2.0, 6.0, 20.0])
@pytest.mark.parametrize("thick", [0.05, 1.0])
def test_a_thing_of_any_size_is_seen_from_where_it_is_measured(tmp_path: Path, size_m: float, thick: float) -> None:
    size = (size_m, size_m, thick * size_m)
    scene = _scene(tmp_path / "a.obj", size)
    view, words = overall_view(scene, least_m=0.2)
    depth = _seen(scene, view)["depth"][..., 0]
    ahead = (np.multiply(_BOX, size) - view[:3, 3]) @ view[:3, :3]
    assert room_place(scene) is None and depth[depth > 0].min() > 0.2
    assert depth[18, 32] <= 1.05 * MIDDLE_M
    if words == "all of it":
        half_view = np.abs(ahead[:, :2] / ahead[:, 2:] / np.tan(np.deg2rad((69.0, 42.0)) / 2.0)).max()
        assert 0.89 <= half_view <= 0.91 or ahead[:, 2].min() < 0.31
    else:
        assert size_m >= 2.0 and depth[18, 32] == pytest.approx(MIDDLE_M, rel=0.05) and np.mean(depth > 0) > 0.6


@pytest.mark.parametrize("side_m", [4.0, 12.0])
def test_a_closed_room_is_seen_from_inside_by_the_light_of_an_office(tmp_path: Path, side_m: float) -> None:
    scene = _scene(tmp_path / "a.obj", (side_m, 2.6, side_m), is_room=True)
    light_closed_room(scene)
    view, words = overall_view(scene, least_m=0.2)
    assert "inside" in words and np.all(np.abs(view[[0, 2], 3]) < side_m / 2) and 0 < view[1, 3] < 2.6
    seen = _seen(scene, view)
    assert seen["depth"].min() > 0.3 and np.median(seen["depth"]) < 1.5 * MIDDLE_M
    lux = LUMENS_PER_WATT * np.pi * float(np.mean(seen["radiance"]) / np.mean(seen["albedo"]))
    assert 0.25 * ROOM_LUX < lux < 2 * ROOM_LUX
    light_closed_room(scene)
    assert scene.summary.light_count == 1
