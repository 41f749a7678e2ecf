# SPDX-License-Identifier: Apache-2.0
"""Parts in a rendered room are placed by their edges, by the command and from its 2 cm and 5 degrees; what is wrong is
one line each."""

import json

import cv2
import numpy as np
import pytest

import kuafu
from activestereo.scene_io import meshes
from activestereo.capture.capture import Camera, Capture, ColorCamera, Frame, Projector, Rig, read_capture
from activestereo.capture.write import write_capture
from activestereo.cli import main
from activestereo.calibrate.gltf_place import node_pose
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.report.overlay import Overlay
from activestereo.common.pose import look_at
from command_line import refused

_WIDTH, _HEIGHT, _F = 240, 160, 170.0
_K = np.array([[_F, 0, 119.5], [0, _F, 79.5], [0, 0, 1.0]])
_VIEWS = 5


def turned(vector):
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.array(vector, float))[0]
    return pose


TRUTH = turned((0.0, 0.7, 0.0))
TRUTH[:3, 3] = (0.02, 0.0, 0.01)


def camera_poses():
    angles = np.deg2rad(np.linspace(-70.0, 70.0, _VIEWS))
    return [
        look_at(eye=(0.4 * np.sin(a), 0.28, 0.4 * np.cos(a)), target=(0.02, 0.03, 0.01), up=(0, 1, 0)) for a in angles
    ]


def room(path, part):
    writer = GltfWriter()
    gray = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    table = writer.add_material("table", pbrMetallicRoughness={"baseColorFactor": [0.35, 0.4, 0.45, 1.0], **gray})
    card = writer.add_material("card", pbrMetallicRoughness={"baseColorFactor": [0.8, 0.55, 0.3, 1.0], **gray})
    writer.add_mesh("table", meshes.box(1.6, 0.02, 1.6), table, (0.0, -0.02, 0.0))
    if part is not None:
        writer.add_placed_mesh("part", part, card, TRUTH)
    writer.add_point_light("lamp", (-0.6, 1.1, 0.5), (1.0, 0.95, 0.9), 2.0)
    writer.write(path)


def write_obj(path, mesh):
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.positions]
    path.write_text("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.indices.reshape(-1, 3)]))


def record(folder, mesh, color=True, projector_power=0.0):
    """A capture of the room with the part, whose scene does not know the part."""
    folder.mkdir(exist_ok=True)
    room(folder / "true.gltf", mesh)
    room(folder / "known.gltf", None)
    scene, poses = kuafu.Scene(kuafu.Device()), camera_poses()
    scene.load(folder / "true.gltf")
    scene.set_environment((0.4, 0.4, 0.4), ir_radiance=0.4)
    cameras = [kuafu.Camera(_WIDTH, _HEIGHT, _K, pose) for pose in poses]
    how = {"spp": 8, "max_bounces": 1}
    seen = {
        band: kuafu.Renderer(scene.device).render(scene, cameras, band=band, **how)["radiance"]
        for band in ("visible", "infrared")
    }
    right = np.eye(4)
    right[0, 3] = -0.05
    nominal = Camera(_WIDTH, _HEIGHT, _K)
    rig = Rig(
        nominal,
        nominal,
        right,
        Projector(folder / "none", _K, np.eye(4)),
        color=ColorCamera(_WIDTH, _HEIGHT, _K) if color else None,
    )
    frames, images, colors = [], {}, {}
    for k, pose in enumerate(poses):
        frames.append(Frame(k, None, None, float(k), 0.008, pose, "train", projector_power=projector_power))
        gray = np.clip(300 * seen["infrared"][k, ..., 0], 0, 255).astype(np.uint8)
        images[k, "left"] = images[k, "right"] = gray
        colors[k] = np.rint(255 * np.clip(1.2 * seen["visible"][k], 0, 1) ** (1 / 2.2)).astype(np.uint8)
    capture = Capture(folder, "views", folder / "known.gltf", rig, tuple(frames))
    write_capture(folder / "capture", capture, images, np.zeros((2, 2), np.uint8), colors=colors if color else None)
    return folder / "capture"


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pose")
    mesh = meshes.box(0.12, 0.09, 0.07)
    record(folder, mesh)
    write_obj(folder / "part.obj", mesh)
    return folder


def start_text(seed):
    rng = np.random.default_rng(seed)
    turn, shift = rng.normal(size=3), rng.normal(size=3)
    pose = turned(np.deg2rad(5.0) * turn / np.linalg.norm(turn))
    rotation = pose[:3, :3] @ TRUTH[:3, :3]
    place = TRUTH[:3, 3] + 0.02 * shift / np.linalg.norm(shift)
    from scipy.spatial.transform import Rotation

    numbers = [*place, *Rotation.from_matrix(rotation).as_quat()]
    return "part=" + ",".join(f"{x:.9g}" for x in numbers)


def test_a_box_is_placed_from_2_cm_and_5_degrees(box, capsys):
    out = box / "placed.gltf"
    arguments = ["calibrate", "pose", str(box / "capture"), "--object", f"part={box / 'part.obj'}", "-o", str(out)]
    for seed in (1, 2):
        assert main([*arguments, "--start", start_text(seed)]) == 0
        found = json.loads(out.with_suffix(".poses.json").read_text())["part"]
        pose = np.reshape(found["part_to_world"], (4, 4))
        centre = np.array([0.0, 0.045, 0.0, 1.0])
        assert np.linalg.norm((pose @ centre - TRUTH @ centre)[:3]) < 2e-3
        turn = cv2.Rodrigues(pose[:3, :3].T @ TRUTH[:3, :3])[0]
        assert np.rad2deg(np.linalg.norm(turn)) < 1.5
        assert found["free_axes"] == [] and found["views"] > _VIEWS
    assert np.allclose(node_pose(out, "part"), pose, atol=1e-6)
    scene = kuafu.Scene(kuafu.Device())
    scene.load(out)
    assert scene.summary.instance_count == 2
    assert np.allclose(scene.camera(0).camera_to_world, camera_poses()[0], atol=1e-6)
    assert "free to turn" not in capsys.readouterr().out


def test_the_scene_lies_over_the_pictures(box):
    from PIL import Image

    assert main(["overlay", str(box / "capture"), "--scene", str(box / "true.gltf"), "--out", str(box / "over")]) == 0
    files = sorted((box / "over").glob("*.png"))
    assert len(files) == 3 * _VIEWS  # colour and both cameras of each pose
    capture = read_capture(box / "capture")
    over, seen = (
        np.asarray(Image.open(box / "over" / "0_color.png")).astype(int),
        capture.color(capture.frames[0]).astype(int),
    )
    changed = np.abs(over - seen).max(axis=2) > 30
    assert 0.01 < changed.mean() < 0.12
    # The lines lie where the picture has its edges.
    from scipy.ndimage import gaussian_gradient_magnitude

    slope = gaussian_gradient_magnitude(seen.mean(axis=2), 1.0)
    assert slope[changed].mean() > 4.0 * slope[~changed].mean()
    place = capture.rig.color.K, capture.frames[0].camera_to_world
    half, whole = (Overlay(box / "true.gltf", share=share).blend(seen.astype(np.uint8), *place) for share in (0.5, 1.0))
    mixed = (np.abs(half - 0.5 * (seen + whole)) <= 1.0).all(axis=2) & (np.abs(whole - seen).max(axis=2) > 8)
    assert mixed.mean() > 0.3  # most of what surfaces cover; the rest are lines, and what looks alike


def test_a_cup_turns_freely_about_its_axis(tmp_path):
    mesh = meshes.lathe([[(0.0, 0.0), (0.035, 0.0)], [(0.035, 0.0), (0.035, 0.12)], [(0.035, 0.12), (0.0, 0.12)]])
    record(tmp_path, mesh)
    write_obj(tmp_path / "part.obj", mesh)
    out = tmp_path / "placed.gltf"
    assert (
        main(
            [
                "calibrate",
                "pose",
                str(tmp_path / "capture"),
                "--object",
                f"part={tmp_path / 'part.obj'}",
                "--start",
                start_text(1),
                "-o",
                str(out),
            ]
        )
        == 0
    )
    found = json.loads(out.with_suffix(".poses.json").read_text())["part"]
    (axis,) = found["free_axes"]
    assert abs(axis[1]) > 0.99
    pose = np.reshape(found["part_to_world"], (4, 4))
    centre = np.array([0.0, 0.06, 0.0, 1.0])
    assert np.linalg.norm((pose @ centre - TRUTH @ centre)[:3]) < 2e-3
    assert np.rad2deg(np.arccos(np.clip(pose[:3, 1] @ TRUTH[:3, 1], -1, 1))) < 1.5


def test_what_is_wrong_is_told(box, tmp_path, capsys):
    out = tmp_path / "placed.gltf"
    arguments = ["calibrate", "pose", str(box / "capture"), "--object", f"part={box / 'part.obj'}", "-o", str(out)]
    assert "has no node 'part': give --start part=" in refused(arguments, capsys)
    assert "out of view in all" in refused([*arguments, "--start", "part=0,0,9,0,0,0,1"], capsys)
    assert "the quaternion's length is 2.000" in refused([*arguments, "--start", "part=0,0,0,0,0,0,2"], capsys)
    assert "there is no --object of that name" in refused([*arguments, "--start", "cup=0,0,0,0,0,0,1"], capsys)
    assert "'part' is not --object NAME=CAD" in refused([*arguments, "--object", "part"], capsys)
    with_dots = record(tmp_path / "dots", meshes.box(0.12, 0.09, 0.07), color=False, projector_power=1.0)
    arguments[2] = str(with_dots)
    assert "with the projector off" in refused([*arguments, "--start", start_text(0)], capsys)
    (with_dots / "left" / "000000.png").write_bytes(b"\x89PNG cut")
    assert "000000.png" in refused([*arguments, "--start", start_text(0)], capsys)
    assert not out.exists()
