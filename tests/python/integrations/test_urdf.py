# SPDX-License-Identifier: Apache-2.0
"""A robot's URDF: links as bodies, kinematics against closed forms, meshes by package, and refusals."""

from pathlib import Path

import numpy as np
import pytest

import kuafu
from activestereo.scene_io.bodies import Bodies
from activestereo.integrations.urdf import Urdf

ARM = """<robot name="arm">
  <material name="red"><color rgba="0.8 0.1 0.1 1"/></material>
  <link name="base"><visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
  <link name="upper"><visual><origin xyz="0.5 0 0"/><geometry><box size="1 0.1 0.1"/></geometry>
    <material name="red"/></visual></link>
  <link name="lower"><visual><geometry>
    <mesh filename="package://parts/tip.obj" scale="2 2 2"/></geometry></visual></link>
  <link name="finger"><visual><geometry><sphere radius="0.05"/></geometry></visual></link>
  <link name="other finger"/>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="1 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 2"/></joint>
  <joint name="grip" type="prismatic"><parent link="lower"/><child link="finger"/>
    <origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>
    <axis xyz="1 0 0"/></joint>
  <joint name="grip too" type="prismatic"><parent link="lower"/><child link="other finger"/><origin xyz="1 0 0"/>
    <axis xyz="0 1 0"/><mimic joint="grip" multiplier="-1" offset="0.01"/></joint>
</robot>"""
TIP = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/tip.obj").write_text(TIP)
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return path


def test_links_are_where_a_planar_arm_has_them(arm: Path) -> None:
    robot = Urdf(arm)
    assert robot.joint_names == ["shoulder", "elbow", "grip"]
    q = np.random.default_rng(1).uniform(-2, 2, (7, 3))
    q[:, 2] *= 0.02
    poses = robot.poses(q)
    assert poses.shape == (7, 5, 4, 4)
    a, b = q[:, 0], q[:, 0] + q[:, 1]
    hand = np.stack([np.cos(a) + np.cos(b), np.sin(a) + np.sin(b)], axis=1)
    aside = np.stack([-np.sin(b), np.cos(b)], axis=1)
    finger, other = (robot.link_names.index(name) for name in ("finger", "other finger"))
    # The joint's x axis, turned by a quarter, points aside; the mimic goes the other way, from an offset.
    np.testing.assert_allclose(poses[:, finger, :2, 3], hand + q[:, 2:] * aside, atol=1e-12)
    np.testing.assert_allclose(poses[:, other, :2, 3], hand + (0.01 - q[:, 2:]) * aside, atol=1e-12)
    by_name = robot.poses({"elbow": 0.3}, base=np.diag([1.0, 1, 1, 1]))
    np.testing.assert_allclose(by_name, robot.poses([0.0, 0.3, 0.0]), atol=1e-12)


def test_links_are_bodies_in_each_environment(arm: Path) -> None:
    scene = kuafu.Scene(kuafu.Device())
    bodies, robot = Bodies(scene, environment_count=2), Urdf(arm)
    assert robot.add_to(bodies, "left ") == [0, 1, 2, 3, 4]
    assert bodies.names[1] == "left upper" and scene.summary.instance_count == 8
    # Environment 1's arm is turned by a quarter: its tip, 2 m long, reaches to y = 3 m.
    assert bodies.move(robot.poses(np.array([[0, 0, 0], [np.pi / 2, 0, 0]]))) >= 4
    np.testing.assert_allclose(scene.summary.bounds_max_m[:2], [3.0, 3.0], atol=1e-6)
    assert scene.get_material(1).base_color[0] == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("was", "now", "said"),
    [
        ("<robot", "<robt", "cannot be read as URDF"),
        ('link="base"', 'link="bas"', "'bas', which is no link"),
        ('type="revolute"', 'type="floating"', "'elbow' is floating"),
        ("parts/tip.obj", "parts/tap.obj", "tap.obj is not there"),
        ('radius="0.05"', 'radius="wide"', "1 finite number needed, not 'wide'"),
        ('<child link="upper"/>', '<child link="lower"/>', "no tree"),
        ('joint="grip"', 'joint="grab"', "mimics 'grab'"),
        ("<sphere", "<torus", "<torus> is not known"),
    ],
)
def test_what_is_wrong_is_said(arm: Path, was: str, now: str, said: str) -> None:
    assert was in ARM
    arm.write_text(ARM.replace(was, now))
    with pytest.raises(ValueError, match=said) as error:
        Urdf(arm)
    assert str(arm) in str(error.value)


def test_joints_that_are_not_there_are_refused(arm: Path) -> None:
    with pytest.raises(ValueError, match="no joint 'wrist'"):
        Urdf(arm).poses({"wrist": 1.0})
    with pytest.raises(ValueError, match=r"\[\.\.\., 3\], not \(2,\)"):
        Urdf(arm).poses([0.0, 1.0])
