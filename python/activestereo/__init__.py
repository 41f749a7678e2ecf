"""activestereo: simulated active stereo depth sensors (RealSense-like), from a scene file to a depth map.

    from activestereo import StereoDepthSensor, StereoDepthSensorConfig

    sensor = StereoDepthSensor(StereoDepthSensorConfig("D435"), "table_top.gltf")
    sensor.take_picture()
    sensor.compute_depth()
    depth_m = sensor.get_depth()  # float32, registered to the RGB camera, 0 = no measurement
"""

from activestereo.pose import Pose
from activestereo.presets import StereoDepthSensorConfig
from activestereo.sensor import Mount, StereoDepthSensor

__all__ = ["Mount", "Pose", "StereoDepthSensor", "StereoDepthSensorConfig"]
