# SPDX-License-Identifier: Apache-2.0
from activestereo.camera.presets import StereoDepthSensorConfig as StereoDepthSensorConfig
from activestereo.capture.capture import Capture as Capture
from activestereo.capture.capture import read_capture as read_capture
from activestereo.common.pose import Pose as Pose
from activestereo.compare.compare import Comparison as Comparison
from activestereo.diagnose.diagnosis import Diagnosis as Diagnosis
from activestereo.lab import Lab as Lab
from activestereo.model.model import SensorModel as SensorModel
from activestereo.model.read import read_model as read_model
from activestereo.model.write import write_model as write_model
from activestereo.report.write import write_report as write_report
from activestereo.scene_io.scene_files import load_scene_file as load_scene_file
from activestereo.sensor.batch import StereoDepthSensorBatch as StereoDepthSensorBatch
from activestereo.sensor.gbuffer.stereo import GBufferStereo as GBufferStereo
from activestereo.sensor.mounts import Mount as Mount
from activestereo.sensor.mounts import Mounts as Mounts
from activestereo.sensor.sensor import StereoDepthSensor as StereoDepthSensor

__version__: str
