# SPDX-License-Identifier: Apache-2.0
"""Writes solids as scene.gltf and scene.bin: Lambertian materials with `extras.ir_albedo`, smooth normals."""

import json
from pathlib import Path

import numpy as np


def write_gltf(folder, solids):
    """Writes scene.gltf and scene.bin into `folder` and returns the path of the .gltf."""
    blob, views, accessors, meshes, nodes, materials = b"", [], [], [], [], []

    def accessor(array, kind, component, bounds):
        nonlocal blob
        data = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        entry = {
            "bufferView": len(views) - 1,
            "componentType": component,
            "count": array.size // (3 if kind == "VEC3" else 1),
        }
        if bounds:
            entry |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append(entry | {"type": kind})
        blob += data + b"\0" * (-len(data) % 4)
        return len(accessors) - 1

    for i, solid in enumerate(solids):
        positions, normals, faces = solid.triangles()
        attributes = {
            "POSITION": accessor(positions.astype("<f4"), "VEC3", 5126, True),
            "NORMAL": accessor(normals.astype("<f4"), "VEC3", 5126, False),
        }
        indices = accessor(faces.ravel().astype("<u4"), "SCALAR", 5125, False)
        meshes.append(
            {"name": solid.name, "primitives": [{"attributes": attributes, "indices": indices, "material": i}]}
        )
        nodes.append({"name": solid.name, "mesh": i})
        materials.append(_lambertian(solid))
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular"],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"uri": "scene.bin", "byteLength": len(blob)}],
    }
    folder = Path(folder)
    (folder / "scene.bin").write_bytes(blob)
    (folder / "scene.gltf").write_text(json.dumps(document))
    return folder / "scene.gltf"


def _lambertian(solid):
    gray = float(np.float32(solid.albedo))
    return {
        "name": solid.name,
        "doubleSided": True,
        "pbrMetallicRoughness": {
            "baseColorFactor": [gray, gray, gray, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
        "extras": {"ir_albedo": gray},
    }
