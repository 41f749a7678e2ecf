# SPDX-License-Identifier: Apache-2.0
"""Reads and writes model.json, the file of a SensorModel: all that is known of a sensor. The lab writes it and the
simulator reads it.

    model = read_model("out/diagnosis/model.json")
    sensor = StereoDepthSensor(StereoDepthSensorConfig.from_model(model), "scene.gltf", model=model)
"""

from activestereo.model.diagnosed import diagnosed_model
from activestereo.model.model import Imager, ModelEffect, Pattern, Quantity, Rig, SensorModel
from activestereo.model.read import read_model
from activestereo.model.write import model_json, write_model
