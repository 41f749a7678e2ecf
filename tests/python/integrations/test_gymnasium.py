# SPDX-License-Identifier: Apache-2.0
"""Gymnasium environments get the depth of an active stereo camera: with the package where it is installed, else with
what its published interface says."""

import sys
import types

import numpy as np
import pytest

HEIGHT, WIDTH, DISTANCE_M = 96, 128, 0.8


def _published():
    """Names of gymnasium 1.x that the wrapper uses (gymnasium.farama.org/api/wrappers, api/spaces)."""
    module = types.ModuleType("gymnasium")

    class Env:
        def step(self, action):
            return self.seen(), 0.0, False, False, {}

        def reset(self, *, seed=None, options=None):
            return self.seen(), {}

    class ObservationWrapper(Env):
        def __init__(self, env):
            self.env, self.observation_space = env, env.observation_space

        def reset(self, *, seed=None, options=None):
            seen, info = self.env.reset(seed=seed, options=options)
            return self.observation(seen), info

        def step(self, action):
            seen, *rest = self.env.step(action)
            return self.observation(seen), *rest

    class Box:
        def __init__(self, low, high, shape, dtype):
            self.low, self.high, self.shape, self.dtype = low, high, shape, dtype

        def contains(self, x):
            return x.shape == self.shape and x.dtype == self.dtype and (x >= self.low).all() and (x <= self.high).all()

    class Dict(dict):
        def contains(self, x):
            return x.keys() == self.keys() and all(space.contains(x[name]) for name, space in self.items())

    module.Env, module.ObservationWrapper = Env, ObservationWrapper
    module.spaces = types.SimpleNamespace(Box=Box, Dict=Dict)
    return module


try:
    import gymnasium
except ImportError:
    gymnasium = sys.modules["gymnasium"] = _published()

from activestereo.integrations.gymnasium import StereoDepth  # noqa: E402

if getattr(gymnasium, "__file__", None) is None:
    del sys.modules["gymnasium"]  # other tests ask for the package itself


class Wall(gymnasium.Env):
    """A wall whose lower half is nearer; upside down and in centimetres, as buffers are."""

    observation_space = gymnasium.spaces.Dict({
        "pixels": gymnasium.spaces.Dict({
            "depth": gymnasium.spaces.Box(0.0, 1000.0, (HEIGHT, WIDTH, 1), np.float32),
            "color": gymnasium.spaces.Box(0, 255, (HEIGHT, WIDTH, 3), np.uint8),
        })
    })  # fmt: skip
    action_space = None

    def seen(self):
        depth = np.full((HEIGHT, WIDTH, 1), 100.0 * DISTANCE_M, np.float32)
        depth[: HEIGHT // 2] *= 0.75
        return {"pixels": {"depth": depth, "color": np.full((HEIGHT, WIDTH, 3), 160, np.uint8)}}

    def reset(self, *, seed=None, options=None):
        return self.seen(), {}

    def step(self, action):
        return self.seen(), 0.0, False, False, {}


@pytest.fixture(scope="module")
def env():
    turn = {"metres": lambda z: 0.01 * z[::-1], "back": lambda z: z[::-1]}
    return StereoDepth(Wall(), ("pixels", "depth"), ("pixels", "color"), 58.0, **turn)


def test_depth_is_measured_where_it_stood(env):
    seen, _ = env.reset(seed=3)
    depth, color = seen["pixels"]["depth"], seen["pixels"]["color"]
    assert env.observation_space.contains(seen) and (color == 160).all()
    for half, distance_m in ((depth[: HEIGHT // 2 - 12], 0.75 * DISTANCE_M), (depth[HEIGHT // 2 + 12 :], DISTANCE_M)):
        assert (half > 0).mean() > 0.6
        assert np.median(half[half > 0]) == pytest.approx(distance_m, rel=0.02)
    assert len(np.unique(depth)) > 100  # not the truth


def test_a_seed_repeats_the_noise_and_a_step_does_not(env):
    first, _ = env.reset(seed=7)
    moved, *_ = env.step(None)
    again, _ = env.reset(seed=7)
    same = [np.array_equal(first["pixels"]["depth"], other["pixels"]["depth"]) for other in (again, moved)]
    assert same == [True, False]


def test_a_missing_key_is_named():
    with pytest.raises(ValueError, match="has no pixels/deep"):
        StereoDepth(Wall(), ("pixels", "deep"))


class Libero(Wall):
    """LeRobot's LiberoEnv in what matters here (lerobot 0.4, envs/libero.py): colours upside down, and no depth."""

    observation_space = gymnasium.spaces.Dict({
        "pixels": gymnasium.spaces.Dict({"image": gymnasium.spaces.Box(0, 255, (HEIGHT, WIDTH, 3), np.uint8)})
    })  # fmt: skip

    def seen(self):
        return {"pixels": {"image": np.full((HEIGHT, WIDTH, 3), 160, np.uint8)}}


def test_an_environment_without_depth_gets_bytes_that_lerobot_takes():
    """lerobot 0.4, envs/utils.py, preprocess_observation(): bytes, and fewer channels than rows and columns."""
    env = StereoDepth(
        Libero(), ("pixels", "depth"), ("pixels", "image"), 58.0, back=lambda z: z[::-1],
        rendered=lambda env: np.full((HEIGHT, WIDTH), DISTANCE_M),
        coded=lambda z: np.repeat(np.uint8(255 * np.clip(z / 2.0, 0, 1))[..., None], 3, axis=2),
    )  # fmt: skip
    seen, _ = env.reset(seed=3)
    assert env.observation_space.contains(seen) and list(seen["pixels"]) == ["image", "depth"]
    for image in seen["pixels"].values():
        height, width, channels = image.shape
        assert image.dtype == np.uint8 and channels < height and channels < width and image.flags.c_contiguous
    told = seen["pixels"]["depth"][..., 0]
    assert np.median(told[told > 0]) == pytest.approx(255 * DISTANCE_M / 2.0, abs=2)
    with pytest.raises(ValueError, match="give color"):
        StereoDepth(Libero(), ("pixels", "depth"), rendered=lambda env: None)


class Robosuite(gymnasium.Env):
    """robosuite's own environment with observations as Gymnasium has them."""

    def __init__(self, env):
        self.env, first = env, env.reset()
        images = {name: first[name] for name in ("agentview_image", "agentview_depth")}
        self.observation_space = gymnasium.spaces.Dict({
            name: gymnasium.spaces.Box(0, 255 if image.dtype == np.uint8 else 1, image.shape, image.dtype.type)
            for name, image in images.items()
        })  # fmt: skip

    def reset(self, *, seed=None, options=None):
        return self._seen(self.env.reset()), {}

    def step(self, action):
        seen, reward, done, info = self.env.step(action)
        return self._seen(seen), reward, done, False, info

    def _seen(self, seen):
        return {name: seen[name] for name in self.observation_space}


def test_robosuites_depth_buffer_becomes_measured_depth(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")
    robosuite = pytest.importorskip("robosuite", reason="robosuite is not installed (pip install robosuite)")
    from robosuite.utils.camera_utils import get_real_depth_map

    scene = robosuite.make(
        "Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=True, camera_names="agentview",
        camera_heights=HEIGHT, camera_widths=WIDTH, camera_depths=True, hard_reset=False,
    )  # fmt: skip
    own = Robosuite(scene)
    fovy_deg = scene.sim.model.cam_fovy[scene.sim.model.camera_name2id("agentview")]
    env = StereoDepth(
        own, "agentview_depth", "agentview_image", fovy_deg, back=lambda z: z[::-1],
        metres=lambda z: get_real_depth_map(scene.sim, z)[::-1],
    )  # fmt: skip
    env.reset(seed=1)
    seen = env.step(np.zeros(scene.action_dim))[0]
    assert env.observation_space.contains(seen)
    # robosuite gives what it last observed: the same upside-down picture that was measured.
    truth = get_real_depth_map(scene.sim, scene._get_observations()["agentview_depth"])
    there = seen["agentview_depth"] > 0
    assert there.mean() > 0.6
    assert np.median(np.abs(seen["agentview_depth"] - truth)[there]) < 0.01
