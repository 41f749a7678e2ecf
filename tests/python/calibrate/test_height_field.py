# SPDX-License-Identifier: Apache-2.0
"""A measured depth map becomes a scene that, rendered from the same place, has the same depth."""

import numpy as np
import pytest

import kuafu
from activestereo.capture.capture import Camera, Capture, Frame, Projector, Rig
from activestereo.capture.write import write_capture
from activestereo.cli import main
from activestereo.common.pose import look_at, rigid_motion
from command_line import led_on, refused

_K = np.array([[80.0, 0, 47.5], [0, 80.0, 35.5], [0, 0, 1.0]])
_POSE = look_at(eye=(0.2, 0.3, 0.9), target=(0.0, 0.0, 0.0), up=(0, 1, 0))


@pytest.fixture
def step(tmp_path):
    """A wall at 0.8 m whose right half stands at 0.6 m, three times with 1 mm of noise, and a hole."""
    rng = np.random.default_rng(1)
    true = np.full((72, 96), 0.8)
    true[:, 48:] = 0.6
    depths = {k: np.rint(1e4 * (true + rng.normal(0, 1e-3, true.shape))).astype(np.uint16) for k in range(3)}
    for depth in depths.values():
        depth[10:20, 10:20] = 0
    camera, right = Camera(96, 72, _K), rigid_motion((-0.05, 0, 0))
    rig = Rig(camera, camera, right, Projector(tmp_path / "none", _K, np.eye(4)))
    frames = [Frame(k, None, None, 0.1 * k, 0.008, _POSE, "train", repeat_group=0, depth_scale=1e-4) for k in depths]
    scene = tmp_path / "empty.gltf"
    scene.write_text('{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}')
    capture = Capture(tmp_path, "step", scene, rig, tuple(frames))
    write_capture(tmp_path / "capture", capture, {}, np.zeros((2, 2), np.uint8), depths)
    return tmp_path, true


def test_the_scene_has_the_depth_that_was_measured(step, capsys):
    folder, true = step
    assert main(["calibrate", "scene", str(folder / "capture"), "--step", "1", "-o", str(folder / "scene.gltf")]) == 0
    said = capsys.readouterr().out
    assert [words[0] for words in led_on(said)] == ["simulate"]
    assert "3 frames" in said and "warning: this scene is what the camera measured" in said
    scene = kuafu.Scene(kuafu.Device())
    scene.load(folder / "scene.gltf")
    assert np.allclose(scene.camera(0).camera_to_world, _POSE, atol=1e-6)
    images = kuafu.Renderer(scene.device).render(scene, [kuafu.Camera(96, 72, _K, _POSE)], ("depth",), spp=1)
    seen = images["depth"][0, ..., 0]
    inside = np.zeros(true.shape, bool)
    inside[2:-2, 2:-2] = True
    inside[8:22, 8:22] = inside[:, 45:51] = False
    assert (seen[inside] == 0).mean() < 5e-3  # rays run through the mesh's very points: few pass between triangles
    inside &= seen > 0
    assert np.abs(seen - true)[inside].max() < 2e-3 and np.abs(seen - true)[inside].mean() < 4e-4
    assert (seen[12:18, 12:18] == 0).all()  # what was not measured is empty
    joins = np.abs(seen[20:60, 46:50] - 0.7) <= 0.08
    assert (seen[20:60, 48] == 0).any() or not joins.any()  # no surface joins both halves


def test_what_is_wrong_is_told(step, capsys):
    folder, _ = step
    for more, words in (
        (["--frame", "7"], "frames[id=7] is not there or has no depth"),
        (["-o", "scene.stl"], "name of a .gltf"),
    ):
        assert words in refused(["calibrate", "scene", folder / "capture", "-o", folder / "x.gltf", *more], capsys)
    assert not (folder / "x.gltf").exists()
