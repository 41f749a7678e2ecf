# SPDX-License-Identifier: Apache-2.0
"""The task of grasping by depth: activestereo/StereoGrasp-v0 for Gymnasium, and its world without it."""

from activestereo.benchmarks.grasp.world import GraspWorld as GraspWorld
from activestereo.benchmarks.grasp.world import teacher as teacher

try:
    from activestereo.benchmarks.grasp.env import StereoGraspEnv as StereoGraspEnv
    from activestereo.benchmarks.grasp.env import StereoGraspVectorEnv as StereoGraspVectorEnv
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
