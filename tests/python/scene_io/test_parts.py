# SPDX-License-Identifier: Apache-2.0
"""Meshes and materials of files in Python are those that are rendered."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import activestereo
from activestereo.scene_io.parts import read_parts

# A concave quad of 1 m^2 in the plane z = 0, an arrow.
ARROW = "0 0 0\n2 -1 0\n1 0 0\n2 1 0\n"
OBJ = "mtllib a.mtl\n" + "".join(f"v {line}\n" for line in ARROW.splitlines()) + "o arrow\nusemtl black\nf 1 2 3 4\n"
HEADER = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
PLY = "ply\nformat ascii 1.0\ncomment TextureFile red.png\n" + HEADER + "property float s\nproperty float t\n"
PLY += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
PLY += "".join(f"{line} 0.5 0.25\n" for line in ARROW.splitlines()) + "4 0 1 2 3\n"


def area_m2(mesh):
    a, b, c = (mesh.positions[mesh.indices[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def test_parts_have_the_files_materials_and_textures(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl black\nKd 0.02 0.02 0.02\n")
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "a.ply").write_text(PLY)
    cv2.imwrite(str(tmp_path / "red.png"), np.full((2, 3, 3), (0, 0, 255), np.uint8))
    black, red = read_parts(tmp_path / "a.obj")[0], read_parts(tmp_path / "a.ply")[0]
    assert black.material.base_color == pytest.approx((0.02, 0.02, 0.02, 1.0)) and not black.textures
    texels = red.textures["base_color_texture"]["texels"]
    assert texels.shape == (2, 3, 3) and (texels == (255, 0, 0)).all()
    assert np.allclose(red.mesh.uvs, (0.5, 0.75))  # v points down
    for part in (black, red):
        assert len(part.mesh.indices) == 2 and area_m2(part.mesh) == pytest.approx(1.0)
        assert np.allclose(part.mesh.normals, (0, 0, 1))


def test_a_file_without_a_mesh_is_said(tmp_path):
    (tmp_path / "points.ply").write_text("ply\nformat ascii 1.0\n" + HEADER + "end_header\n" + ARROW)
    for name, said in (("points.ply", "this is a point cloud: it has 4 points"), ("gone.stl", "there is no such file")):
        with pytest.raises(ValueError, match=rf"{name}: {said}"):
            read_parts(tmp_path / name)


def test_scene_files_are_loaded_in_one_place():
    """Captures, data sets and sensors read what `simulate` does, for nothing but scene_io calls Scene.load."""
    package = Path(activestereo.__file__).resolve().parent
    calls = re.compile(r"\b(?:scene|_scene|alone)\.load\(")
    found = {str(path.relative_to(package)) for path in package.rglob("*.py") if calls.search(path.read_text("utf-8"))}
    assert found == {f"scene_io/{name}.py" for name in ("parts", "scene_files", "usd/convert")}
