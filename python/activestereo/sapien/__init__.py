# SPDX-License-Identifier: Apache-2.0
"""SAPIEN 3's StereoDepthSensor on a live SAPIEN scene, without CUDA and without SAPIEN's renderer. Needs the package
sapien.

    from activestereo.sapien import StereoDepthSensor, StereoDepthSensorConfig  # in place of sapien.sensor's
"""

from activestereo.sapien.builder import ActorBuilder as ActorBuilder
from activestereo.sapien.builder import VisualRecords as VisualRecords
from activestereo.sapien.scene import SapienScene as SapienScene
from activestereo.sapien.sensor import StereoDepthSensor as StereoDepthSensor
from activestereo.sapien.sensor import StereoDepthSensorConfig as StereoDepthSensorConfig
