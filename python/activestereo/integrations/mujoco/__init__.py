# SPDX-License-Identifier: Apache-2.0
"""A depth sensor in MuJoCo: the scene from the model, the poses from the state. Needs the package mujoco."""

from activestereo.integrations.mujoco.scene import MujocoMount as MujocoMount
from activestereo.integrations.mujoco.scene import MujocoScene as MujocoScene
