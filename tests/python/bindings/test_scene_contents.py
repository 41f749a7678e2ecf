# SPDX-License-Identifier: Apache-2.0
"""Meshes, textures and instances of a scene come back as they were added."""

import numpy as np
import pytest

import kuafu


def test_meshes_textures_and_instances_come_back_as_they_were_added(device):
    scene = kuafu.Scene(device)
    mesh = {
        "positions": np.arange(12, dtype=np.float32).reshape(4, 3),
        "indices": np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        "normals": np.tile(np.float32([0, 0, 1]), (4, 1)),
        "uvs": np.arange(8, dtype=np.float32).reshape(4, 2),
        "slots": np.array([0, 1], np.uint32),
        "name": "m",
        "uvs_1": None,
        "colors": np.full((4, 4), 0.5, np.float32),
    }
    texture = {"texels": np.arange(12, dtype=np.uint16).reshape(2, 2, 3), "srgb": False, "name": "t"}
    texture |= {"wrap": ("clamp", "mirror"), "filter": "nearest", "uv_set": 1}
    texture["uv_transform"] = np.float32([[1, 0, 0.5], [0, 2, 0]])
    pose = np.diag([1.0, 2.0, 3.0, 1.0])
    number = scene.add_mesh(**mesh)
    instance = {"mesh": number, "materials": [scene.add_material(kuafu.Material())], "local_to_world": pose}
    instance |= {"environment": 3, "semantic_id": 5, "name": "i"}
    for back, given in (
        (scene.get_mesh(number), mesh),
        (scene.get_texture(scene.add_texture(**texture)), texture),
        (scene.get_instance(scene.add_instance(**instance)), instance),
    ):
        assert back.keys() == given.keys()
        for key, value in given.items():
            np.testing.assert_array_equal(back[key], value, err_msg=key)
            assert getattr(back[key], "dtype", None) == getattr(value, "dtype", None), key
    with pytest.raises(kuafu.ArgumentError, match="there is no mesh"):
        scene.get_mesh(99)
