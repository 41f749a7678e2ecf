# SPDX-License-Identifier: Apache-2.0
"""What effects are judged on. Each channel is one class that says which effects it judges and explains them."""

from activestereo.lab.diagnose.channels.channel import JudgingChannel, Progress
from activestereo.lab.diagnose.channels.depth_engine import DepthEngineChannel
from activestereo.lab.diagnose.channels.expected_image import ExpectedImageChannel
from activestereo.lab.diagnose.channels.noise_law import NoiseLawChannel
from activestereo.lab.diagnose.channels.static_field import StaticFieldChannel

__all__ = [
    "DepthEngineChannel",
    "ExpectedImageChannel",
    "JudgingChannel",
    "NoiseLawChannel",
    "Progress",
    "StaticFieldChannel",
]
