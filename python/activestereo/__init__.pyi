from activestereo.pose import Pose as Pose
from activestereo.presets import StereoDepthSensorConfig as StereoDepthSensorConfig
from activestereo.sensor import Mount as Mount
from activestereo.sensor import StereoDepthSensor as StereoDepthSensor
