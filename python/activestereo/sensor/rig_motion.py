# SPDX-License-Identifier: Apache-2.0
"""How what stands on a sensor moves while the sensor does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import Pose, camera_to_camera, carried_twist
from activestereo.effects.core.engine import EngineInputs


def twist_of(config: StereoDepthSensorConfig, twist: NDArray[np.float64], pose_in_rgb: Pose) -> NDArray[np.float64]:
    """[2, 3] linear and angular velocity, in its own camera axes, of what stands at this place of the sensor."""
    if not np.any(twist):  # as nearly always; each picture under automatic exposure asks
        return np.zeros((2, 3))
    return carried_twist(camera_to_camera(config.trans_pose_l, pose_in_rgb), twist).reshape(2, 3)


def give_velocity(inputs: EngineInputs, config: StereoDepthSensorConfig, twist: NDArray[np.float64]) -> None:
    """Lets all that is on the rig move as the left camera does; twist as sensor_inputs() has it."""
    for record, place in ((inputs.left.camera, config.trans_pose_l), (inputs.right.camera, config.trans_pose_r)):
        record.linear_velocity, record.angular_velocity = twist_of(config, twist, place)
    for light in ([] if inputs.projector is None else [inputs.projector]) + inputs.rig_lights:
        light.linear_velocity, light.angular_velocity = twist_of(config, twist, config.pose_rgb_irproj)
