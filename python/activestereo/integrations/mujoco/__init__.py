# SPDX-License-Identifier: Apache-2.0
"""Simulates a depth sensor in MuJoCo: the scene comes from the model, poses from the state. Needs the package
mujoco."""

from activestereo.integrations.mujoco.scene import MujocoMount as MujocoMount
from activestereo.integrations.mujoco.scene import MujocoScene as MujocoScene
