# SPDX-License-Identifier: Apache-2.0
"""Reads one scene of a BOP benchmark data set (Hodan et al., ECCV 2018).

The scene's folder has rgb/ or gray/, depth/, scene_camera.json with K and millimetres, and scene_gt.json with the
objects' poses; models/ lies beside the data set's scenes. The world is that of cam_R_w2c. Without it the world is the
first frame's camera, and the first object's poses place the other cameras."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from activestereo.capture.importers.color_depth import (
    ColorDepthFrame,
    ColorDepthRecording,
    camera_matrix_of,
    image_files,
)
from activestereo.common.input_files import read_json_object
from activestereo.common.pose import printed_motion
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.parts import read_parts

_MM = 0.001
_RATE_HZ = 30.0
_GREY = [0.5, 0.5, 0.5, 1.0]


def read_bop(folder: Path, scene: Path, depth_scale: float | None = None) -> ColorDepthRecording:
    """Reads a scene as a ColorDepthRecording. scene: path at which a glTF file of the objects is written, if there are
    models. Raises ValueError with file, key and value."""
    path = folder / "scene_camera.json"
    cameras, poses = read_json_object(path), folder / "scene_gt.json"
    truth = read_json_object(poses) if poses.is_file() else {}
    depths, colors = image_files(folder / "depth"), image_files(folder / "rgb") or image_files(folder / "gray")
    frames, Ks, first = [], [], min(cameras, key=int, default="")
    for number, name in enumerate(sorted(cameras, key=int)):
        entry, stem = cameras[name], f"{int(name):06d}"
        if stem not in depths:
            raise ValueError(f"{folder / 'depth'}: {stem}.png: is missing, scene_camera.json has frame {name}")
        Ks.append(camera_matrix_of(path, f"{name}.cam_K", entry.get("cam_K")))
        if depth_scale is None and not entry.get("depth_scale"):
            raise ValueError(f"{path}: {name}.depth_scale: is missing: give --depth-scale")
        scale = _MM * float(entry["depth_scale"]) if depth_scale is None else depth_scale
        pose: NDArray[np.float64] | None = None
        if "cam_R_w2c" in entry:
            pose = np.linalg.inv(_motion(path, name, entry, "w2c"))
        elif truth.get(name) and truth.get(first):
            here, there = (_motion(path, n, truth[n][0], "m2c") for n in (name, first))
            pose = there @ np.linalg.inv(here)
        frames.append(ColorDepthFrame(number / _RATE_HZ, depths[stem], colors.get(stem), scale, pose))
    if not frames:
        raise ValueError(f"{path}: has no frames")
    if any(not np.allclose(K, Ks[0], atol=1e-6) for K in Ks):
        raise ValueError(f"{path}: cam_K: differs between the frames: import frames of one camera")
    # The objects of the first frame that have models.
    models = next((p / "models" for p in (folder.parent, folder.parent.parent) if (p / "models").is_dir()), None)
    to_world, writer, has_objects = frames[0].camera_to_world, GltfWriter("activestereo import"), False
    for number, entry in enumerate(truth.get(first, []) if models is not None and to_world is not None else ()):
        assert models is not None and to_world is not None
        file = models / f"obj_{int(entry['obj_id']):06d}.ply"
        if not file.is_file():
            continue
        name = f"object {entry['obj_id']}" + (f" ({number})" if number else "")
        pose = to_world @ _motion(folder / "scene_gt.json", first, entry, "m2c")
        for part in read_parts(file):
            # The red of a part's colours is its infrared albedo (the capture's specification); one without colours is
            # grey.
            pbr: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.6}
            if part.material is not None:
                pbr["baseColorFactor"] = list(part.material.base_color)
            elif part.colors is None:
                pbr["baseColorFactor"] = _GREY
            if "base_color_texture" in part.textures:
                texture = part.textures["base_color_texture"]
                png = io.BytesIO()
                Image.fromarray(np.squeeze(texture["texels"])).save(png, "PNG")
                pbr["baseColorTexture"] = {"index": writer.add_texture(png.getvalue(), texture["name"])}
            mesh = replace(part.mesh, positions=part.mesh.positions * np.float32(_MM))
            material = writer.add_material(name, pbrMetallicRoughness=pbr)
            writer.place(name, writer.add_shape(name, mesh, material, part.colors), pose)
        has_objects = True
    if has_objects:
        writer.write(scene)
    return ColorDepthRecording(folder, "a BOP scene", Ks[0], tuple(frames), scene if has_objects else None)


def _motion(path: Path, key: str, entry: dict[str, Any], way: str) -> NDArray[np.float64]:
    """Reads the 4x4 pose in metres of an entry's cam_R_ and cam_t_. way: w2c (world to camera) or m2c (model to
    camera)."""
    name, translation = f"{path}: {key}.cam_R_{way}, cam_t_{way}", entry.get(f"cam_t_{way}")
    pose = printed_motion(entry[f"cam_R_{way}"], translation if translation is not None else (), name)
    pose[:3, 3] *= _MM
    return pose
