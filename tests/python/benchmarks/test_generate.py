# SPDX-License-Identifier: Apache-2.0
"""Data sets: geometry of poses and masks, BOP's rules and other formats, the same bits by any way of making them."""

import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import kuafu
from activestereo.benchmarks.generate import bop, formats
from activestereo.benchmarks.generate.bop import stored_frames
from activestereo.benchmarks.generate.run import generate
from activestereo.benchmarks.generate.studio import Frame, Ranges, Settings, Studio, Things
from activestereo.benchmarks.generate.studio import drop, scatter, sensor_config
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.cli import generate as command, main
from activestereo.common.pose import rigid_motion
from activestereo.scene_io import meshes, usd
from activestereo.scene_io.gltf_writer import GltfWriter
from command_line import refused

RADIUS_M = 0.05
SIZE = (96, 72)


def write_thing(path: Path, mesh: meshes.Mesh, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Path:
    writer = GltfWriter(path.stem)
    surface = {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0}
    material = writer.add_material("paint", pbrMetallicRoughness=surface)
    writer.add_mesh(path.stem, mesh, material, at)
    writer.write(path)
    return path


@pytest.fixture(scope="module")
def things(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    folder = tmp_path_factory.mktemp("things")
    ball = write_thing(folder / "ball.glb", meshes.sphere(RADIUS_M))
    return ball, write_thing(folder / "box.glb", meshes.box(0.08, 0.12, 0.06), (0.3, 0.1, 0.0))


def settings(things: tuple[Path, ...], **more: object) -> Settings:
    return Settings(things, sensor="sapien-D435", rgb_size=SIZE, samples=1, ranges=Ranges(things=(2, 2)), **more)


def read_all(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def options(out: Path, count: int, workers: int = 1) -> list[str]:
    size = f"{SIZE[0]}x{SIZE[1]}"
    render = ["--sensor", "sapien-D435", "--rgb-size", size, "--samples-per-pixel", "1"]
    return ["--out", str(out), "--count", str(count), "--workers", str(workers), *render]


@pytest.fixture(scope="module")
def whole(things: tuple[Path, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three frames by one worker; tests that change them copy them first."""
    out = tmp_path_factory.mktemp("whole") / "set"
    assert main(["generate", *(str(path) for path in things), *options(out, 3)]) == 0
    return out


def test_poses_masks_and_true_depth_agree(things: tuple[Path, ...]) -> None:
    frame = Studio(settings(things)).make_frame(3)
    assert [found.thing_id for found in frame.found] == [1, 2]
    for found in frame.found:
        assert found.mask.any() and (found.mask | ~found.mask_visible).all()
    ball = frame.found[0]
    centre = ball.model_to_camera[:3, 3]
    u, v = np.rint((frame.k @ centre)[:2] / centre[2]).astype(int)
    assert ball.mask[v, u]
    rays = np.linalg.inv(frame.k) @ np.array([u, v, 1.0])
    # Where the ray meets the sphere, and its z.
    along = rays / np.linalg.norm(rays)
    half = along @ centre
    z = (half - np.sqrt(half**2 - centre @ centre + RADIUS_M**2)) * along[2]
    assert ball.mask_visible[v, u] and frame.true_depth[v, u] == pytest.approx(z, abs=5e-4)
    # The circle that a sphere of this size makes.
    radius_px = frame.k[0, 0] * RADIUS_M / np.sqrt(centre @ centre - RADIUS_M**2)
    assert ball.mask.sum() == pytest.approx(np.pi * radius_px**2, rel=0.12)


def test_frames_are_the_same_by_any_way_of_making_them(things: tuple[Path, ...], whole: Path, tmp_path: Path) -> None:
    names = [str(path) for path in things]
    assert main(["generate", *names, *options(tmp_path / "two", 3, workers=2)]) == 0
    assert read_all(tmp_path / "two") == read_all(whole)
    shutil.copytree(whole, tmp_path / "one")
    (tmp_path / "one/train_pbr/000000/.frames/000001.json").unlink()
    (tmp_path / "one/train_pbr/000000/rgb/000001.png").write_bytes(b"half a pict")
    killed = tmp_path / "one/train_pbr/000000/.unfinished-1-k1ll3d"
    killed.mkdir()
    (killed / "000001.png").write_bytes(b"half a pict")
    assert main(["generate", *names, *options(tmp_path / "one", 3)]) == 0
    assert read_all(tmp_path / "one") == read_all(whole)


def test_parts_are_the_whole(
    things: tuple[Path, ...], whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names, out = [str(path) for path in things], tmp_path / "parts"
    assert main(["generate", *names, *options(out, 3), "--part", "2/2"]) == 0
    assert "2 of other parts are not there yet" in capsys.readouterr().out
    assert not (out / "train_pbr/000000/scene_gt.json").exists()
    other = out / "train_pbr/000000/.unfinished-0-other"  # of a machine that is at it
    other.mkdir()
    (other / "000000.png").write_bytes(b"half a pict")
    assert main(["generate", *names, *options(out, 3), "--part", "2/2"]) == 0
    assert other.exists()
    assert main(["generate", *names, *options(out, 3), "--part", "1/2"]) == 0
    assert read_all(out) == read_all(whole)
    with pytest.raises(SystemExit):
        main(["generate", *names, *options(out, 3), "--part", "3/2"])


def test_a_usd_stage_is_written_as_gltf_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = tmp_path / "ball.usda"
    stage.write_text("#usda 1.0")
    monkeypatch.setattr(usd, "convert", lambda path, glb: write_thing(glb, meshes.sphere(RADIUS_M)))
    assert main(["generate", str(stage), *options(tmp_path / "set", 1)]) == 0
    assert (tmp_path / "set/things/ball.glb").exists()
    assert (tmp_path / "set/train_pbr/000000/rgb/000000.png").exists()


def test_a_killed_run_goes_on(things: tuple[Path, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names, out = [str(path) for path in things], tmp_path / "killed"
    command = [sys.executable, "-m", "activestereo", "generate", *names, *options(out, 4)]
    run = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
    for _ in range(12000):  # ten minutes, on a machine with other work
        if bop.is_done(out, 0) or run.poll() is not None:
            break
        time.sleep(0.05)
    if run.poll() is None:
        os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    kept = read_all(out / "train_pbr/000000/rgb")["000000.png"]
    assert main(["generate", *names, *options(out, 4)]) == 0
    said = capsys.readouterr().out
    made, there = int(said.split(" frames in")[0]), int(said.split(" were there")[0].rsplit(" ", 1)[1])
    assert made + there == 4 and there >= 1
    assert read_all(out / "train_pbr/000000/rgb")["000000.png"] == kept
    assert len(json.loads((out / "train_pbr/000000/scene_gt.json").read_text())) == 4


def test_a_killed_worker_is_replaced(things: tuple[Path, ...], tmp_path: Path) -> None:
    """Whoever makes the second frame finds a worker killed; all frames come, each once."""
    seen = []

    def kill(share: float) -> None:
        seen.append(share)
        if len(seen) == 1:
            os.kill(multiprocessing.active_children()[0].pid, signal.SIGKILL)

    done = generate(settings(things), tmp_path / "lost", 5, workers=2, progress=kill)
    assert len(seen) == done.made == 5 and not done.missing
    assert sorted(seen) == seen and seen[-1] == 1.0


def test_infrared_cameras_are_written_beside_bop_s_files(things: tuple[Path, ...], tmp_path: Path) -> None:
    own = settings(things, ir_size=(160, 90))
    generate(own, tmp_path, 1, workers=1)
    scene, ir = tmp_path / "train_pbr/000000", json.loads((tmp_path / "ir_cameras.json").read_text())
    whole = StereoDepthSensorConfig("sapien-D435")
    for side in ("ir_left", "ir_right"):
        assert (ir[side]["width"], ir[side]["height"]) == Image.open(scene / side / "000000.png").size == (160, 90)
        field = whole.ir_resolution[0] / whole.ir_intrinsic[0, 0]
        assert 160 / ir[side]["cam_K"][0] == pytest.approx(field)
    right = np.reshape(ir["ir_right"]["camera_to_rgb"], (4, 4)) - np.reshape(ir["ir_left"]["camera_to_rgb"], (4, 4))
    assert np.linalg.norm(right[:3, 3]) == pytest.approx(ir["baseline_m"]) and 0.04 < ir["baseline_m"] < 0.06
    reason, confidence = (np.asarray(Image.open(scene / n / "000000.png")) for n in ("reason", "confidence"))
    assert reason.shape == confidence.shape == (90, 160) and reason.max() < len(ir["reasons"])
    valid = reason == ir["reasons"].index("valid")
    assert 0.1 < valid.mean() < 1.0 and confidence[valid].mean() > confidence[~valid].mean()
    assert Image.open(scene / "rgb/000000.png").size == SIZE
    assert sensor_config(own).rgb_intrinsic == pytest.approx(sensor_config(settings(things)).rgb_intrinsic)


def test_the_end_says_how_much_is_measured_and_how_much_invented(things: tuple[Path, ...], tmp_path: Path) -> None:
    done = generate(settings(things), tmp_path, 2, workers=1)
    scene = tmp_path / "train_pbr/000000"
    found, true = (
        np.stack([np.asarray(Image.open(scene / kind / f"{n:06d}.png"), float) for n in range(2)])
        for kind in ("depth", "depth_true")
    )
    is_wrong = (true == 0) | (abs(found - true) > 0.05 * true)
    assert done.measured == pytest.approx((found > 0)[true > 0].mean(), abs=1e-3) and 0.1 < done.measured < 1.0
    assert done.invented == pytest.approx(is_wrong[found > 0].mean(), abs=5e-3)


def test_a_thing_that_the_border_cuts_is_counted_beyond_it(things: tuple[Path, ...], tmp_path: Path) -> None:
    """By the ellipse that a ball makes; BOP's visib_fract is of all its pixels."""
    near = Ranges(things=(2, 2), distance_m=(0.25, 0.25), spread_m=(0.25, 0.25))
    studio = Studio(replace(settings(things), ranges=near))
    cut = 0
    for frame in (studio.make_frame(number) for number in range(6)):
        bop.write_frame(tmp_path, frame)
        info = json.loads(bop.record_path(tmp_path, frame.number).read_text())["gt_info"][0]
        ball = frame.found[0]
        x, y, z = ball.model_to_camera[:3, 3]
        sine2, cosine2 = RADIUS_M**2 / (x * x + y * y + z * z), z * z / (x * x + y * y + z * z)
        area = np.pi * frame.k[0, 0] ** 2 * sine2 * np.sqrt(1.0 - sine2) / (cosine2 - sine2) ** 1.5
        assert info["px_count_all"] == pytest.approx(area, rel=0.06)
        assert info["visib_fract"] == ball.mask_visible.sum() / info["px_count_all"]
        left, top, width, height = info["bbox_obj"]
        is_cut = left < 0 or top < 0 or left + width > SIZE[0] or top + height > SIZE[1]
        cut += is_cut and ball.mask.any()
        assert is_cut == (ball.mask.sum() < info["px_count_all"])
    assert 0 < cut


def test_the_files_keep_bop_s_rules(whole: Path) -> None:
    scene = whole / "train_pbr/000000"
    camera, gt, info = (json.loads((scene / f"scene_{n}.json").read_text())["0"] for n in ("camera", "gt", "gt_info"))
    assert len(camera["cam_K"]) == len(camera["cam_R_w2c"]) == 9 and camera["depth_scale"] == 1.0
    assert len(gt) == len(info) > 0
    depth = np.asarray(Image.open(scene / "depth/000000.png"))
    assert depth.dtype == np.int32 or depth.dtype == np.uint16
    for order, (pose, about) in enumerate(zip(gt, info, strict=True)):
        rotation = np.reshape(pose["cam_R_m2c"], (3, 3))
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert 300.0 < pose["cam_t_m2c"][2] < 1500.0
        mask, visible = (
            np.asarray(Image.open(scene / f"{n}/000000_{order:06d}.png")) > 0 for n in ("mask", "mask_visib")
        )
        assert about["px_count_all"] == mask.sum() and about["px_count_visib"] == visible.sum()
        assert about["visib_fract"] == pytest.approx(visible.sum() / mask.sum())
        x, y, width, height = about["bbox_obj"]
        assert mask[y : y + height, x : x + width].sum() == mask.sum()
    models = json.loads((whole / "models/models_info.json").read_text())
    assert models["1"]["size_x"] == pytest.approx(2000.0 * RADIUS_M, rel=0.01)


def test_nodes_of_a_file_keep_their_places(tmp_path: Path) -> None:
    path = write_thing(tmp_path / "off.glb", meshes.sphere(0.1), (0.4, 0.0, 0.0))
    scene = kuafu.Scene(kuafu.Device())
    made = Things(scene, [path])
    made.place({0: np.eye(4)})
    np.testing.assert_allclose(scene.summary.bounds_min_m[0], 0.3, atol=1e-6)


def test_scattered_things_stand_upright_and_apart(things: tuple[Path, ...]) -> None:
    made = Things(kuafu.Scene(kuafu.Device()), list(things)).things
    for seed in range(20):
        poses = scatter(made, Ranges(things=(2, 2)), np.random.default_rng(seed))
        middles = [pose @ [*(0.5 * (made[n].low_m + made[n].high_m)), 1.0] for n, pose in poses.items()]
        heights = [0.5 * (made[n].high_m - made[n].low_m)[1] for n in poses]
        assert [middle[2] for middle in middles] == pytest.approx(heights)
        if len(middles) == 2:
            assert np.linalg.norm((middles[0] - middles[1])[:2]) > made[0].radius_m + made[1].radius_m


def test_dropped_things_rest_on_the_table(things: tuple[Path, ...]) -> None:
    pytest.importorskip("mujoco", reason="the layout 'drop' needs mujoco (pip install mujoco)")
    pytest.importorskip("trimesh", reason="the layout 'drop' needs trimesh (pip install trimesh)")
    made = Things(kuafu.Scene(kuafu.Device()), list(things)).things
    ranges, lowest, found = Ranges(things=(2, 2)), [], 0
    for seed in range(4):
        poses = drop(made, ranges, np.random.default_rng(seed))
        assert poses.keys() == drop(made, ranges, np.random.default_rng(seed)).keys()
        found += len(poses)
        if 1 in poses:
            corners = np.stack(np.meshgrid(*zip(made[1].low_m, made[1].high_m, strict=True)), axis=-1).reshape(-1, 3)
            lowest.append((corners @ poses[1][:3, :3].T + poses[1][:3, 3])[:, 2].min())
    assert found >= 4 and lowest and np.abs(lowest).max() < 5e-3


def test_what_is_wrong_is_said(things: tuple[Path, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ball = str(things[0])

    def fails(*arguments: str) -> str:
        return refused(["generate", *arguments, "--out", tmp_path / "out"], capsys)

    assert "nowhere.glb: there is no such file" in fails(str(tmp_path / "nowhere.glb"))
    ranges = tmp_path / "ranges.toml"
    ranges.write_text("distance_m = [2.0, 1.0]")
    assert "distance_m goes from 2.0 to 1.0" in fails(ball, "--ranges", str(ranges))
    ranges.write_text("distance = [0.5, 1.0]")
    assert "no range 'distance'" in fails(ball, "--ranges", str(ranges))
    huge = write_thing(tmp_path / "huge.glb", meshes.sphere(50.0))
    assert "100 m large" in fails(str(huge))
    (tmp_path / "out").mkdir(exist_ok=True)
    (tmp_path / "out/dataset.json").write_text(json.dumps({"seed": 4}))
    assert "other settings" in fails(ball)
    (tmp_path / "out/dataset.json").write_text("[]")
    assert "dataset.json: is not a JSON object" in fails(ball)
    with pytest.raises(ValueError, match="spread_m must lie within 0 to 100"):
        Ranges(spread_m=(1e300, 1e308))
    with pytest.raises(ValueError, match="two finite numbers"):
        Ranges(spread_m=(0.1, float("nan")))
    assert Ranges.read(None) == Ranges()


_K = np.array([[50.0, 0.0, 31.5], [0.0, 50.0, 23.5], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def data_set(tmp_path_factory) -> Path:
    """Two frames of noise, the second one's camera 0.5 m above the first's."""
    out, random = tmp_path_factory.mktemp("set"), np.random.default_rng(0)
    for number in range(2):
        rgb, gray = (random.integers(0, 256, (48, 64, *more), np.uint8) for more in ((3,), ()))
        depth = np.rint(random.uniform(0.3, 3.0, (48, 64)) * 1000.0).astype(np.float32) / 1000.0
        world_to_camera = rigid_motion((0, 0.5 * number, 0))
        confidence, reason = np.zeros((48, 64), np.float32), np.zeros((48, 64), np.uint8)
        images = rgb, gray, gray, depth, depth, confidence, reason
        bop.write_frame(out, Frame(number, *images, _K, world_to_camera, ()))
    lens = {"cam_K": _K.ravel().tolist(), "distortion": [0.0] * 5}
    (out / "ir_cameras.json").write_text(json.dumps({"ir_left": lens, "ir_right": lens, "baseline_m": 0.05}))
    return out


def test_lerobot_gets_depth_maps_in_millimetres_and_an_episode_for_each_frame(data_set, tmp_path, monkeypatch):
    calls = []

    class Recorder:
        @classmethod
        def create(cls, name, fps, features, **options):
            calls.append(features)
            return cls()

        def add_frame(self, frame):
            calls.append(frame)

        def save_episode(self):
            calls.append("episode")

        def finalize(self):
            calls.append("end")

    monkeypatch.setattr(formats, "imported", lambda *package: SimpleNamespace(LeRobotDataset=Recorder))
    formats.write_lerobot(data_set, 2, tmp_path / "to")
    features, first, *_ = calls
    assert [call for call in calls if isinstance(call, str)] == ["episode", "episode", "end"]
    depth = features["observation.images.depth"]
    assert depth["info"] == {"is_depth_map": True} and depth["shape"] == (48, 64, 1)
    stored = list(stored_frames(data_set, 2))
    assert first["observation.images.depth"].dtype == np.uint16
    assert (first["observation.images.depth"][..., 0] == stored[0].depth_mm).all()
    assert np.allclose(calls[3]["observation.state"], [0, -0.5, 0, 0, 0, 0, 1])
    assert set(first) - {"task"} == set(features)


def test_lerobots_package_reads_the_same_depth(data_set, tmp_path):
    data = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="the package lerobot is not installed")
    formats.write_lerobot(data_set, 2, tmp_path / "to")
    found = data.LeRobotDataset(f"activestereo/{data_set.name}", root=tmp_path / "to")
    for frame, read in zip(stored_frames(data_set, 2), found, strict=True):
        assert (read["observation.images.depth"].numpy()[0] == frame.depth_mm).all()


def test_mcap_has_a_cameras_topics_with_their_geometry(data_set, tmp_path):
    highlevel = pytest.importorskip("rosbags.highlevel", reason="the package rosbags is not installed")
    formats.write_formats(data_set, 2, ["mcap"])
    with highlevel.AnyReader([data_set / "mcap"]) as reader:
        found = {c.topic: reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()}
    depth = found["/camera/aligned_depth_to_color/image_raw"]
    assert depth.encoding == "16UC1"
    last = list(stored_frames(data_set, 2))[1]
    assert (depth.data.view(np.uint16).reshape(48, 64) == last.depth_mm).all()
    assert found["/camera/infra2/camera_info"].p[3] == pytest.approx(-50.0 * 0.05)
    assert found["/camera/pose"].pose.position.y == pytest.approx(-0.5)


def test_what_is_missing_is_said_before_anything_is_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rosbags", None)
    assert tuple(formats.FORMATS) == command.FORMATS
    options = ["generate", "no.glb", "--count", "1", "--out", str(tmp_path / "set"), "--also", "mcap"]
    assert "pip install rosbags" in refused(options, capsys)
    assert not (tmp_path / "set").exists()
