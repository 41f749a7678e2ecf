# SPDX-License-Identifier: Apache-2.0
"""Animations of glTF files from Python: what is listed, what moves, and what a camera sees of it."""

from pathlib import Path

import pytest
from moving_wall import write_moving_wall

import kuafu


def test_a_camera_sees_what_is_animated(device: kuafu.Device, tmp_path: Path) -> None:
    scene = kuafu.Scene(device)
    scene.load(write_moving_wall(tmp_path / "wall.gltf"))
    assert scene.summary.animation_count == 2
    assert [scene.animation_name(i) for i in range(2)] == ["go", "bend"]
    assert [scene.animation_duration_s(i) for i in range(2)] == [2.0, 1.0]
    renderer = kuafu.Renderer(device)
    camera = kuafu.Camera(16, 12, [[10, 0, 7.5], [0, 10, 5.5], [0, 0, 1]])

    def depth_m() -> float:
        return float(renderer.render(scene, camera, ["depth"])["depth"][0, 6, 8, 0])

    assert depth_m() == pytest.approx(2.0, abs=1e-6)
    for time_s, animation, expected_m in [(1.0, 0, 2.5), (0.5, 1, 2.5), (0.5, None, 2.75), (9.0, None, 4.0)]:
        scene.animate(time_s, animation)
        assert depth_m() == pytest.approx(expected_m, abs=1e-6)
    with pytest.raises(kuafu.ArgumentError, match="no animation 2"):
        scene.animate(0.0, 2)
    with pytest.raises(kuafu.ArgumentError, match="finite"):
        scene.animate(float("nan"))
