# SPDX-License-Identifier: Apache-2.0
"""A .glb file taken apart, as glTF 2.0 lays it out."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from activestereo.scene_io.scene_files import read_document
from PIL import Image


class Glb:
    def __init__(self, path: Path) -> None:
        self.document = read_document(path)
        data = path.read_bytes()
        self._buffer = data[28 + int.from_bytes(data[12:16], "little") :]
        self.material = {m["name"]: m for m in self.document["materials"]}

    def _bytes(self, view: int) -> bytes:
        entry = self.document["bufferViews"][view]
        return self._buffer[entry["byteOffset"] : entry["byteOffset"] + entry["byteLength"]]

    def pixel(self, material: str, texture: str) -> Any:
        """The first pixel of a material's texture."""
        number = self.material[material]["pbrMetallicRoughness"][texture]["index"]
        image = self.document["images"][self.document["textures"][number]["source"]]
        return Image.open(io.BytesIO(self._bytes(image["bufferView"]))).getpixel((0, 0))

    def values(self, name: str) -> np.ndarray:
        """[n][components] of an attribute of the first mesh, or its "indices"."""
        primitive = self.document["meshes"][0]["primitives"][0]
        accessor = self.document["accessors"][({"indices": primitive["indices"]} | primitive["attributes"])[name]]
        kind = {5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        return np.frombuffer(self._bytes(accessor["bufferView"]), kind).reshape(accessor["count"], -1)
