# SPDX-License-Identifier: Apache-2.0
"""The depth sensor. One engine (engine.py) renders and matches; StereoDepthSensor (sensor.py) and
StereoDepthSensorBatch (batch.py) are its public interfaces."""
