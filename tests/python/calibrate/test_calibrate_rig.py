# SPDX-License-Identifier: Apache-2.0
"""The rig from boards: noisy corners of a known rig, and rendered pictures of printed boards."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from activestereo.calibrate.rig import Board, BoardView, calibrate
from activestereo.calibrate.hand_eye import hand_eye, read_poses
from activestereo.calibrate.least_squares import difference
from activestereo.capture.images import write_gray
from activestereo.model import read_model
from board_worlds import BOARD, RigWorld, matrix, projected
from command_line import refused, run_here


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_asked_figures_hold_on_twenty_boards(seed):
    """Focal length 0.1 %, centre 0.5 px, hand-eye 1 mm and 0.1 deg; a robot that repeats to 0.2 mm."""
    world = RigWorld.make(seed)
    found = calibrate(world.views, world.size)
    for side in ("left", "right"):
        assert np.diag(found.K[side])[:2] == pytest.approx(np.diag(world.K[side])[:2], rel=1e-3)
        assert np.abs(found.K[side][:2, 2] - world.K[side][:2, 2]).max() < 0.6
        off = (found.K[side] - world.K[side])[(0, 1, 0, 1), (0, 1, 2, 2)]
        assert np.all(np.abs(off) < 4.1 * found.error[side])
    assert difference(found.left_to_right, world.left_to_right)[0] < 2e-4
    hand = hand_eye(world.robot(seed), [found.board_to_left[view.name] for view in world.views])
    metres, degrees = difference(hand.camera_to_gripper, world.camera_to_gripper)
    assert metres < 1e-3 and degrees < 0.1
    assert np.abs(hand.camera_to_gripper - world.camera_to_gripper)[:3, 3].max() < 5.0 * hand.error[3:].max() + 3e-4


def test_with_a_known_k_boards_are_placed_to_a_fifth_of_a_millimetre():
    world = RigWorld.make(5, has_lens=False)
    K = world.K["left"]
    world.K["right"][:] = K
    world = replace(world, views=_again(world))
    found = calibrate(world.views, world.size, has_lens=False, known_K=K)
    apart = np.array([difference(found.board_to_left[view.name], world.boards[view.name]) for view in world.views])
    assert np.median(apart[:, 0]) < 2e-4 and np.median(apart[:, 1]) < 0.1
    assert np.array_equal(found.K["left"], K) and np.array_equal(found.K["right"], K)


def _again(world):
    """The views' corners drawn again by the world's present cameras, 0.08 px of noise."""
    rng, points, views = np.random.default_rng(9), BOARD.chessboard_points(), []
    for view in world.views:
        corners = {}
        for side in ("left", "right"):
            pose = world.boards[view.name] if side == "left" else world.left_to_right @ world.boards[view.name]
            pixels = projected(points, pose, world.K[side])
            corners[side] = points, pixels + 0.08 * rng.standard_normal(pixels.shape)
        views.append(BoardView(view.name, corners))
    return views


def test_a_false_detection_is_left_out():
    world = RigWorld.make(3, count=12)
    points, pixels = world.views[7].corners["right"]
    wrong = pixels[::-1].copy() + 6.0 * np.random.default_rng(0).standard_normal(pixels.shape)
    world.views[7].corners["right"] = points, wrong
    found = calibrate(world.views, world.size)
    assert world.views[7].name not in found.board_to_left and len(found.views) == 11
    assert found.rms_px < 0.13


@pytest.mark.parametrize("board", [BOARD, Board("charuco", 9, 6, 0.03, 0.022), Board("apriltag", 5, 3, 0.04, 0.012)])
def test_boards_are_found_where_the_camera_draws_them(board):
    """A rendered print at a slant: corners within 0.2 px in the median, with at most 0.15 px in common."""
    world = RigWorld.make(4, count=3, has_lens=False)
    for view in world.views:
        pose = world.boards[view.name]
        pose[:3, 3] *= 1.1
        # To the first corner: a print's margin, and a chessboard's first square.
        margin = 0.05 if board.kind == "chessboard" else 0.02
        points, pixels = board.find(world.rendered(view.name, "left", board, np.array([margin, margin])))
        drawn = projected(points * [1, 1, 0], pose, world.K["left"])
        if board.kind == "chessboard" and np.linalg.norm(drawn[0] - pixels[0]) > np.linalg.norm(drawn[-1] - pixels[0]):
            drawn = drawn[::-1]  # counted from its other end
        assert np.median(np.linalg.norm(drawn - pixels, axis=1)) < 0.2
        assert np.abs(np.median(drawn - pixels, axis=0)).max() < 0.15


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """left/ and right/ of five rendered chessboards, and the robot's poses."""
    folder, world = tmp_path_factory.mktemp("boards"), RigWorld.make(6, count=6, has_lens=False)
    for side in ("left", "right"):
        (folder / side).mkdir()
        for view in world.views:
            write_gray(folder / side / view.name, world.rendered(view.name, side, BOARD, np.array([0.05, 0.05])))
    lines = ["name,x,y,z,qx,qy,qz,qw"]
    for view, pose in zip(world.views, world.robot(6), strict=True):
        numbers = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
        lines.append(",".join([view.name, *(f"{n:.9f}" for n in numbers)]))
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    return folder, world


def test_the_command_writes_rig_coverage_and_hand_eye(frames, tmp_path, capsys):
    folder, world = frames
    out = tmp_path / "model.json"
    options = ("--board", "9x6:0.03", "--rectified", "--robot", folder / "poses.csv", "--verbose")
    text = run_here(capsys, "calibrate", "rig", folder, *options, "-o", out).stdout
    assert "6 boards" in text and "camera on gripper" in text and "corners reach" in text
    rig = read_model(out).rig
    assert rig.left.K[0, 0] == pytest.approx(world.K["left"][0, 0], rel=5e-3)
    assert rig.left_to_right[0, 3] == pytest.approx(-0.05, abs=5e-4)
    assert {path.name for path in tmp_path.iterdir()} == {"model.json", "model.coverage.png", "model.hand_eye.json"}
    hand = np.array(json.loads((tmp_path / "model.hand_eye.json").read_text())["camera_to_gripper"]).reshape(4, 4)
    assert difference(hand, world.camera_to_gripper)[0] < 5e-3


def test_bad_boards_are_refused_in_one_line(frames, tmp_path, capsys):
    folder, world = frames
    out, few = tmp_path / "model.json", tmp_path / "few"
    for side in ("left", "right"):
        (few / side).mkdir(parents=True)
        for view in world.views[:2]:
            (few / side / view.name).symlink_to(folder / side / view.name)
    says = lambda path, board: refused(["calibrate", "rig", path, "--board", board, "-o", out], capsys)  # noqa: E731
    assert "2 of 2 frame pairs show the board" in says(few, "9x6:0.03")
    assert "0 of 2 frame pairs" in says(few, "8x5:0.03")
    assert "no PNG file is in both" in says(tmp_path, "9x6:0.03")
    for wrong in ("9x6", "9x6:0.03:0.1", "charuco:9x6:0.02:0.03", "9:0.03", "1x6:0.03"):
        assert wrong in says(few, wrong)
    assert not out.exists()


def test_bad_poses_are_refused_with_file_and_line(tmp_path):
    file = tmp_path / "poses.csv"
    for text, words in (
        ("a,0,0,0,0,0,0,2\n", "line 1: the quaternion's length is 2"),
        ("name,x\na,0,0,0\n", "line 2: 3 numbers"),
        ("a,0,0,0,0,0,0,nan\n", "line 1: 7 numbers, expected finite"),
        ("b,1,2\na,x,0,0,0,0,0,1\n", "line 1: 2 numbers"),
        ("name,x\n", "holds no poses"),
        ("a,0,0,0,0,0,0,1\nb,0,0,0,0,0,0,1\na,1,0,0,0,0,0,1\n", "line 3: frame 'a' has a pose in line 1, too"),
        ("a.png,0,0,0,0,0,0,1\nleft/a.png,1,0,0,0,0,0,1\n", "line 2: frame 'left/a.png' has a pose in line 1, too"),
        ("a," + 200_000 * "1" + "\n", "is no table of poses: field larger than"),
    ):
        file.write_text(text)
        with pytest.raises(ValueError, match=words):
            read_poses(file)


def test_a_robot_that_turns_about_one_axis_is_told_so():
    world = RigWorld.make(7, count=8)
    grippers = [matrix(np.array([0, 0, 0.2 * i]), np.array([0.01 * i, 0, 0])) for i in range(8)]
    with pytest.raises(ValueError, match="one axis"):
        hand_eye(grippers, [world.boards[view.name] for view in world.views])
    with pytest.raises(ValueError, match="3 frames"):
        hand_eye(grippers[:3], [world.boards[view.name] for view in world.views[:3]])
