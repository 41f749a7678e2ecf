# SPDX-License-Identifier: Apache-2.0
"""AOVs and formats through the bindings: a wall at 2 m, a projector 0.1 m to the right of the camera."""

import numpy as np
import pytest

import kuafu
from activestereo.common.pose import rigid_motion

CAMERA = kuafu.Camera(16, 12, [[20, 0, 7.5], [0, 20, 5.5], [0, 0, 1]])
Z = 2.0


@pytest.fixture(scope="module")
def scene(device):
    scene = kuafu.Scene(device)
    wall = np.array([[-9, -9, Z], [9, -9, Z], [9, 9, Z], [-9, 9, Z]], np.float32)
    mesh = scene.add_mesh(wall, np.array([[0, 2, 1], [0, 3, 2]], np.uint32))
    scene.add_instance(mesh, [scene.add_material(kuafu.Material(ir_albedo=0.3, specular=0.0))], semantic_id=5)
    pattern = scene.add_texture(np.ones((64, 64, 1), np.float32))
    pose, k = rigid_motion((0.1, 0, 0)), [[20, 0, 31.5], [0, 20, 31.5], [0, 0, 1]]
    scene.add_light(kuafu.Light(kind="projector", texture=pattern, ir_intensity=1.0, k=k, light_to_world=pose))
    scene.set_environment((0.5, 0.5, 0.5), 0.5, light_group=2)
    return scene


@pytest.fixture(scope="module")
def renderer(device):
    return kuafu.Renderer(device)


def test_dtypes_and_scales(renderer, scene):
    outputs = {
        "depth": np.uint16, "radiance": np.float16, "ambient": "uint8", "light_group_2": None,
        "instance_id": np.uint8,
    }  # fmt: skip
    images = renderer.render(scene, CAMERA, outputs, spp=4, scales={"depth": 1000})
    assert {name: image.dtype.name for name, image in images.items()} == {
        "depth": "uint16", "radiance": "float16", "ambient": "uint8", "light_group_2": "float32",
        "instance_id": "uint8",
    }  # fmt: skip
    assert np.all(images["depth"] == 2000) and np.all(images["instance_id"] == 0)
    np.testing.assert_allclose(images["ambient"], 255 * images["light_group_2"], atol=0.51)


def test_motion_of_cameras_and_of_frames(renderer, scene):
    before = rigid_motion((-0.2, 0, 0))
    motion = renderer.render(scene, CAMERA, ["motion"], previous_poses=before)["motion"]
    np.testing.assert_allclose(motion[..., 0], -20 * 0.2 / Z, atol=1e-4)
    scene.next_frame()
    assert np.all(renderer.render(scene, CAMERA, ["motion"])["motion"] == 0)


def test_wrong_words_are_named(renderer, scene):
    with pytest.raises(ValueError, match="dtype"):
        renderer.render(scene, CAMERA, {"depth": "colour"})
    with pytest.raises(ValueError, match="int64"):
        renderer.render(scene, CAMERA, {"depth": np.int64})
    with pytest.raises(ValueError, match="scales has 'normal'"):
        renderer.render(scene, CAMERA, ["depth"], scales={"normal": 2})
    with pytest.raises(ValueError, match="AMBIENT_DIRECT and light groups"):
        renderer.render(scene, CAMERA, ["ambient_direct", "light_group_0"])
    with pytest.raises(ValueError, match=r"\(2, 4, 4\)"):
        renderer.render(scene, [CAMERA, CAMERA], ["motion"], previous_poses=np.zeros((3, 4, 4)))
    with pytest.raises(ValueError, match="projector is 8"):  # as C counts
        renderer.render(scene, CAMERA, ["projector_uv"], projector=7)


def test_calls_that_accumulate(renderer, scene):
    once = renderer.render(scene, CAMERA, ["radiance", "variance"], spp=64)
    for calls in (1, 2, 3, 4):
        parts = renderer.render(scene, CAMERA, ["radiance", "variance", "sample_count"], spp=16, accumulate=True)
        assert np.all(parts["sample_count"] == 16 * calls) and parts["sample_count"].dtype == np.uint32
        assert (renderer.summary.samples_per_pixel, renderer.summary.call_samples_per_pixel) == (16 * calls, 16)
    np.testing.assert_allclose(parts["radiance"], once["radiance"], rtol=1e-5)


def test_a_noise_budget(renderer, scene):
    renderer.render(scene, CAMERA, spp=10000, relative_error=0.01)
    assert renderer.summary.relative_error <= 0.01
    assert renderer.summary.samples_per_pixel < 10000
    assert renderer.summary.seconds > 0
    with pytest.raises(ValueError, match="max_seconds is -1"):
        renderer.render(scene, CAMERA, max_seconds=-1)
