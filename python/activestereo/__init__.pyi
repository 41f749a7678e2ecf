# SPDX-License-Identifier: Apache-2.0
from activestereo.late_sensor import LateStereoDepthSensor as LateStereoDepthSensor
from activestereo.late_sensor_batch import LateStereoDepthSensorBatch as LateStereoDepthSensorBatch
from activestereo.pose import Pose as Pose
from activestereo.presets import StereoDepthSensorConfig as StereoDepthSensorConfig
from activestereo.sensor import Mount as Mount
from activestereo.sensor import StereoDepthSensor as StereoDepthSensor
from activestereo.sensor_batch import Mounts as Mounts
from activestereo.sensor_batch import StereoDepthSensorBatch as StereoDepthSensorBatch
from activestereo.split_sensor_batch import SplitStereoDepthSensorBatch as SplitStereoDepthSensorBatch
