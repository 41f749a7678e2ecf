# SPDX-License-Identifier: Apache-2.0
"""The example scene, meshes and their parts."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import activestereo
import kuafu
from activestereo.scene_io import meshes
from activestereo.scene_io.example_scene import CAMERA_TO_WORLD, LAMPS, WHITE_LM_PER_W, main, write_table_top
from activestereo.scene_io.parts import read_parts
from activestereo.scene_io.staging import ROOM_RADIANCE

SOLIDS = {
    "box": (meshes.box(0.2, 0.3, 0.4), 0.2 * 0.3 * 0.4),
    "sphere": (meshes.sphere(0.5), 4 / 3 * np.pi * 0.5**3),
    "torus": (meshes.torus(0.5, 0.1), 2 * np.pi**2 * 0.5 * 0.1**2),
    "tumbler": (meshes.tumbler(0.04, 0.12, 0.004, 0.012), np.pi * (0.04**2 * 0.12 - 0.036**2 * 0.108)),
    "vase": (meshes.vase(0.2), None),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_hold_their_volume_and_have_unit_normals_on_the_face_side(name):
    """By the divergence theorem; a hole or a face turned inwards changes the sum."""
    mesh, volume = SOLIDS[name]
    a, b, c = (mesh.positions[mesh.indices[:, k]].astype(np.float64) for k in range(3))
    area = 0.5 * np.cross(b - a, c - a)
    np.testing.assert_allclose(area.sum(axis=0), 0.0, atol=1e-6)
    measured = (area * (a + b + c) / 9.0).sum()
    assert measured > 0
    if volume:
        assert measured == pytest.approx(volume, rel=0.01)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)
    face = area / np.linalg.norm(area, axis=1, keepdims=True)
    for corner in range(3):
        assert np.einsum("ij,ij->i", face, mesh.normals[mesh.indices[:, corner]]).min() > 0.5


@pytest.mark.parametrize("suffix", ["gltf", "glb"])
def test_file_has_the_same_bytes_each_time_and_is_read_back_whole(tmp_path, device, suffix):
    path, again = (tmp_path / f"{name}.{suffix}" for name in ("scene", "again"))
    for file in (path, again):
        write_table_top(file)
    assert path.read_bytes() == again.read_bytes()
    scene = kuafu.Scene(device)
    scene.load(path)
    names = {scene.material_name(i): scene.get_material(i) for i in range(scene.summary.material_count)}
    assert names["steel"].metallic == 1.0 and names["steel"].ir_albedo == pytest.approx(0.68)
    assert names["glass"].transmission == 1.0 and names["glass"].ior == 1.5
    assert names["clay"].specular == 0.0
    assert names["velvet"].ir_albedo < 0.01
    assert names["wood"].base_color_texture is not None
    assert scene.summary.light_count == 2 and max(scene.get_light(0).intensity) == pytest.approx(LAMPS[0][3])
    np.testing.assert_allclose(scene.camera(0).camera_to_world, CAMERA_TO_WORLD, atol=1e-6)


def test_the_table_is_lit_as_a_room_is():
    """Inverse square and cosine of both lamps, and half of the sky, of which the wall takes a part of its own."""
    places = [(np.array(place), power) for _, place, _, power in LAMPS]
    lamps = sum(power * place[1] / np.linalg.norm(place) ** 3 for place, power in places)
    assert 300.0 < WHITE_LM_PER_W * lamps + WHITE_LM_PER_W * np.pi * ROOM_RADIANCE < 500.0
    assert WHITE_LM_PER_W * lamps == pytest.approx(240.0, rel=0.02)


def test_wrong_use_is_one_line(tmp_path, capsys):
    for words in ([], [str(tmp_path / "scene.obj")], [str(tmp_path / "no" / "scene.glb")]):
        assert main(words) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3 and not list(tmp_path.iterdir())


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
