# SPDX-License-Identifier: Apache-2.0
"""Animations of glTF files from Python: what is listed, what moves, and what a camera sees of it."""

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kuafu


class Gltf:
    """A glTF file with its data inside."""

    def __init__(self) -> None:
        self.data = b""
        self.root: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "accessors": [], "bufferViews": []}

    def accessor(self, values: Sequence[Any], kind: str) -> int:
        array = np.array(values, np.float32)
        self.root["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes})
        self.root["accessors"].append(
            {"bufferView": len(self.root["bufferViews"]) - 1, "componentType": 5126, "count": len(array), "type": kind}
        )
        self.data += array.tobytes()
        return len(self.root["accessors"]) - 1

    def write(self, path: Path) -> Path:
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.root["buffers"] = [{"uri": uri, "byteLength": len(self.data)}]
        path.write_text(json.dumps(self.root))
        return path


@pytest.fixture
def wall(tmp_path: Path) -> Path:
    """A wall 2 m before the world's origin that goes 1 m back in 2 s, and whose morph target bends it as far in 1 s."""
    gltf = Gltf()
    corners = gltf.accessor([[-9, -9, 2], [9, -9, 2], [0, 9, 2]], "VEC3")
    back = gltf.accessor([[0, 0, 1]] * 3, "VEC3")
    primitive = {"attributes": {"POSITION": corners}, "targets": [{"POSITION": back}]}
    two_s, one_s = gltf.accessor([0, 2], "SCALAR"), gltf.accessor([0, 1], "SCALAR")
    way, weights = gltf.accessor([[0, 0, 0], [0, 0, 1]], "VEC3"), gltf.accessor([0, 1], "SCALAR")
    target = {"node": 0, "path": "translation"}
    gltf.root |= {
        "meshes": [{"primitives": [primitive]}],
        "nodes": [{"name": "wall", "mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "animations": [
            {
                "name": "go",
                "channels": [{"sampler": 0, "target": target}],
                "samplers": [{"input": two_s, "output": way}],
            },
            {
                "name": "bend",
                "channels": [{"sampler": 0, "target": target | {"path": "weights"}}],
                "samplers": [{"input": one_s, "output": weights}],
            },
        ],
    }
    return gltf.write(tmp_path / "wall.gltf")


def test_a_camera_sees_what_is_animated(device: kuafu.Device, wall: Path) -> None:
    scene = kuafu.Scene(device)
    scene.load(wall)
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


def test_a_file_is_loaded_at_a_time(device: kuafu.Device, wall: Path) -> None:
    scene = kuafu.Scene(device)
    scene.load(wall, time_s=1.0)
    assert scene.summary.bounds_min_m[2] == pytest.approx(3.5)
