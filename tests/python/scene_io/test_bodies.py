# SPDX-License-Identifier: Apache-2.0
"""Bodies moved by arrays of poses, one scene and many environments."""

import numpy as np
import pytest

import kuafu
from activestereo import Pose
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, BodyPoseError, Shape, add_mesh
from activestereo.common.pose import host_array, pose_fault, pose_matrices

K = [[40, 0, 15.5], [0, 40, 15.5], [0, 0, 1]]


def cubes(environment_count):
    """Two cubes of half size 0.1 in a scene: 'red' and 'blue'."""
    scene = kuafu.Scene(kuafu.Device())
    bodies = Bodies(scene, environment_count)
    mesh = add_mesh(scene, solids.box())
    to_body = np.diag([0.1, 0.1, 0.1, 1.0])
    bodies.add("red", [Shape(mesh, to_body=to_body)])
    bodies.add("blue", [Shape(mesh, to_body=to_body)], pose=[0, 0, 9, 1, 0, 0, 0])
    return scene, bodies


def middle_depth(scene, environments):
    """Depth at the middle of a camera at the origin that looks along z, in each environment."""
    renderer = kuafu.Renderer(scene.device)
    cameras = [kuafu.Camera(32, 32, K) for _ in environments]
    return renderer.render(scene, cameras, ["depth"], environments=environments, spp=1)["depth"][:, 16, 16, 0]


def at(*z):
    """[len(z), 2, 7]: the red cube at depth z, the blue one far to the side."""
    poses = np.zeros((len(z), 2, 7))
    poses[:, 0, 2], poses[:, 1, 0], poses[..., 3] = z, 50.0, 1.0
    return poses


def test_albedos_differ_between_environments():
    scene = kuafu.Scene(kuafu.Device())
    bodies, mesh = Bodies(scene, 3), add_mesh(scene, solids.box())
    paint = scene.add_material(kuafu.Material(base_color=(0.4, 0.4, 0.4, 1.0), ir_albedo=0.6))
    for name in ("red", "blue"):
        bodies.add(name, [Shape(mesh, [paint], np.diag([0.1, 0.1, 0.1, 1.0]))])
    bodies.move(at(1.0, 1.0, 1.0))

    def albedo():
        renderer, cameras = kuafu.Renderer(scene.device), [kuafu.Camera(32, 32, K)] * 3
        seen = renderer.render(scene, cameras, ["albedo"], environments=[0, 1, 2], spp=1, band="infrared")
        return seen["albedo"][:, 16, 16, 0]

    for factors in ([1.0, 0.5, 0.0], [0.25, 1.0, 9.0]):
        bodies.vary_albedo("red", factors)
        np.testing.assert_allclose(albedo(), np.minimum(0.6 * np.array(factors), 1.0), rtol=1e-3, atol=1e-6)
    assert scene.get_material(paint).ir_albedo == pytest.approx(0.6)
    with pytest.raises(ValueError, match="environment 0 is -1; environment 2 is nan, expected finite factors"):
        bodies.vary_albedo("red", [-1, 1, np.nan])
    with pytest.raises(ValueError, match=r"is \[2\], expected \[3\] factors"):
        bodies.vary_albedo("red", [1, 1])


@pytest.mark.parametrize("kind", ["float32", "matrices", "lists", "torch", "dlpack"])
def test_poses_come_in_many_kinds(kind):
    scene, bodies = cubes(2)
    poses = at(1.0, 2.0)
    if kind == "torch":
        torch = pytest.importorskip("torch", reason="the package torch is not installed (pip install torch)")
        given = torch.from_numpy(poses.astype(np.float32))
    else:
        protocol = {"__dlpack__": lambda _, **k: poses.__dlpack__(**k), "__dlpack_device__": lambda _: (1, 0)}
        kinds = {"float32": poses.astype(np.float32), "matrices": pose_matrices(poses, ""), "lists": poses.tolist()}
        given = (kinds | {"dlpack": type("Speaker", (), protocol)()})[kind]
    bodies.move(given)
    np.testing.assert_allclose(middle_depth(scene, [0, 1]), [0.9, 1.9], rtol=1e-6)


def test_each_environment_has_its_own_poses_and_only_what_moved_is_updated():
    scene, bodies = cubes(3)
    assert bodies.move(at(1.0, 2.0, 3.0)) == 6
    np.testing.assert_allclose(middle_depth(scene, [0, 1, 2]), [0.9, 1.9, 2.9], rtol=1e-6)
    assert bodies.move(at(1.0, 2.0, 3.0)) == 0
    assert bodies.move(at(1.0, 2.5, 3.0)) == 1
    assert bodies.move({"red": at(1.5, 2.5, 3.0)[:, 0]}) == 1
    np.testing.assert_allclose(middle_depth(scene, [0, 1, 2]), [1.4, 2.4, 2.9], rtol=1e-6)


def test_a_body_may_go():
    scene, bodies = cubes(2)
    bodies.move(at(1.0, 2.0))
    bodies.remove("red")
    assert bodies.names == ["blue"] and scene.summary.instance_count == 2
    assert bodies.move(at(3.0, 4.0)[:, :1]) == 2  # the blue one, where the red one was
    np.testing.assert_allclose(middle_depth(scene, [0, 1]), [2.9, 3.9], rtol=1e-6)


def test_a_scene_without_environments():
    scene, bodies = cubes(None)
    assert bodies.move(at(4.0)[0]) == 2
    np.testing.assert_allclose(middle_depth(scene, [0]), [3.9], rtol=1e-6)


def test_environments_may_differ_in_bodies():
    scene, bodies = cubes(2)
    mesh = add_mesh(scene, solids.sphere())
    bodies.add("ball", [Shape(mesh, to_body=np.diag([0.2, 0.2, 0.2, 1]))], environments=[1])
    ball = np.broadcast_to([0, 0, 0.7, 1.0, 0, 0, 0], (2, 1, 7))
    bodies.move(np.concatenate([at(1.0, 1.0), ball], axis=1))
    np.testing.assert_allclose(middle_depth(scene, [0, 1]), [0.9, 0.5], atol=1e-3)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, "quaternion", "shear", "mirror"])
def test_a_pose_that_is_none_names_its_place_and_the_others_move(wrong):
    scene, bodies = cubes(3)
    bodies.move(at(1.0, 2.0, 3.0))
    poses = pose_matrices(at(1.5, 2.5, 3.5), "")
    if wrong == "quaternion":
        poses = at(1.5, 2.5, 3.5)
        poses[1, 1, 3:] = 0.0
    elif wrong == "shear":
        poses[1, 1, 0, 1] = 0.5
    elif wrong == "mirror":
        poses[1, 1, 0, 0] = -1.0
    else:
        poses[1, 1, 0, 3] = wrong
    with pytest.raises(BodyPoseError, match="environment 1, body 'blue'.* 1 of 3 environments stay") as caught:
        bodies.move(poses)
    assert (caught.value.environment, caught.value.body) == (1, "blue")
    np.testing.assert_allclose(middle_depth(scene, [0, 1, 2]), [1.4, 1.9, 3.4], rtol=1e-6)
    assert bodies.move(at(1.5, 2.5, 3.5)) == 1


def test_what_does_not_fit_is_told():
    scene, bodies = cubes(3)
    shapes = r"the shape \(3, 2, 7\) or \(3, 2, 4, 4\), not \(2, 2, 7\)"
    with pytest.raises(ValueError, match=f"2 bodies in 3 environments have {shapes}"):
        bodies.move(at(1.0, 2.0))
    with pytest.raises(ValueError, match="no body 'bleu' among 2; did you mean 'blue'"):
        bodies.move({"red": at(1, 2, 3)[:, 0], "blue": at(1, 2, 3)[:, 0], "bleu": at(1, 2, 3)[:, 0]})
    with pytest.raises(ValueError, match="there is a body 'red' already"):
        bodies.add("red", [])
    with pytest.raises(ValueError, match="environments are 0 to 2, not .3."):
        bodies.add("green", [Shape(0)], environments=[3])
    with pytest.raises(ValueError, match="at least one environment, not 0"):
        Bodies(scene, 0)
    with pytest.raises(ValueError, match="body 'green': a pose is"):
        bodies.add("green", [Shape(0)], pose=[np.nan] * 7)


def test_matrices_are_those_of_the_quaternions():
    random = np.random.Generator(np.random.PCG64(1))
    poses = random.normal(size=(5, 7))
    for pose, matrix in zip(poses, pose_matrices(poses, ""), strict=True):
        np.testing.assert_allclose(matrix, Pose(pose[:3], pose[3:]).to_transformation_matrix(), atol=1e-12)
    assert not pose_fault(pose_matrices(poses, "")).any()
    with pytest.raises(ValueError, match="poses: a pose has 7 numbers"):
        pose_matrices(np.zeros((3, 6)), "poses")
    assert host_array([[1, 2]]).dtype == np.float64
