# SPDX-License-Identifier: Apache-2.0
"""Gymnasium environments get an active stereo camera's depth, by the package or its published interface."""

import importlib
import os
import sys
import types
from dataclasses import dataclass, field

import numpy as np
import pytest

HEIGHT, WIDTH, DISTANCE_M = 96, 128, 0.8


def _published():
    """Names of gymnasium 1.x that the wrapper uses (gymnasium.farama.org/api/wrappers, api/spaces)."""
    module = types.ModuleType("gymnasium")

    class Env:
        unwrapped = property(lambda self: self.env.unwrapped if hasattr(self, "env") else self)

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

    class SyncVectorEnv:
        def __init__(self, env_fns, autoreset_mode=None):
            self.envs, self.metadata = [made() for made in env_fns], {"autoreset_mode": autoreset_mode}

    module.vector = types.SimpleNamespace(SyncVectorEnv=SyncVectorEnv, AutoresetMode=types.SimpleNamespace(NEXT_STEP=1))
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
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (7,), np.float32)

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


def test_finer_images_are_measured_by_a_coarser_sensor():
    """The wall's nearer half is measured as near; the sensor's pixels are seen in the images' shape."""
    turn = {"metres": lambda z: 0.01 * z[::-1], "back": lambda z: z[::-1]}
    fine = StereoDepth(Wall(), ("pixels", "depth"), ("pixels", "color"), 58.0, supersampling=2, **turn)
    seen, _ = fine.reset(seed=3)
    depth = seen["pixels"]["depth"]
    assert fine.observation_space.contains(seen) and (depth[::2, ::2] == depth[1::2, 1::2]).all()
    assert np.median(depth[: HEIGHT // 2 - 12]) == pytest.approx(0.75 * DISTANCE_M, rel=0.05)
    with pytest.raises(ValueError, match="supersampling is 5: images of 128x96 are no multiple"):
        StereoDepth(Wall(), ("pixels", "depth"), supersampling=5)


def test_a_missing_key_is_named():
    with pytest.raises(ValueError, match="has no pixels/deep: in place of 'deep' it has .*depth"):
        StereoDepth(Wall(), ("pixels", "deep"))
    with pytest.raises(ValueError, match="has no pixels/paint"):
        StereoDepth(Wall(), ("pixels", "depth"), color=("pixels", "paint"))
    with pytest.raises(ValueError, match="give one of them"):
        StereoDepth(Wall(), ("pixels", "depth"), metres=np.asarray, rendered=lambda env: None)
    with pytest.raises(ValueError, match="fovy_deg is 200"):
        StereoDepth(Wall(), ("pixels", "depth"), fovy_deg=200.0)


def test_lerobots_own_libero_is_measured():
    """On a table that fills most of the picture the camera errs by less than two codes of 2 m / 255."""
    if not os.path.exists(os.path.join(os.environ.get("LIBERO_CONFIG_PATH", ""), "config.yaml")):
        pytest.skip("LIBERO_CONFIG_PATH names no folder of LIBERO's config.yaml (pip install 'lerobot[libero]')")
    from activestereo.integrations.lerobot import LiberoStereo

    config = LiberoStereo("libero_spatial", task_ids=[0], observation_height=HEIGHT, observation_width=HEIGHT)
    envs = config.create_envs(1)["libero_spatial"][0]
    depth = envs.reset(seed=[3])[0]["pixels"]["depth"][0, ..., 0]
    truth_m = config._rendered(envs.envs[0].env)[::-1]
    near = (depth > 0) & (truth_m < 1.9)
    assert near.mean() > 0.5
    assert np.median(np.abs(config.depth_white_m / 255 * depth[near] - truth_m[near])) < 0.016


class Libero(Wall):
    """LeRobot's LiberoEnv in what matters here (envs/libero.py): colours upside down, no depth, robosuite inside."""

    observation_space = gymnasium.spaces.Dict({
        "pixels": gymnasium.spaces.Dict({"image": gymnasium.spaces.Box(0, 255, (HEIGHT, WIDTH, 3), np.uint8)})
    })  # fmt: skip
    observation_width, observation_height = WIDTH, HEIGHT

    def reset(self, *, seed=None, options=None):
        self._env = types.SimpleNamespace(env=types.SimpleNamespace(sim=self))
        return self.seen(), {}

    def render(self, width, height, camera_name, depth):
        """robosuite's sim.render(): upside down, the lower half is nearer."""
        assert (width, height, camera_name, depth) == (WIDTH, HEIGHT, "agentview", True)
        return None, np.where(np.arange(HEIGHT)[:, None] < HEIGHT // 2, 0.75, 1.0) * np.ones((HEIGHT, WIDTH))

    def seen(self):
        return {"pixels": {"image": np.full((HEIGHT, WIDTH, 3), 160, np.uint8)}}


@dataclass
class LiberoConfig:
    """envs/configs.py of LeRobot's main, November 2026."""

    task: str = "libero_10"
    observation_height: int = HEIGHT
    observation_width: int = WIDTH
    camera_name_mapping: dict | None = None
    features: dict = field(default_factory=dict)
    features_map: dict = field(default_factory=dict)

    def __post_init__(self):
        pass

    def create_envs(self, n_envs, use_async_envs=False):
        mode = gymnasium.vector.AutoresetMode.NEXT_STEP
        return {self.task: {4: gymnasium.vector.SyncVectorEnv([Libero] * n_envs, autoreset_mode=mode)}}


def test_lerobot_evaluates_on_measured_depth(monkeypatch):
    """envs/utils.py, preprocess_observation(): bytes, and fewer channels than rows and columns."""
    registered = {}
    published = {
        "lerobot.configs.types": {"FeatureType": types.SimpleNamespace(VISUAL="v"), "PolicyFeature": lambda *of: of},
        "lerobot.envs.configs": {"LiberoEnv": LiberoConfig, "EnvConfig": types.SimpleNamespace(
            register_subclass=lambda name: lambda kind: registered.setdefault(name, kind))},
        "robosuite.utils.camera_utils": {"get_real_depth_map": lambda sim, buffer: DISTANCE_M * buffer},
    }  # fmt: skip
    for name, content in published.items():
        parents = name.split(".")[:-1]
        for module in [".".join(parents[: n + 1]) for n in range(len(parents))] + [name]:
            monkeypatch.setitem(sys.modules, module, types.ModuleType(module))
        vars(sys.modules[name]).update(content)
    monkeypatch.setitem(sys.modules, "gymnasium", gymnasium)
    monkeypatch.delitem(sys.modules, "activestereo.integrations.lerobot", raising=False)
    importlib.import_module("activestereo.integrations.lerobot")
    config = registered["libero_stereo"]("libero_goal")
    for fault in ({"depth_camera": "agentveiw"}, {"depth_white_m": 0.0}):
        with pytest.raises(ValueError, match=next(iter(fault))):
            registered["libero_stereo"]("libero_goal", **fault)
    assert config.features["pixels/depth"] == ("v", (HEIGHT, WIDTH, 3))
    assert config.features_map["pixels/depth"] == "observation.images.depth"
    envs = config.create_envs(2, use_async_envs=True)["libero_goal"][4].envs
    assert len(envs) == 2
    seen, _ = envs[0].reset(seed=3)
    assert envs[0].observation_space.contains(seen) and set(seen["pixels"]) == {"image", "depth"}
    for image in seen["pixels"].values():
        height, width, channels = image.shape
        assert image.dtype == np.uint8 and channels < height and channels < width and image.flags.c_contiguous
    depth = seen["pixels"]["depth"][..., 0]
    for half, distance_m in ((depth[: HEIGHT // 2 - 12], 0.75 * DISTANCE_M), (depth[HEIGHT // 2 + 12 :], DISTANCE_M)):
        assert np.median(half[half > 0]) == pytest.approx(255 * distance_m / config.depth_white_m, abs=2)
    with pytest.raises(ValueError, match="give color"):
        StereoDepth(Libero(), ("pixels", "depth"), rendered=lambda env: None)


def test_robosuites_depth_buffer_becomes_measured_depth(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")
    robosuite = pytest.importorskip(
        "robosuite", "1.5", reason="robosuite 1.5 is not installed (pip install robosuite 'mujoco<4' h5py)"
    )
    from robosuite.utils.camera_utils import get_real_depth_map
    from robosuite.wrappers import GymWrapper

    scene = robosuite.make(
        "Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=True, camera_names="agentview",
        camera_heights=HEIGHT, camera_widths=WIDTH, camera_depths=True, hard_reset=False,
    )  # fmt: skip
    own = GymWrapper(scene, keys=["agentview_image", "agentview_depth"], flatten_obs=False)
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
