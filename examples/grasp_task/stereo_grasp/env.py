# SPDX-License-Identifier: Apache-2.0
"""activestereo/StereoGrasp-v0 for Gymnasium: one environment, or many with one render (gymnasium.make_vec)."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from stereo_grasp.world import GraspWorld

ID = "activestereo/StereoGrasp-v0"
_FARTHEST_M = 1.0


def _spaces(size_px: int) -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    depth = gymnasium.spaces.Box(0.0, _FARTHEST_M, (size_px, size_px, 1), np.float32)
    return depth, gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float32)


def _observed(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.clip(depth, 0.0, _FARTHEST_M, dtype=np.float32)[..., None]


class StereoGraspEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Observation: the wrist's depth, float32 [size, size, 1] metres, 0 = no measurement. Action: dx, dy, dz, dtheta in
    -1..1. Ends after 10 steps; the reward is then 1 for a grasp. mode: one of depth_modes.MODES. others: as GraspWorld
    has them."""

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, mode: str = "full", size_px: int = 64, **others: Any) -> None:
        self.world = GraspWorld(1, mode, size_px, **others)
        self.observation_space, self.action_space = _spaces(size_px)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        super().reset(seed=seed)
        return _observed(self.world.reset(seed=seed))[0], {"state": self.world.offsets()[0]}

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        ended, succeeded = self.world.step(np.asarray(action)[None])
        info = {"state": self.world.offsets()[0], "success": bool(succeeded[0])}
        return _observed(self.world.look())[0], float(succeeded[0]), bool(ended[0]), False, info


class StereoGraspVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """The same in num_envs environments: one render and one match a step. An environment that has ended begins again at
    the next step, whose action it ignores."""

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int = 1, mode: str = "full", size_px: int = 64, **others: Any) -> None:
        self.num_envs = num_envs
        self.world = GraspWorld(num_envs, mode, size_px, **others)
        self.single_observation_space, self.single_action_space = _spaces(size_px)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        if isinstance(seed, list):
            raise ValueError("the environments share one seed: give a number, not a list")
        super().reset(seed=seed)
        self._ended[:] = False
        return _observed(self.world.reset(seed=seed)), {"state": self.world.offsets()}

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        restarted = self._ended.copy()
        ended, succeeded = self.world.step(actions)
        if restarted.any():
            depth = self.world.reset(restarted)
            ended, succeeded = ended & ~restarted, succeeded & ~restarted
        else:
            depth = self.world.look()
        self._ended = ended
        info = {"state": self.world.offsets(), "success": succeeded}
        return _observed(depth), succeeded.astype(np.float64), ended, np.zeros(self.num_envs, bool), info


gymnasium.register(
    ID,
    entry_point="stereo_grasp.env:StereoGraspEnv",
    vector_entry_point="stereo_grasp.env:StereoGraspVectorEnv",
)
