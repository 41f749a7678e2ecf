# SPDX-License-Identifier: Apache-2.0
"""Recordings in the layouts of TUM, Open3D and BOP, a robot's views and a connected camera's frames are imported."""

import json

import numpy as np
import pytest
from PIL import Image

import kuafu
from activestereo.common.pose import rigid_motion
from activestereo.scene_io import meshes
from activestereo.capture.capture import CaptureError, read_capture
from activestereo.cli import main
from activestereo.capture.images import write_gray
from activestereo.scene_io.parts import read_parts
from camera_dumps import ENUMERATED, write_pairs
from command_line import refused

_HEIGHT, _WIDTH = 24, 32
_K = (30.0, 31.0, 15.5, 11.5)


def write_frames(colors, depths, names=("000000", "000001")):
    rng = np.random.default_rng(0)
    for folder in (colors, depths):
        folder.mkdir(parents=True)
    for name in names:
        Image.fromarray(rng.integers(0, 255, (_HEIGHT, _WIDTH, 3), np.uint8)).save(colors / f"{name}.png")
        write_gray(depths / f"{name}.png", rng.integers(400, 900, (_HEIGHT, _WIDTH)).astype(np.uint16))


@pytest.fixture
def tum(tmp_path):
    folder = tmp_path / "tum"
    write_frames(folder / "rgb", folder / "depth")
    for kind, delay in (("rgb", 0.0), ("depth", 0.004)):
        lines = [f"{1.0 + 0.1 * k + delay:.4f} {kind}/{k:06d}.png" for k in range(2)]
        (folder / f"{kind}.txt").write_text("# timestamp filename\n" + "\n".join(lines) + "\n")
    (folder / "groundtruth.txt").write_text("1.0 0 0 0 0 0 0 1\n1.2 0.2 0 0 0 0 0 1\n")
    return folder


@pytest.fixture
def bop(tmp_path):
    folder = tmp_path / "set" / "test" / "000001"
    write_frames(folder / "rgb", folder / "depth")
    camera = {"cam_K": [_K[0], 0, _K[2], 0, _K[1], _K[3], 0, 0, 1], "depth_scale": 0.1}
    (folder / "scene_camera.json").write_text(json.dumps({"0": camera, "1": camera}))
    poses = [{"cam_R_m2c": np.eye(3).ravel().tolist(), "cam_t_m2c": [0, 0, z], "obj_id": 3} for z in (500.0, 450.0)]
    (folder / "scene_gt.json").write_text(json.dumps({str(k): [pose] for k, pose in enumerate(poses)}))
    models = tmp_path / "set" / "models"
    models.mkdir()
    write_ply(models / "obj_000003.ply", meshes.box(80.0, 60.0, 40.0))
    return folder


@pytest.mark.parametrize("option", ["--poses", "--swap", "--depth", "--exposure", "--baseline", "--k"])
def test_options_that_colour_and_depth_alone_do_not_take_are_refused(bop, option, capsys):
    values = {"--swap": [], "--exposure": ["0.01"], "--baseline": ["0.07"], "--k": ["1,1,1,1"]}.get(option, ["x"])
    line = refused(["import", bop, "--out", bop / "out", option, *values], capsys)
    assert f"{option} is for " in line and "leave it out" in line


def test_a_centre_outside_of_the_images_is_refused(tum, capsys):
    line = refused(["import", tum, "--out", tum / "out", "--k", "30,31,155,11"], capsys)
    assert "centre at 155, 11, outside of the depth images' 32x24: were they rescaled?" in line


def write_ply(path, mesh):
    vertex = np.array([tuple(p) for p in mesh.positions], dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    face = np.array([(3, tuple(t)) for t in mesh.indices.reshape(-1, 3)], dtype=[("count", "u1"), ("index", "<i4", 3)])
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertex)}\n{_XYZ}"
        f"element face {len(face)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + vertex.tobytes() + face.tobytes())


def test_a_tum_folder(tum, capsys):
    out = tum.parent / "capture"
    assert "give --k" in refused(["import", str(tum), "--out", str(out)], capsys)
    assert main(["import", str(tum), "--k", ",".join(map(str, _K)), "--out", str(out)]) == 0
    capture = read_capture(out)
    assert [frame.has_infrared for frame in capture.frames] == [False, False]
    assert capture.frames[1].camera_to_world[0, 3] == pytest.approx(0.104, abs=1e-6)
    stored = np.asarray(Image.open(tum / "depth" / "000001.png"))
    assert np.allclose(capture.depth(capture.frames[1]), stored / 5000.0)
    assert np.array_equal(capture.color(capture.frames[0]), np.asarray(Image.open(tum / "rgb" / "000000.png")))
    with pytest.raises(CaptureError, match="no infrared images"):
        capture.ir(capture.frames[0], "left")


def test_a_tum_list_names_files_of_its_folder_unless_the_user_says_otherwise(tum, capsys):
    (tum / "rgb" / "000000.png").rename(tum.parent / "outside.png")
    (tum / "rgb.txt").write_text("1.0 ../outside.png\n1.1 rgb/000001.png\n")
    out = tum.parent / "capture"
    command = ["import", str(tum), "--k", ",".join(map(str, _K)), "--out", str(out)]
    told = refused(command, capsys)
    assert "rgb.txt: line 1" in told and "lies outside of" in told and "--allow-outside" in told
    assert main(["--allow-outside", *command]) == 0


def test_what_needs_infrared_says_so(tum, capsys):
    out = tum.parent / "capture"
    assert main(["import", str(tum), "--k", ",".join(map(str, _K)), "--out", str(out)]) == 0
    capsys.readouterr()
    for command in (["calibrate", "noise", str(out), "-o"], ["compare", str(out), "--out"]):
        told = refused([*command, str(tum / "model.json")], capsys)
        assert "infrared" in told or "repeat" in told
    assert not (tum / "model.json").exists()


def test_an_open3d_folder_with_its_trajectory(tmp_path, capsys):
    folder = tmp_path / "open3d"
    write_frames(folder / "color", folder / "depth")
    fx, fy, cx, cy = _K
    intrinsic = {"width": _WIDTH, "height": _HEIGHT, "intrinsic_matrix": [fx, 0, 0, 0, fy, 0, cx, cy, 1]}
    (folder / "camera_intrinsic.json").write_text(json.dumps(intrinsic))
    poses = (f"{k} {k} {k + 1}\n1 0 0 {0.1 * k}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" for k in range(2))
    (folder / "trajectory.log").write_text("".join(poses))
    assert main(["import", str(folder), "--out", str(tmp_path / "capture")]) == 0
    capture = read_capture(tmp_path / "capture")
    assert capture.rig.left.K[0, 2] == cx and capture.frames[1].camera_to_world[0, 3] == pytest.approx(0.1)
    assert capture.frames[0].depth_scale == 0.001
    (folder / "camera_intrinsic.json").write_text(json.dumps({"intrinsic_matrix": [1, 2]}))
    line = refused(["import", str(folder), "--out", str(tmp_path / "other")], capsys)
    assert "camera_intrinsic.json: intrinsic_matrix: is [1, 2], expected nine numbers" in line


def test_a_bop_scene_brings_its_objects(bop, tmp_path):
    assert main(["import", str(bop), "--out", str(tmp_path / "capture")]) == 0
    capture = read_capture(tmp_path / "capture")
    assert capture.frames[0].depth_scale == pytest.approx(0.0001)
    assert capture.frames[1].camera_to_world[2, 3] == pytest.approx(0.05)  # 50 mm nearer to the object
    scene = kuafu.Scene(kuafu.Device())
    scene.load(capture.scene_path)
    assert np.allclose(scene.summary.bounds_min_m, (-0.04, 0.0, 0.48), atol=1e-6)
    assert np.allclose(scene.summary.bounds_max_m, (0.04, 0.06, 0.52), atol=1e-6)


_XYZ = "property float x\nproperty float y\nproperty float z\n"
_FACES = "3 0 1 2\n3 0 2 3\n3 0 3 1\n3 1 3 2\n"
_PLACES = ["0 0 0", "80 0 0", "0 60 0", "0 0 40"]


def _model(header, rows):
    """A tetrahedron in millimetres as text."""
    return (
        f"ply\nformat ascii 1.0\n{header[0]}element vertex 4\n{_XYZ}{header[1]}"
        "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
        + "".join(f"{place} {row}\n" for place, row in zip(_PLACES, rows, strict=True))
        + _FACES
    )


_UV = "property float texture_u\nproperty float texture_v\n"
_RGB = "property uchar red\nproperty uchar green\nproperty uchar blue\n"


@pytest.mark.parametrize(
    ("model", "linear_red"),
    [
        (_model(("comment TextureFile black.png\n", _UV), ["0 0", "1 0", "0 1", "1 1"]), 0.006),
        (_model(("", _RGB), ["20 200 200"] * 4), 0.007),
        (_model(("", ""), [""] * 4), 0.5),
    ],
    ids=["texture", "colours of vertices", "none"],
)
def test_a_bop_model_reflects_as_its_colours(bop, tmp_path, model, linear_red):
    """sRGB 20 is 0.007 and 18 is 0.006 (IEC 61966-2-1): the infrared albedo is the red one, beside a coat's share."""
    models = bop.parent.parent / "models"
    Image.new("RGB", (4, 4), (18, 200, 200)).save(models / "black.png")
    (models / "obj_000003.ply").write_text(model)
    assert main(["import", str(bop), "--out", str(tmp_path / "capture")]) == 0
    scene = kuafu.Scene(kuafu.Device("cpu"))
    scene.load(read_capture(tmp_path / "capture").scene_path)
    np.testing.assert_allclose(scene.summary.bounds_max_m, (0.08, 0.06, 0.54), atol=1e-6)
    material = scene.get_material(0)
    material.specular = 0.0
    scene.set_material(0, material)
    scene.set_environment((1.0, 1.0, 1.0), 1.0)
    camera = kuafu.Camera(8, 8, [[900, 0, -20], [0, 900, -20], [0, 0, 1]])
    renderer = kuafu.Renderer(scene.device)
    image = renderer.render(scene, camera, ["radiance"], band="infrared", spp=64, max_bounces=1)["radiance"]
    assert float(np.mean(np.asarray(image)[..., 0])) == pytest.approx(linear_red, rel=0.15)


def test_a_bop_scene_whose_rotations_have_few_digits_becomes_a_capture(bop, tmp_path, capsys):
    truth = json.loads((bop / "scene_gt.json").read_text())
    truth["1"][0]["cam_R_m2c"] = [0.8, -0.6004, 0, 0.6, 0.8, 0, 0, 0, 1]
    (bop / "scene_gt.json").write_text(json.dumps(truth))
    assert main(["import", str(bop), "--out", str(tmp_path / "capture")]) == 0
    turn = read_capture(tmp_path / "capture").frames[1].camera_to_world[:3, :3]
    np.testing.assert_allclose(turn, [[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]], atol=4e-4)
    truth["1"][0]["cam_R_m2c"] = [-1, 0, 0, 0, 1, 0, 0, 0, 1]
    (bop / "scene_gt.json").write_text(json.dumps(truth))
    line = refused(["import", str(bop), "--out", str(tmp_path / "other")], capsys)
    assert "1.cam_R_m2c, cam_t_m2c: is not a rigid motion: its 3x3 part mirrors" in line


def test_what_is_wrong_with_a_bop_scene_is_told(bop, tmp_path, capsys):
    camera = json.loads((bop / "scene_camera.json").read_text())["0"]

    def said(second):
        (bop / "scene_camera.json").write_text(json.dumps({"0": camera, "1": second}))
        return refused(["import", str(bop), "--out", str(tmp_path / "a")], capsys)

    assert "scene_camera.json: 1.cam_K: is None, expected nine numbers" in said({"depth_scale": 0.1})
    assert "1.depth_scale: is missing" in said(camera | {"depth_scale": None})
    write_gray(bop / "depth" / "000001.png", np.ones((10, 10), np.uint16))
    assert "is 10x10, expected 32x24" in said(camera)
    assert not [p for p in tmp_path.iterdir() if p.name.lstrip(".").startswith(("a", "import"))]


def test_meshes_of_cad_programs(tmp_path):
    box = meshes.box(0.08, 0.06, 0.04)
    triangles = box.indices.reshape(-1, 3)
    write_ply(tmp_path / "box.ply", box)
    record = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.zeros(len(triangles), record)
    facets["points"] = 1000.0 * box.positions[triangles]
    (tmp_path / "box.stl").write_bytes(b"\0" * 80 + len(facets).to_bytes(4, "little") + facets.tobytes())
    lines = [f"v {x} {y} {z}" for x, y, z in box.positions]
    lines += [f"f {a + 1}//1 {b + 1}//1 {c + 1}//1" for a, b, c in triangles]
    (tmp_path / "box.obj").write_text("\n".join(lines))
    for name, unit in (("box.ply", 1.0), ("box.stl", 0.001), ("box.obj", 1.0)):
        (part,) = read_parts(tmp_path / name)
        mesh = part.mesh
        assert np.allclose(unit * np.ptp(mesh.positions, axis=0), (0.08, 0.06, 0.04), atol=1e-6)
        assert np.allclose(np.abs(mesh.normals).max(axis=1), 1.0, atol=1e-6)  # a box has no round edges
    (tmp_path / "cut.stl").write_bytes(b"\0" * 80 + b"\x05\0\0\0" + b"\0" * 60)
    with pytest.raises(ValueError, match=r"cut\.stl: the file is cut off"):
        read_parts(tmp_path / "cut.stl")


def test_a_round_camera_has_round_normals(tmp_path):
    wheel = meshes.lathe([[(0.03, 0.0), (0.03, 0.1)]])
    write_ply(tmp_path / "side.ply", wheel)
    mesh = read_parts(tmp_path / "side.ply")[0].mesh
    radial = mesh.positions[:, [0, 2]] / np.linalg.norm(mesh.positions[:, [0, 2]], axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", mesh.normals[:, [0, 2]], radial).min() > 0.999


def test_a_robots_views_stand_where_the_gripper_carries_the_camera(tmp_path, capsys):
    views = tmp_path / "views"
    write_pairs(views, range(0, 40, 10))
    (tmp_path / "d435.txt").write_text(ENUMERATED)
    rows = [f"{i:06d}.png,{0.1 * (i // 2)},0,0,0,0,0,1" for i in range(4)]
    (tmp_path / "poses.csv").write_text("name,x,y,z,qx,qy,qz,qw\n" + "\n".join(rows) + "\n")
    hand = rigid_motion((0, 0, 0.05))
    (tmp_path / "hand.json").write_text(json.dumps({"camera_to_gripper": hand.ravel().tolist()}))
    files = ["--calibration", str(tmp_path / "d435.txt"), "--robot", str(tmp_path / "poses.csv")]
    arguments = ["import", str(views), *files, "--out", str(tmp_path / "c")]
    assert "--robot needs --hand-eye" in refused(arguments, capsys)
    assert "--poses is in place of --robot" in refused([*arguments, "--poses", tmp_path / "robot.csv"], capsys)
    lone = ["--hand-eye" if word == "--robot" else word for word in arguments]
    assert "--hand-eye is for --robot" in refused(lone, capsys)
    assert main([*arguments, "--hand-eye", str(tmp_path / "hand.json")]) == 0
    capture = read_capture(tmp_path / "c")
    assert [frame.repeat_group for frame in capture.frames] == [0, 0, 1, 1]
    assert np.allclose(capture.frames[2].camera_to_world[:3, 3], (0.1, 0, 0.05))
    assert np.allclose(capture.frames[2].gripper_to_base[:3, 3], (0.1, 0, 0))


def test_folders_inside_are_views_of_their_own(tmp_path):
    (tmp_path / "d435.txt").write_text(ENUMERATED)
    for number, view in enumerate(("desk_off", "near", "wall/far")):
        write_pairs(tmp_path / "r" / view, (10 * number, 10 * number + 1), right=100)
    places = ["--calibration", str(tmp_path / "d435.txt"), "--out", str(tmp_path / "c")]
    assert main(["import", str(tmp_path / "r"), *places]) == 0
    capture = read_capture(tmp_path / "c")
    assert [frame.repeat_group for frame in capture.frames] == [0, 0, 1, 1, 2, 2]
    assert [frame.projector_power for frame in capture.frames] == [0, 0, 1, 1, 1, 1]
    assert [int(capture.ir(frame, "right")[0, 0]) for frame in capture.frames] == [100, 101, 110, 111, 120, 121]
