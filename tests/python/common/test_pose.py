# SPDX-License-Identifier: Apache-2.0
"""SAPIEN's body axes (x forward, y left, z up) against camera axes (x right, y down, z forward)."""

import numpy as np
import pytest

from activestereo import Pose
from activestereo.common.pose import body_pose, camera_to_camera, camera_to_world, look_at, printed_motion, rigid_fault

QUARTER_TURN_LEFT = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]  # about z, which is up


@pytest.mark.parametrize(
    "camera_axis, body_axis",
    [((0, 0, 1), (1, 0, 0)), ((1, 0, 0), (0, -1, 0)), ((0, 1, 0), (0, 0, -1))],
    ids=["forward", "right", "down"],
)
def test_axes(camera_axis, body_axis):
    np.testing.assert_allclose(camera_to_world(Pose())[:3, :3] @ camera_axis, body_axis, atol=1e-12)


def test_a_body_turned_left_looks_along_its_parents_left():
    pose = Pose([1.0, 2.0, 3.0], QUARTER_TURN_LEFT)
    np.testing.assert_allclose(camera_to_world(pose) @ [0, 0, 2, 1], [1.0, 4.0, 3.0, 1.0], atol=1e-12)


def test_body_pose_inverts_camera_to_world():
    pose = Pose([0.3, -0.2, 0.9], [0.5, -0.1, 0.7, 0.2])
    back = body_pose(camera_to_world(pose))
    np.testing.assert_allclose(back.to_transformation_matrix(), pose.to_transformation_matrix(), atol=1e-12)


def test_product_and_inverse():
    a, b = Pose([1, 0, 0], QUARTER_TURN_LEFT), Pose([0, 2, 0], [0.9, 0.1, -0.3, 0.2])
    product, (one, two) = (a * b).to_transformation_matrix(), (p.to_transformation_matrix() for p in (a, b))
    np.testing.assert_allclose(product, one @ two, atol=1e-12)
    np.testing.assert_allclose((a * a.inv()).to_transformation_matrix(), np.eye(4), atol=1e-12)


@pytest.mark.parametrize(
    "q", [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1), (1e-9, 1, 1, 0), (0.5, -0.5, 0.5, -0.5)]
)
def test_quaternion_survives_the_matrix(q):
    matrix = Pose((0, 0, 0), q).to_transformation_matrix()
    np.testing.assert_allclose(Pose(matrix).to_transformation_matrix(), matrix, atol=1e-12)


def test_camera_to_camera_moves_points_the_other_way():
    """A camera 5 cm to the right of another sees points 5 cm further left: -x."""
    right = Pose([0.0, -0.05, 0.0])
    np.testing.assert_allclose(camera_to_camera(Pose(), right) @ [0, 0, 1, 1], [-0.05, 0, 1, 1], atol=1e-12)


def test_look_at_puts_the_target_on_the_axis_and_up_upwards():
    pose = look_at(eye=(1, 2, 3), target=(0, 0, 0), up=(0, 1, 0))
    seen = np.linalg.inv(pose) @ [0, 0, 0, 1]
    np.testing.assert_allclose(seen, [0, 0, np.sqrt(14), 1], atol=1e-12)
    assert (np.linalg.inv(pose) @ [0, 1, 0, 1])[1] < 0  # y is down
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize("target", [(0, 0, 0), (0, 2, 0), (0, float("nan"), 1)])
def test_a_view_without_a_plane_is_refused(target):
    with pytest.raises(ValueError, match=r"no view from \[0. 0. 0.\] at .* has \[0. 1. 0.\] upwards"):
        look_at((0, 0, 0), target, (0, 1, 0))


@pytest.mark.parametrize(
    "bad", [(np.diag([2.0, 1, 1, 1]),), (np.diag([-1.0, 1, 1, 1]),), ([0, 0, float("nan")],), ([0, 0, 0], [0, 0, 0, 0])]
)
def test_what_is_no_rigid_motion_is_refused(bad):
    with pytest.raises(ValueError, match="rigid" if len(np.shape(bad[0])) > 1 else None):
        Pose(*bad)


def test_what_is_not_rigid_is_said_in_words():
    assert rigid_fault(np.eye(4)) is None
    assert rigid_fault(np.diag([-1.0, 1, 1, 1])).endswith("its 3x3 part mirrors")
    assert rigid_fault(np.diag([1.1, 1, 1, 1])).endswith("off a rotation by 0.21")
    assert rigid_fault(np.diag([1.0, 1, 1, 2])).endswith("is 0, 0, 0, 2, expected 0, 0, 0, 1")
    for broken in (np.eye(3), np.full((4, 4), np.nan)):
        assert rigid_fault(broken) == "is not a 4x4 of finite numbers"


def test_a_rotation_printed_with_few_digits_becomes_one():
    true = look_at(eye=(1, 2, 3), target=(0, 0, 0), up=(0, 1, 0))
    few = np.round(true[:3, :3], 3)
    assert rigid_fault(np.block([[few, true[:3, 3:]], [true[3:]]])) is not None
    pose = printed_motion(few.ravel().tolist(), true[:3, 3], "poses.txt: line 3")
    assert rigid_fault(pose, 1e-12) is None
    np.testing.assert_allclose(pose, true, atol=1e-3)
    with pytest.raises(ValueError, match="poses.txt: line 3: is not a rigid motion: its 3x3 part mirrors"):
        printed_motion(-few, true[:3, 3], "poses.txt: line 3")
    with pytest.raises(ValueError, match="poses.txt: line 3: is not 9 numbers of a rotation and 3 of a translation"):
        printed_motion(few, (1.0, 2.0), "poses.txt: line 3")
    with pytest.raises(ValueError, match="last row of the row-major 4x4 is 0, 0, 1, 1"):
        printed_motion(few, true[:3, 3], "poses.txt: line 3", (0, 0, 1, 1))
