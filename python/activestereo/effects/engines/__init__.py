# SPDX-License-Identifier: Apache-2.0
"""Applies effects to the inputs of kuafu and simsense, and renders a capture's images under them.

images = CaptureRenderer().expected(read_capture("captures/table"), model, nuisances)          # {(frame id, side): DN}
"""

from activestereo.effects.engines.capture_inputs import SceneMeasurement
from activestereo.effects.engines.capture_renderer import CaptureRenderer

__all__ = ["CaptureRenderer", "SceneMeasurement"]
