# SPDX-License-Identifier: Apache-2.0
"""Framesets of a virtual RealSense without a picture: noisy slanted depth with holes, and random colours."""

import numpy as np

from activestereo.common.pose import rigid_motion
import activestereo.realsense as rs
from activestereo.integrations.realsense.frames import StreamRequest


def profiles(shift_m=-0.015):
    """The profiles of depth and of a colour camera that stands shift_m beside it."""
    lens = rs.intrinsics(64, 48, 31.5, 23.5, 50.0, 50.0, rs.distortion.brown_conrady)
    moved = rigid_motion((shift_m, 0, 0))
    depth = StreamRequest(rs.stream.depth, 0, 64, 48, rs.format.z16, 30)
    color = StreamRequest(rs.stream.color, 0, 64, 48, rs.format.bgr8, 30)
    return rs.video_stream_profile(depth, lens, baseline_m=0.055), rs.video_stream_profile(color, lens, moved)


def frameset(number=1, shift_m=-0.015):
    rng, time_ms = np.random.default_rng(number), 33.0 * number
    depth, color = profiles(shift_m)
    z = np.round(1000 + 200 * np.sin(np.arange(64) / 9)[None] + 3 * np.arange(48)[:, None] + rng.normal(0, 3, (48, 64)))
    z[rng.random(z.shape) < 0.1] = 0
    image = rng.integers(0, 255, (48, 64, 3), np.uint8)
    frames = rs.depth_frame(z.astype(np.uint16), depth, number, time_ms), rs.video_frame(image, color, number, time_ms)
    return rs.composite_frame(frames)
