# SPDX-License-Identifier: Apache-2.0
"""LeRobot (0.5 and newer) evaluates a policy on LIBERO with depth as an active stereo camera measures it:

    lerobot-eval --env.discover_packages_path=activestereo.integrations.lerobot --env.type=libero_stereo \\
        --env.task=libero_spatial --env.stereo=D435 --policy.path=...

The policy gets observation.images.depth beside the colour images, in their orientation: bytes, equal in three channels.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig, LiberoEnv
from numpy.typing import NDArray

from activestereo.common.limits import Limits
from activestereo.common.shown import require_known
from activestereo.integrations.gymnasium import StereoDepth

_WHITE = Limits(0.01, 100.0, "m")
FOVY_DEG = {"agentview": 45.0, "robot0_eye_in_hand": 75.0}  # LIBERO's arenas, robosuite's Panda


@EnvConfig.register_subclass("libero_stereo")
@dataclass
class LiberoStereo(LiberoEnv):
    """Configures LIBERO with measured depth. stereo: a preset's name or a camera's .toml file. depth_camera: a key of
    FOVY_DEG, whose colour image is observed, too. depth_white_m: depth in metres coded as 255; 0 codes no measurement.
    Environments run one after another."""

    stereo: str = "D435"
    depth_camera: str = "agentview"
    depth_white_m: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_known("depth_camera", [self.depth_camera], FOVY_DEG)
        _WHITE.check("depth_white_m", self.depth_white_m)
        size = self.observation_height, self.observation_width
        self.features["pixels/depth"] = PolicyFeature(FeatureType.VISUAL, (*size, 3))
        self.features_map["pixels/depth"] = "observation.images.depth"

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, dict[int, Any]]:
        groups = super().create_envs(n_envs, use_async_envs=False)
        return {suite: {task: self._measured(made) for task, made in group.items()} for suite, group in groups.items()}

    def _measured(self, made: gymnasium.vector.SyncVectorEnv) -> gymnasium.vector.SyncVectorEnv:
        name = f"{self.depth_camera}_image"
        names = self.camera_name_mapping or {"agentview_image": "image", "robot0_eye_in_hand_image": "image2"}
        depth_of = partial(
            StereoDepth, depth=("pixels", "depth"), color=("pixels", names[name]), fovy_deg=FOVY_DEG[self.depth_camera],
            camera=self.stereo, back=lambda z: z[::-1], rendered=self._rendered, coded=self._coded,
        )  # fmt: skip
        envs = [partial(depth_of, env) for env in made.envs]
        return gymnasium.vector.SyncVectorEnv(envs, autoreset_mode=made.metadata["autoreset_mode"])

    def _rendered(self, env: gymnasium.Env) -> NDArray[Any]:
        from robosuite.utils.camera_utils import get_real_depth_map

        libero: Any = env.unwrapped
        sim, size = libero._env.env.sim, (libero.observation_width, libero.observation_height)
        buffer = sim.render(*size, camera_name=self.depth_camera, depth=True)[1]
        return np.asarray(get_real_depth_map(sim, buffer))[::-1]

    def _coded(self, depth_m: NDArray[np.float32]) -> NDArray[np.uint8]:
        code = (255 * np.clip(depth_m / self.depth_white_m, 0.0, 1.0)).astype(np.uint8)
        return np.repeat(code[..., None], 3, axis=2)
