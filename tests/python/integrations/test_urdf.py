# SPDX-License-Identifier: Apache-2.0
"""A robot's URDF: links as bodies, kinematics against closed forms, meshes by package, and refusals."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

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


BLACK = (0.02, 0.02, 0.02, 1.0)
TRIANGLE_OBJ = "v 0 0 0\nv 120 0 0\nv 0 40 0\nvt 0 0\nf 1/1 2/1 3/1\n"


def collada(unit: str, up: str = "Z_UP") -> str:
    """A triangle (0, 0, 0), (120, 0, 0), (0, 0, 40) of a nearly black material."""
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>{up}</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="c"><lambert><diffuse><color>  0.02 0.02 0.02 1  </color>
</diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m" name="black"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">0 0 0 120 0 0 0 0 40</float_array>
<technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1" material="m">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="m" target="#m"/></technique_common></bind_material></instance_geometry></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def shown(folder: Path, mesh: str, material: str = "") -> kuafu.Scene:
    """The scene of a robot of one link with this <mesh> and what follows its geometry."""
    urdf = folder / "one.urdf"
    visual = f"<visual><geometry><mesh {mesh}/></geometry>{material}</visual>"
    urdf.write_text(f'<robot name="one"><link name="base">{visual}</link></robot>')
    scene = kuafu.Scene(kuafu.Device("cpu"))
    Urdf(urdf).add_to(Bodies(scene))
    return scene


@pytest.mark.parametrize(
    ("name", "text", "scale", "size_m"),
    [
        ("a.obj", TRIANGLE_OBJ, "0.001 0.001 0.001", (0.12, 0.04, 0)),
        ("a.obj", TRIANGLE_OBJ, "0.001 -0.002 1", (0.12, 0.08, 0)),
        ("a.dae", collada('<unit name="inch" meter="0.0254"/>'), "0.1 0.1 0.1", (0.3048, 0, 0.1016)),
        ("a.dae", collada('<unit name="centimeter" meter="0.01"/>'), "1 1 1", (1.2, 0, 0.4)),
        ("a.dae", collada('<unit name="meter" meter="1"/>', "Y_UP"), "0.001 0.001 0.001", (0.12, 0, 0.04)),
        ("a.dae", collada('<unit name="meter" meter="1"/>', "X_UP"), "0.001 0.001 0.001", (0.12, 0, 0.04)),
        ("A.DAE", collada(""), "0.001 0.001 0.001", (0.12, 0, 0.04)),
    ],
)
def test_a_mesh_has_its_scale_and_its_files_unit(
    tmp_path: Path, name: str, text: str, scale: str, size_m: tuple[float, ...], caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / name).write_text(text)
    summary = shown(tmp_path, f'filename="{name}" scale="{scale}"').summary
    np.testing.assert_allclose(np.subtract(summary.bounds_max_m, summary.bounds_min_m), size_m, atol=1e-6)
    assert summary.bounds_max_m[0] == pytest.approx(size_m[0])
    assert not [record for record in caplog.records if "urdf" in record.name]


def test_a_part_as_long_as_a_house_is_told_with_what_to_write(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "a.obj").write_text(TRIANGLE_OBJ)
    assert shown(tmp_path, 'filename="a.obj"').summary.bounds_max_m[0] == 120.0
    assert "one.urdf: " in caplog.text and "a.obj is 120 m long" in caplog.text
    assert 'scale="0.001 0.001 0.001"' in caplog.text


PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""
RED = '<material name="r"><color rgba="0.8 0.1 0.1 1"/></material>'


@pytest.mark.parametrize(
    ("name", "text", "material", "colour"),
    [
        ("a.obj", "mtllib a.mtl\nusemtl black\n" + TRIANGLE_OBJ, "", BLACK),
        ("a.dae", collada(""), "", BLACK),
        ("a.dae", collada(""), RED, (0.8, 0.1, 0.1, 1.0)),
        ("a.dae", collada(""), '<material name="only a name"/>', BLACK),
        ("a.ply", PLY, "", (0.6, 0.6, 0.6, 1.0)),
        ("a.ply", PLY, RED, (0.8, 0.1, 0.1, 1.0)),
    ],
)
def test_a_meshs_own_colour_stays_where_the_urdf_gives_none(
    tmp_path: Path, name: str, text: str, material: str, colour: tuple[float, ...]
) -> None:
    (tmp_path / "a.mtl").write_text("newmtl black\nKd 0.02 0.02 0.02\n")
    (tmp_path / name).write_text(text)
    scene = shown(tmp_path, f'filename="{name}" scale="0.01 0.01 0.01"', material)
    assert scene.summary.material_count == 1
    assert scene.get_material(0).base_color == pytest.approx(colour, abs=1e-6)


def test_a_meshs_materials_and_textures_come_with_it(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (10, 20, 30)).save(tmp_path / "dark.png")
    (tmp_path / "a.mtl").write_text(
        "newmtl a\nKd 1 1 1\nmap_Kd dark.png\nmap_Pr dark.png\nnewmtl b\nKd 0.5 0.25 0.125\n"
    )
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl a\n" + TRIANGLE_OBJ + "usemtl b\nf 1/1 3/1 2/1\n")
    scene = shown(tmp_path, 'filename="a.obj" scale="0.001 0.001 0.001"')
    assert (scene.summary.instance_count, scene.summary.material_count, scene.summary.texture_count) == (2, 2, 2)
    first, second = (scene.get_material(number) for number in (0, 1))
    assert first.base_color_texture is not None and first.metallic_roughness_texture is not None
    assert second.base_color[:3] == pytest.approx((0.5, 0.25, 0.125))


def test_a_broken_mesh_names_both_files(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nf 1 2 3\n")
    with pytest.raises(ValueError, match=r"one\.urdf: .*a\.obj: .*line 2") as error:
        shown(tmp_path, 'filename="a.obj"')
    assert "\n" not in str(error.value)
