# SPDX-License-Identifier: Apache-2.0
"""Puts a part into a copy of a glTF scene: a node of its name gets the pose, or a new node, mesh and material are
added. The copy is one .gltf file with everything inside."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.input_files import read_bytes
from activestereo.common.output_files import replace_file
from activestereo.scene_io.gltf_document import read_document
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.meshes import Mesh

if TYPE_CHECKING:
    from activestereo.capture.capture import Camera

_MIME = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg"}


def node_pose(scene_path: Path, name: str) -> NDArray[np.float64] | None:
    """local_to_world of a node that stands directly in the scene; None where there is none of the name.

    ValueError where it hangs below another node.
    """
    document, _ = _read(scene_path)
    node = _root_node(scene_path, document, name)
    return None if node is None else _matrix(node)


def write_placed(
    scene_path: Path,
    out: Path,
    name: str,
    mesh: Mesh,
    local_to_world: NDArray[np.float64],
    view: tuple[Camera, NDArray[np.float64]] | None = None,
) -> None:
    """Writes the scene with the part at its pose to `out` (.gltf). view: (camera, camera_to_world) that a scene without
    a camera gets."""
    document, buffers = _read(scene_path)
    node = _root_node(scene_path, document, name)
    matrix = np.asarray(local_to_world, dtype=float).T.reshape(-1).tolist()
    if node is not None:
        for key in ("translation", "rotation", "scale"):
            node.pop(key, None)
        node["matrix"] = matrix
    else:
        _append(document, buffers, name, mesh, local_to_world)
    if view is not None and not document.get("cameras"):
        _add_camera(document, *view)
    document["buffers"] = [
        {"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}
        for data in buffers
    ]
    text = json.dumps(document, indent=1) + "\n"
    replace_file(out, lambda file: file.write(text.encode()))


def _append(document: dict[str, Any], buffers: list[bytes], name: str, mesh: Mesh, pose: NDArray[np.float64]) -> None:
    """The part as a document of its own, whose indices are shifted behind those of the scene."""
    writer = GltfWriter()
    material = writer.add_material(name, pbrMetallicRoughness={"metallicFactor": 0.0, "roughnessFactor": 0.6})
    writer.add_placed_mesh(name, mesh, material, pose)
    own, data = writer.document()
    shift = {kind: len(document.get(kind, [])) for kind in ("bufferViews", "accessors", "meshes", "materials", "nodes")}
    for view in own["bufferViews"]:
        view["buffer"] = len(buffers)
    for accessor in own["accessors"]:
        accessor["bufferView"] += shift["bufferViews"]
    primitive = own["meshes"][0]["primitives"][0]
    primitive["attributes"] = {key: value + shift["accessors"] for key, value in primitive["attributes"].items()}
    primitive["indices"] += shift["accessors"]
    primitive["material"] += shift["materials"]
    own["nodes"][0]["mesh"] += shift["meshes"]
    for kind in shift:
        document.setdefault(kind, []).extend(own[kind])
    scenes = document.setdefault("scenes", [{}])
    scenes[document.setdefault("scene", 0)].setdefault("nodes", []).append(shift["nodes"])
    buffers.append(data)


def _add_camera(document: dict[str, Any], camera: Camera, camera_to_world: NDArray[np.float64]) -> None:
    angle = 2.0 * float(np.arctan(0.5 * camera.height / camera.K[1, 1]))
    perspective = {"yfov": angle, "aspectRatio": camera.width / camera.height, "znear": 0.01}
    document["cameras"] = [{"name": "first view", "type": "perspective", "perspective": perspective}]
    # glTF's camera looks along -z with y up.
    matrix = (camera_to_world @ np.diag([1.0, -1.0, -1.0, 1.0])).T.reshape(-1).tolist()
    document["nodes"].append({"name": "first view", "camera": 0, "matrix": matrix})
    document["scenes"][document["scene"]]["nodes"].append(len(document["nodes"]) - 1)


def _root_node(path: Path, document: dict[str, Any], name: str) -> dict[str, Any] | None:
    nodes = document.get("nodes", [])
    found = [k for k, node in enumerate(nodes) if node.get("name") == name]
    if not found:
        return None
    roots = document.get("scenes", [{}])[document.get("scene", 0)].get("nodes", [])
    if len(found) > 1 or found[0] not in roots:
        raise ValueError(
            f"{path}: the node '{name}' is there twice or hangs below another: make it a node of the scene"
        )
    chosen: dict[str, Any] = nodes[found[0]]
    return chosen


def _matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    pose = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)))
    pose[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return pose


def _read(path: Path) -> tuple[dict[str, Any], list[bytes]]:
    """The document and its buffers; images of other files become data URIs."""
    try:
        document, chunk_at = read_document(path)
    except ValueError as error:
        raise ValueError(f"{path}: is not glTF: {error}") from error
    chunk = b"" if chunk_at is None else read_bytes(path)[chunk_at:]
    buffers = [_bytes(path, entry.get("uri"), chunk)[: entry["byteLength"]] for entry in document.get("buffers", [])]
    for image in document.get("images", []):
        uri = image.get("uri", "data:")
        if not uri.startswith("data:"):
            kind = _MIME.get(Path(uri).suffix.lower(), "image/png")
            image["uri"] = f"data:{kind};base64," + base64.b64encode(read_bytes(path.parent / uri)).decode()
    return document, buffers


def _bytes(path: Path, uri: str | None, chunk: bytes) -> bytes:
    if uri is None:
        return chunk
    return base64.b64decode(uri.partition(",")[2]) if uri.startswith("data:") else read_bytes(path.parent / uri)
