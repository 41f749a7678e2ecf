# SPDX-License-Identifier: Apache-2.0
"""A glTF file whose animations move a wall away from a camera at the world's origin."""

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np


class _Gltf:
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


def write_moving_wall(path: Path) -> Path:
    """A wall 2 m before the world's origin that goes 1 m back in 2 s, and whose morph target bends it as far in 1 s."""
    gltf = _Gltf()
    corners = gltf.accessor([[-9, -9, 2], [9, -9, 2], [0, 9, 2]], "VEC3")
    back = gltf.accessor([[0, 0, 1]] * 3, "VEC3")
    primitive = {"attributes": {"POSITION": corners}, "targets": [{"POSITION": back}]}
    two_s, one_s = gltf.accessor([0, 2], "SCALAR"), gltf.accessor([0, 1], "SCALAR")
    way, weights = gltf.accessor([[0, 0, 0], [0, 0, 1]], "VEC3"), gltf.accessor([0, 1], "SCALAR")

    def animation(name: str, path: str, times: int, values: int) -> dict[str, Any]:
        channel = {"sampler": 0, "target": {"node": 0, "path": path}}
        return {"name": name, "channels": [channel], "samplers": [{"input": times, "output": values}]}

    gltf.root |= {
        "meshes": [{"primitives": [primitive]}],
        "nodes": [{"name": "wall", "mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "animations": [animation("go", "translation", two_s, way), animation("bend", "weights", one_s, weights)],
    }
    return gltf.write(path)
