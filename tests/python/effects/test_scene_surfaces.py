# SPDX-License-Identifier: Apache-2.0
"""Surfaces: a material on an object. Names and numbers follow from the file, and the scene gets a material for each."""

import numpy as np
import pytest

import kuafu
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.meshes import box, sphere
from activestereo.effects.core.surfaces import names_of, numbers_of, scene_surfaces, split_surfaces, surface_names

NAMES = ["paint of ball", "steel", "paint of crate"]


@pytest.fixture(params=["gltf", "glb"])
def path(request, tmp_path):
    """Ball and crate of one paint, a second ball of steel; a child without a mesh before them."""
    writer = GltfWriter()
    paint = writer.add_material("paint", extras={"ir_albedo": 0.6})
    steel = writer.add_material("steel")
    writer.add_point_light("lamp", (0, 1, 0), (1, 1, 1), 1.0)
    writer.add_mesh("ball", sphere(0.1), paint, (-0.2, 0.0, 0.0))
    writer.add_mesh("crate", box(0.1, 0.1, 0.1), paint, (0.2, 0.0, 0.0))
    writer.add_mesh("weight", sphere(0.1), steel)
    writer.write(tmp_path / f"scene.{request.param}")
    return tmp_path / f"scene.{request.param}"


def test_a_material_of_two_objects_is_two_surfaces(path):
    assert surface_names(path) == NAMES
    assert [surface.material for surface in scene_surfaces(path)] == [0, 1, 0]


def test_each_surface_has_a_material_of_its_own(path, device):
    scene = kuafu.Scene(device)
    scene.load(path)
    split_surfaces(scene, path)
    assert [scene.material_name(k) for k in range(scene.summary.material_count)] == NAMES
    assert scene.get_material(2).ir_albedo == pytest.approx(0.6)
    camera = kuafu.Camera(
        64,
        24,
        [[60, 0, 32], [0, 60, 12], [0, 0, 1]],
        np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.8], [0, 0, 0, 1.0]]),
    )
    seen = kuafu.Renderer(device).render(scene, [camera], ("material_id", "instance_id"), spp=1)
    pairs = {
        (int(i), int(m))
        for i, m in zip(seen["instance_id"].ravel(), seen["material_id"].ravel(), strict=True)
        if i != 0xFFFFFFFF
    }
    assert {(scene.instance_name(i), m) for i, m in pairs} == {("ball", 0), ("crate", 2), ("weight", 1)}


def test_a_whole_material_has_its_own_name(path):
    assert names_of([0, 2], NAMES) == ("paint",)
    assert names_of([0, 1], NAMES) == ("paint of ball", "steel")
    assert numbers_of("paint", NAMES) == [0, 2]
    assert numbers_of("paint of crate", NAMES) == [2]
    assert numbers_of("wood", NAMES) == []


def test_a_scene_that_is_not_the_files_is_refused(path, device):
    scene = kuafu.Scene(device)
    with pytest.raises(ValueError, match="the scene has 0 objects, its file 3"):
        split_surfaces(scene, path)


def test_what_cannot_be_read_has_no_surfaces(tmp_path):
    (tmp_path / "scene.gltf").write_text("{")
    assert scene_surfaces(tmp_path / "scene.gltf") == []
    assert scene_surfaces(None) == []
