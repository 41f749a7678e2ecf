# SPDX-License-Identifier: Apache-2.0
"""The task of grasping by depth: activestereo/StereoGrasp-v0 for Gymnasium, and its world without it."""

from stereo_grasp.world import GraspWorld as GraspWorld
from stereo_grasp.world import teacher as teacher

try:
    from stereo_grasp.env import StereoGraspEnv as StereoGraspEnv
    from stereo_grasp.env import StereoGraspVectorEnv as StereoGraspVectorEnv
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
