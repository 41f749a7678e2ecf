# SPDX-License-Identifier: Apache-2.0
"""glTF files whose textures are there as KTX2 alone (KHR_texture_basisu), by the package opengl_basisu where it is
installed: a copy of the file has them as PNG."""

from __future__ import annotations

import base64
import binascii
import json
import os
import struct
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from activestereo.common.input_files import read_bytes
from activestereo.common.output_files import write_bytes, write_png, write_text
from activestereo.scene_io.gltf_document import read_document, scale

if TYPE_CHECKING:
    import kuafu

_EXTENSION = "KHR_texture_basisu"


class Ktx2Error(ValueError):
    """A file's KTX2 textures cannot be shown; the text names the file and what to do."""


def needs_ktx2(path: str | Path) -> bool:
    """Whether a .gltf or .glb file has textures as KTX2 alone. What is no glTF that can be read is not told here."""
    path = Path(path)
    if path.suffix.lower() not in (".gltf", ".glb") or not path.is_file():
        return False
    try:
        document = read_document(path)[0]
        return _EXTENSION in document.get("extensionsRequired", []) or bool(_numbers(document))
    except (OSError, ValueError, AttributeError, TypeError, LookupError, RecursionError, struct.error):
        return False


def convert(path: str | Path, folder: str | Path) -> Path:
    """Writes a copy of the glTF file into the folder, its KTX2 textures as PNG, and returns the copy's path.

    Of an image mip level 0 is taken, RGB or RGBA of 8 bits, without any change from sRGB to linear or back. A texture
    that has another image as well keeps that one. Raises Ktx2Error of one line.
    """
    path, folder = Path(path), Path(folder)
    try:
        document, chunk = read_document(path)
        return _write(path, folder, document, chunk)
    except Ktx2Error:
        raise
    except (OSError, ValueError, AttributeError, TypeError, LookupError, RecursionError, struct.error) as error:
        raise Ktx2Error(f"{path}: its KTX2 textures cannot be read: {error}".splitlines()[0]) from error


def load_ktx2(scene: kuafu.Scene, path: str | Path, time_s: float | None = None, unit_m: float = 1.0) -> None:
    """Adds the glTF file at `path` to the scene, at that time of its animations. unit_m: metres of what the file takes
    for a metre. Raises Ktx2Error of one line, and what Scene.load raises."""
    with tempfile.TemporaryDirectory() as folder:
        scene.load(convert(path, folder), scale(unit_m), time_s=time_s, name=path)


def _numbers(document: dict[str, Any]) -> set[int]:
    """The images that textures have as KTX2 alone, by the extension or, as some exporters write it, without."""
    textures, images = document.get("textures", []), document.get("images", [])
    plain = {texture["source"] for texture in textures if "source" in texture}
    found = {number for number in plain if _is_ktx2(images[number])}
    alone = [texture.get("extensions", {}) for texture in textures if "source" not in texture]
    return found | {extensions[_EXTENSION]["source"] for extensions in alone if _EXTENSION in extensions}


def _is_ktx2(image: dict[str, Any]) -> bool:
    return image.get("mimeType") == "image/ktx2" or image.get("uri", "").lower().endswith(".ktx2")


def _write(path: Path, folder: Path, document: dict[str, Any], chunk: int | None) -> Path:
    """Buffers and images get files of their own beside the copy, so that no index changes."""
    buffers: list[bytes | None] = []
    for number, buffer in enumerate(document.get("buffers", [])):
        data: bytes | None = None
        if "uri" in buffer:
            data = _bytes(path, buffer["uri"])
        elif number == 0 and chunk is not None:
            data = read_bytes(path)[chunk : chunk + buffer["byteLength"]]
        buffers.append(data)
        if data is not None:  # what is left is filled by an extension, as EXT_meshopt_compression does
            buffer["uri"] = f"buffer_{number}.bin"
            write_bytes(folder / buffer["uri"], data)
    wanted = _numbers(document)
    for number, image in enumerate(document.get("images", [])):
        if number in wanted:
            pixels = _decoded(path, number, _image_bytes(path, document, buffers, image))
            document["images"][number] = {"name": image.get("name", ""), "uri": f"image_{number}.png"}
            write_png(folder / f"image_{number}.png", pixels)
        elif "uri" in image and not image["uri"].startswith("data:") and _is_used(document, number):
            data = _bytes(path, image["uri"])
            image["uri"] = f"image_{number}{Path(image['uri']).suffix}"
            write_bytes(folder / image["uri"], data)
    for texture in document.get("textures", []):
        found = texture.get("extensions", {}).pop(_EXTENSION, None)
        if found is not None:
            texture.setdefault("source", found["source"])
    for key in ("extensionsUsed", "extensionsRequired"):
        left = [name for name in document.pop(key, []) if name != _EXTENSION]
        if left:
            document[key] = left
    out = folder / f"{path.stem}.gltf"
    write_text(out, json.dumps(document))
    return out


def _is_used(document: dict[str, Any], number: int) -> bool:
    """Whether a texture has the image in another way than as KTX2."""
    for texture in document.get("textures", []):
        others = [value for name, value in texture.get("extensions", {}).items() if name != _EXTENSION]
        if number in [texture.get("source"), *(other.get("source") for other in others)]:
            return True
    return False


def _image_bytes(path: Path, document: dict[str, Any], buffers: list[bytes | None], image: dict[str, Any]) -> bytes:
    if "uri" in image:
        return _bytes(path, image["uri"])
    view = document["bufferViews"][image["bufferView"]]
    start = view.get("byteOffset", 0)
    return (buffers[view["buffer"]] or b"")[start : start + view["byteLength"]]


def _bytes(path: Path, uri: str) -> bytes:
    if not uri.startswith("data:"):
        file = (path.parent / unquote(uri)).resolve()
        # As kuafu's own importer has it.
        if os.environ.get("KUAFU_LOAD_OUTSIDE") != "1" and not file.is_relative_to(path.parent.resolve()):
            raise Ktx2Error(
                f"{path}: '{uri}' is outside the file's folder: if the file is to be trusted, set KUAFU_LOAD_OUTSIDE=1"
            )
        if not file.is_file():
            raise Ktx2Error(f"{path}: '{uri}' is not there, or no regular file")
        return read_bytes(file)
    try:
        return base64.b64decode(uri.partition(",")[2])
    except binascii.Error as error:
        raise ValueError(f"a data URI is not base64: {error}") from error


def _decoded(path: Path, number: int, data: bytes) -> NDArray[np.uint8]:
    """Level 0 of a KTX2 file, [height, width, 3 or 4], with the numbers that are stored."""
    try:
        import opengl_basisu
    except ImportError as error:
        raise Ktx2Error(
            f"{path}: KTX2 textures are read by the package opengl_basisu, which is missing: "
            "pip install --pre opengl_basisu, or export PNG, JPEG or WebP"
        ) from error
    try:
        texture = opengl_basisu.open(data)
        pixels: NDArray[np.uint8] = texture.transcode("rgba8", level=0).data
    except ValueError as error:
        raise Ktx2Error(f"{path}: images[{number}] is no KTX2 that can be read: {error}".splitlines()[0]) from error
    return np.ascontiguousarray(pixels if texture.has_alpha else pixels[:, :, :3])
