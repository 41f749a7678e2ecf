# SPDX-License-Identifier: Apache-2.0
"""Writes meshes and plain material dictionaries as a glTF 2.0 file: one self-contained .gltf or .glb."""

import base64
import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from activestereo.common.output_files import replace_file
from activestereo.scene_io.meshes import Mesh
from activestereo.scene_io.staging import LUMENS_PER_WATT

_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_FLOAT, _UINT = 5126, 5125
REPEAT, CLAMP, MIRROR = 10497, 33071, 33648  # glTF's codes for texture coordinates beyond 0..1


class GltfWriter:
    def __init__(self, generator: str = "activestereo") -> None:
        self._bytes = bytearray()
        self._json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": generator},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
        }

    def set_extras(self, **fields: Any) -> None:
        """Replaces the asset's `extras` by these fields (JSON values), for facts that glTF cannot express and this
        project's programs read."""
        self._json["asset"]["extras"] = fields

    def add_material(self, name: str, **fields: Any) -> int:
        """Adds a material with fields of glTF's `material`, declares its extensions, and returns its index."""
        for extension in fields.get("extensions", {}):
            self._use(extension)
        return self._append("materials", {"name": name, **fields})

    def add_texture(
        self, file_bytes: bytes, name: str, wrap: tuple[int, int] = (REPEAT, REPEAT), mime: str = "image/png"
    ) -> int:
        """Adds a texture and returns its index. file_bytes: a PNG or JPEG file, as `mime` says. wrap: REPEAT, CLAMP or
        MIRROR along u and v."""
        image = self._append("images", {"name": name, "mimeType": mime, "bufferView": self._view(file_bytes)})
        wraps = {} if wrap == (REPEAT, REPEAT) else {"wrapS": wrap[0], "wrapT": wrap[1]}
        sampler = self._append("samplers", {"magFilter": 9729, "minFilter": 9729, **wraps})
        return self._append("textures", {"source": image, "sampler": sampler})

    def add_mesh(
        self, name: str, mesh: Mesh, material: int, translation: Sequence[float] = (0.0, 0.0, 0.0), yaw_deg: float = 0.0
    ) -> None:
        """Adds a mesh and a node that shows it at `translation`, turned by yaw_deg about y."""
        half = np.deg2rad(yaw_deg) / 2
        shape, turn = self.add_shape(name, mesh, material), [0.0, float(np.sin(half)), 0.0, float(np.cos(half))]
        self._node(name, mesh=shape, translation=list(translation), rotation=turn)

    def add_placed_mesh(self, name: str, mesh: Mesh, material: int, local_to_world: np.ndarray) -> None:
        """Adds a mesh and a node that shows it with this 4x4 local_to_world."""
        self.place(name, self.add_shape(name, mesh, material), local_to_world)

    def add_shape(self, name: str, mesh: Mesh, material: int, colors: np.ndarray | None = None) -> int:
        """Adds a mesh without a node and returns its index, from which place() makes nodes. colors: linear RGBA of the
        vertices, float32 [n, 4]."""
        attributes = {
            "POSITION": self._accessor(mesh.positions, "VEC3", bounds=True),
            "NORMAL": self._accessor(mesh.normals, "VEC3"),
            "TEXCOORD_0": self._accessor(mesh.uvs, "VEC2"),
        }
        if colors is not None:
            attributes["COLOR_0"] = self._accessor(colors, "VEC4")
        indices = self._accessor(mesh.indices.reshape(-1), "SCALAR")
        primitive = {"attributes": attributes, "indices": indices, "material": material}
        return self._append("meshes", {"name": name, "primitives": [primitive]})

    def place(self, name: str, shape: int, local_to_world: np.ndarray) -> None:
        """Adds a node that shows a mesh of add_shape(), with this 4x4 local_to_world."""
        self._node(name, mesh=shape, matrix=_columns(local_to_world))

    def add_light(
        self, name: str, place: ArrayLike, color: Sequence[float], intensity: float, kind: str = "point",
        cone_rad: tuple[float, float] | None = None, **extras: Any,
    ) -> None:  # fmt: skip
        """Adds a light of kind "point", "directional" or "spot"; the last two shine along their node's -z. place: the
        node's translation [3] or its 4x4 local_to_world. intensity: W/sr, of a directional light W/m^2, at colour 1,
        for each channel. cone_rad: half angles, in radians, at which a spot's light begins to fall off and reaches 0.
        extras: the light's `extras`, for kuafu's importer."""
        self._use("KHR_lights_punctual")
        lights = self._json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {}).setdefault("lights", [])
        light: dict[str, Any] = {"name": name, "type": kind}
        if cone_rad is not None:
            light["spot"] = {"innerConeAngle": cone_rad[0], "outerConeAngle": cone_rad[1]}
        light |= {"color": list(color), "intensity": LUMENS_PER_WATT * intensity}  # candela or lux
        lights.append(light | ({"extras": extras} if extras else {}))
        where = {"translation" if np.ndim(place) == 1 else "matrix": _columns(place)}
        self._node(name, **where, extensions={"KHR_lights_punctual": {"light": len(lights) - 1}})

    def add_camera(self, name: str, camera_to_world: np.ndarray, vertical_fov: float, aspect_ratio: float) -> None:
        """Adds a camera. camera_to_world: 4x4 in camera axes (x right, y down, z forward), converted to glTF's (y up,
        looking along -z). vertical_fov: radians."""
        perspective = {"yfov": vertical_fov, "aspectRatio": aspect_ratio, "znear": 0.01}
        camera = self._append("cameras", {"name": name, "type": "perspective", "perspective": perspective})
        matrix = np.asarray(camera_to_world) @ np.diag([1.0, -1.0, -1.0, 1.0])
        self._node(name, camera=camera, matrix=_columns(matrix))

    def write(self, path: str | Path) -> None:
        """Writes a .gltf file, with the buffer inside as base64, or a .glb file. Raises ValueError for another
        suffix."""
        suffix = str(path).lower().rsplit(".", 1)[-1]
        if suffix not in ("gltf", "glb"):
            raise ValueError(f"{path}: a scene file ends in .gltf or .glb")
        buffer: dict[str, Any] = {"byteLength": len(self._bytes)}
        if suffix == "gltf":
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(self._bytes).decode()
        data = json.dumps({**self._json, "buffers": [buffer]}, indent=1 if suffix == "gltf" else None).encode()
        if suffix == "glb":  # glTF 2.0, section 4.4
            text, binary = data + b" " * (-len(data) % 4), bytes(self._bytes) + b"\0" * (-len(self._bytes) % 4)
            heads = (struct.pack("<II", len(part), kind) for part, kind in ((text, 0x4E4F534A), (binary, 0x004E4942)))
            chunks = b"".join(head + part for head, part in zip(heads, (text, binary), strict=True))
            data = struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks
        replace_file(path, lambda file: file.write(data))

    def _append(self, kind: str, entry: dict[str, Any]) -> int:
        entries = self._json.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def _node(self, name: str, **fields: Any) -> None:
        self._json["scenes"][0]["nodes"].append(self._append("nodes", {"name": name, **fields}))

    def _use(self, extension: str) -> None:
        used = self._json.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def _view(self, data: bytes, target: int | None = None) -> int:
        self._bytes.extend(b"\0" * (-len(self._bytes) % 4))
        view = {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": len(data)}
        if target:
            view["target"] = target
        self._bytes.extend(data)
        return self._append("bufferViews", view)

    def _accessor(self, array: np.ndarray, kind: str, bounds: bool = False) -> int:
        indices = array.dtype == np.uint32
        view = self._view(array.tobytes(), _ELEMENT_BUFFER if indices else _ARRAY_BUFFER)
        accessor = {
            "bufferView": view,
            "componentType": _UINT if indices else _FLOAT,
            "count": len(array),
            "type": kind,
        }
        if bounds:
            accessor["min"], accessor["max"] = array.min(axis=0).tolist(), array.max(axis=0).tolist()
        return self._append("accessors", accessor)


def _columns(matrix: ArrayLike) -> list[float]:
    """Returns a 4x4 as 16 numbers column by column, as glTF writes it; a vector as it is."""
    columns: list[float] = np.asarray(matrix, dtype=float).T.reshape(-1).tolist()
    return columns
