# SPDX-License-Identifier: Apache-2.0
"""Isaac Lab 3: all cameras of a task measure depth as a D435 does. One file to paste beside a task:

    from isaac_lab import with_stereo_depth
    env = gymnasium.make(TASK, cfg=with_stereo_depth(parse_env_cfg(TASK)))

'depth' is measured, 0 where there is none; 'distance_to_image_plane' stays the truth. Cameras look from the left
infrared camera's place.
"""

from typing import Any

from activestereo.integrations.gbuffers.isaac_lab import NEEDS, ActiveStereoRendererCfg
from isaaclab.sensors import CameraCfg


def with_stereo_depth(env_cfg: Any, camera: str = "D435", seed: int = 0, supersampling: int = 1) -> Any:
    """The task's configuration with such cameras; ValueError where it has none. camera: a preset's name or a camera's
    .toml file. supersampling: of ActiveStereoRendererCfg."""
    own = {"camera": camera, "seed": seed, "supersampling": supersampling}
    parts = [*vars(env_cfg.scene).values(), *vars(env_cfg).values()]  # direct tasks have their camera beside the scene
    cameras = [part for part in parts if isinstance(part, CameraCfg)]
    if not cameras:
        raise ValueError("the task has no camera: add a CameraCfg with a renderer")
    for cfg in cameras:
        cfg.update_latest_camera_pose = True  # else normals are turned by the pose that a wrist had at the start
        cfg.data_types = [*dict.fromkeys([*cfg.data_types, *NEEDS])]
        cfg.renderer_cfg = ActiveStereoRendererCfg(source=cfg.renderer_cfg, **own)
    return env_cfg
