# SPDX-License-Identifier: Apache-2.0
"""The engines under a model: what effects make of kuafu's and simsense's inputs, and images that the engines then give.

renderer = CaptureRenderer(read_capture("captures/table"))
images = renderer.expected(model, nuisances)          # {(frame id, side): DN}
"""

from activestereo.effects.engines.capture_renderer import CameraLight, CaptureRenderer
from activestereo.effects.engines.scene_measurement import SceneMeasurement

__all__ = ["CaptureRenderer", "CameraLight", "SceneMeasurement"]
