# SPDX-License-Identifier: Apache-2.0
"""The task of grasping by depth: its geometry, its modes of depth, and Gymnasium's own check."""

import numpy as np
import pytest

import kuafu
from activestereo import Mounts, StereoDepthSensorConfig
from activestereo.sensor.depth_modes import MODES, DepthCamera
from sensor_scenes import wall_scene
from stereo_grasp import GraspWorld, teacher


def camera(mode, distance_m=0.8, **material):
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.25)
    config.samples_per_pixel = 2
    scene = wall_scene(distance_m)
    scene.set_material(0, kuafu.Material(**{"base_color": (0.6, 0.6, 0.6, 1), "specular": 0.0} | material))
    return DepthCamera(mode, config, Mounts(scene, [[0, 0, 0, 1, 0, 0, 0]] * 2))


def test_clean_is_the_true_depth():
    depth = camera("clean").take_depth()
    assert depth.shape == (2, 120, 212) and depth.dtype == np.float32
    np.testing.assert_allclose(depth[depth > 0], 0.8, atol=1e-4)


def test_gaussian_noise_grows_with_the_square_of_depth():
    sigma = [np.std(camera("gaussian", distance_m=d).take_depth()) for d in (0.5, 2.0)]
    np.testing.assert_allclose(sigma, [0.001, 0.016], rtol=0.05)


@pytest.mark.parametrize("mode", ["raster", "full"])
def test_matched_modes_measure_a_wall(mode):
    depth = camera(mode).take_depth()
    assert np.median(depth[depth > 0]) == pytest.approx(0.8, rel=0.02) and (depth > 0).mean() > 0.7


def test_metal_is_matt_in_raster_alone():
    """A mirror sends the dots elsewhere; a raster's Lambertian one sends them back."""
    good = {}
    for mode in ("raster", "full"):
        depth = camera(mode, metallic=1.0, roughness=0.05).take_depth()
        good[mode] = (np.abs(depth - 0.8) < 0.02).mean()
    assert good["raster"] > good["full"] + 0.3


def test_a_mode_that_is_none_is_refused():
    with pytest.raises(ValueError, match="unknown mode 'fulll' ..*raster, full.; did you mean 'full'"):
        camera("fulll")


def test_a_teacher_grasps_and_chance_does_not():
    world = GraspWorld(16, "clean", size_px=32, seed=1)
    random = np.random.default_rng(0)
    rate = {}
    for name, act in (("teacher", teacher), ("chance", lambda w: random.uniform(-1, 1, (w.count, 4)))):
        held = []
        for _ in range(4):
            world.reset()
            for step in range(10):
                ended, succeeded = world.step(act(world))
                assert ended.all() == (step == 9) and not succeeded[~ended].any()
            held += succeeded.tolist()
        rate[name] = np.mean(held)
    assert rate["teacher"] > 0.95 and rate["chance"] < 0.1


@pytest.mark.parametrize(
    "offset, holds",
    [
        ((0, 0, 0, 0), True), ((0, 0.03, 0, 0), False), ((0.1, 0, 0, 0), False), ((0, 0, 0.1, 0), False),
        ((0, 0, 0, 0.6), False),
    ],
    ids=["there", "on a finger", "beside", "too high", "turned"],
)  # fmt: skip
def test_what_a_grasp_needs(offset, holds):
    world = GraspWorld(16, "clean", size_px=32, seed=2)
    world.reset()
    world.chosen[:] = 0  # boxes
    x, y, z, turn = world.offsets().T
    world.yaw_rad += turn
    world.gripper_m[:, :2] = world.object_m[:, :2]
    world.gripper_m[:, 2] += z
    assert np.abs(world.offsets()).max() < 1e-9
    cos, sin = np.cos(world.yaw_rad), np.sin(world.yaw_rad)
    dx, dy, dz, dturn = offset
    world.gripper_m += np.stack([cos * dx - sin * dy, sin * dx + cos * dy, 0 * cos + dz], 1)
    world.yaw_rad += dturn
    assert (world.would_hold() == holds).all()


def test_the_camera_sees_the_thing_where_it_is():
    world = GraspWorld(4, "clean", size_px=64, seed=3)
    world.reset()
    for _ in range(9):
        world.step(teacher(world))
    depth = world.look()
    # The gripper is at the thing, 0.25 m before the camera; the middle of the image is its place.
    np.testing.assert_allclose(depth[:, 31:33, 31:33].mean(axis=(1, 2)), np.hypot(0.06, 0.24), atol=0.04)
    assert (depth[:, 31, 31] < depth[:, 0, 0]).all()


def test_the_same_seed_gives_the_same_course():
    def course(mode):
        world = GraspWorld(2, mode, size_px=32, samples_per_pixel=1, seed=5)
        seen = [world.reset(seed=7)]
        for _ in range(2):
            world.step(teacher(world))
            seen.append(world.look())
        return np.stack(seen)

    for mode in ("isaac-like", "full"):
        np.testing.assert_array_equal(course(mode), course(mode), err_msg=mode)


def test_an_action_that_is_none_names_its_environment():
    world = GraspWorld(3, "clean", size_px=32)
    world.reset()
    actions = np.zeros((3, 4))
    actions[2, 1] = np.nan
    before = world.gripper_m.copy()
    with pytest.raises(ValueError, match="environment 2: its action .* is not finite"):
        world.step(actions)
    np.testing.assert_array_equal(world.gripper_m, before)
    with pytest.raises(ValueError, match=r"actions of 3 environments are \[3, 4\], not \(2, 4\)"):
        world.step(actions[:2])


@pytest.fixture
def gymnasium():
    return pytest.importorskip("gymnasium", reason="the package gymnasium is not installed (pip install gymnasium)")


@pytest.mark.parametrize("mode", MODES)
def test_gymnasium_is_content(gymnasium, mode):
    import stereo_grasp  # noqa: F401 (registers)
    from gymnasium.utils.env_checker import check_env

    env = gymnasium.make("activestereo/StereoGrasp-v0", mode=mode, size_px=32, samples_per_pixel=1)
    check_env(env.unwrapped, skip_render_check=True)


def test_a_vector_of_environments_begins_anew_by_itself(gymnasium):
    import stereo_grasp  # noqa: F401 (registers)

    envs = gymnasium.make_vec("activestereo/StereoGrasp-v0", num_envs=4, mode="clean", size_px=32)
    depth, info = envs.reset(seed=1)
    assert depth.shape == (4, 32, 32, 1) and envs.observation_space.contains(depth)
    total = np.zeros(4)
    for step in range(11):
        depth, reward, terminated, truncated, info = envs.step(
            np.clip(info["state"] / [0.03, 0.03, 0.04, 0.3], -1, 1).astype(np.float32)
        )
        total += reward
        assert terminated.all() == (step == 9)
    assert (total == 1.0).all() and (envs.unwrapped.world.steps == 0).all()


def test_hard_things_stand_where_clean_depth_says_and_full_depth_does_not():
    """A camera's own depth goes through glass, past mirrors, and has holes where velvet gives no dots back."""

    def right_share(things):
        options = {"samples_per_pixel": 2, "seed": 4, "things": things}
        clean, full = GraspWorld(8, "clean", **options), GraspWorld(8, "full", **options)
        there, seen = clean.reset(), full.reset()
        clean.things.place(clean.chosen, clean.object_m + 5.0, clean.object_yaw_rad)
        thing = clean.look() - there > 0.005
        assert thing.mean() > 0.01
        return (np.abs(seen - there) < 0.01)[thing].mean()

    assert right_share("hard") < 0.5 * right_share("mixed")
    with pytest.raises(ValueError, match="things are 'mixed' or 'hard', not 'soft'"):
        GraspWorld(1, "clean", things="soft")
