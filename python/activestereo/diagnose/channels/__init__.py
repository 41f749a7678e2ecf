# SPDX-License-Identifier: Apache-2.0
"""Channels: the kinds of data that effects are judged on. Each channel is one class that says which effects it judges
and explains them."""

from activestereo.diagnose.channels.channel import JudgingChannel, Progress
from activestereo.diagnose.channels.depth_engine import DepthEngineChannel
from activestereo.diagnose.channels.expected_image import ExpectedImageChannel
from activestereo.diagnose.channels.noise_model import NoiseModelChannel
from activestereo.diagnose.channels.static_field import StaticFieldChannel

__all__ = [
    "DepthEngineChannel",
    "ExpectedImageChannel",
    "JudgingChannel",
    "NoiseModelChannel",
    "Progress",
    "StaticFieldChannel",
]
