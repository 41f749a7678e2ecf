# SPDX-License-Identifier: Apache-2.0
"""Replaces SAPIEN 3's StereoDepthSensor on a live SAPIEN scene; needs neither CUDA nor SAPIEN's renderer, but the
package sapien.

    from activestereo.integrations.sapien import StereoDepthSensor, StereoDepthSensorConfig  # for sapien.sensor's
"""

from activestereo.integrations.sapien.scene import ActorBuilder as ActorBuilder
from activestereo.integrations.sapien.scene import SapienScene as SapienScene
from activestereo.integrations.sapien.scene import VisualRecords as VisualRecords
from activestereo.integrations.sapien.sensor import StereoDepthSensor as StereoDepthSensor
from activestereo.integrations.sapien.sensor import StereoDepthSensorConfig as StereoDepthSensorConfig
