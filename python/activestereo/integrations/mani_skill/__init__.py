# SPDX-License-Identifier: Apache-2.0
"""Replaces the depth cameras of ManiSkill 3 environments by active stereo sensors. Needs the package mani_skill.

    import activestereo.integrations.mani_skill
    env = gymnasium.make("PickCube-v1", obs_mode="rgb+depth", sensor_configs={"use_stereo_depth": True})

ManiSkill has no register of sensors: its environments make a `StereoDepthCamera` for each `StereoDepthCameraConfig`.
The import replaces ManiSkill's classes of these names, which need CUDA and SAPIEN 2.
"""

import mani_skill.envs.sapien_env
import mani_skill.sensors.depth_camera

from activestereo.integrations.mani_skill.camera import StereoDepthCamera as StereoDepthCamera
from activestereo.integrations.mani_skill.camera import StereoDepthCameraConfig as StereoDepthCameraConfig
from activestereo.integrations.mani_skill.world import ManiSkillWorld as ManiSkillWorld

mani_skill.envs.sapien_env.StereoDepthCamera = StereoDepthCamera
mani_skill.sensors.depth_camera.StereoDepthCamera = StereoDepthCamera
mani_skill.sensors.depth_camera.StereoDepthCameraConfig = StereoDepthCameraConfig
