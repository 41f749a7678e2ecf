# SPDX-License-Identifier: Apache-2.0
"""Converts image messages of Gazebo (gz.msgs.Image) and ROS 2 (sensor_msgs/Image): reads those of an RGB-D camera,
writes measured depth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# {Gazebo's number or ROS' name of the format: (NumPy type, channels)}.
_FORMATS: dict[int | str, tuple[str, int]] = {
    1: ("u1", 1), 3: ("u1", 3), 8: ("u1", 3), 4: ("u1", 4), 13: ("f4", 1), 2: ("u2", 1),
    "mono8": ("u1", 1), "rgb8": ("u1", 3), "bgr8": ("u1", 3), "rgba8": ("u1", 4),
    "32FC1": ("f4", 1), "16UC1": ("u2", 1),
}  # fmt: skip


def image_of(message: Any) -> NDArray[Any]:
    """Returns a message's image, [height, width] or [height, width, channels], RGB. Raises ValueError for another
    format."""
    form = getattr(message, "encoding", None) or message.pixel_format_type
    if form not in _FORMATS:
        raise ValueError(f"an image message is of the format {form!r}, expected one of {list(_FORMATS)}")
    kind, channels = _FORMATS[form]
    order = ">" if getattr(message, "is_bigendian", 0) else "<"
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
    pixels = rows[:, : message.width * channels * int(kind[1])].copy().view(order + kind)
    image = pixels.reshape(message.height, message.width, *([channels] if channels > 1 else []))
    return image[..., ::-1] if form in (8, "bgr8") else image


def gazebo_gbuffers(depth: Any, image: Any) -> dict[str, Any]:
    """Converts the messages of one RGB-D camera to GBufferStereo's arguments. The picture's red becomes the albedo, a
    guess of the infrared one; uint16 depth is in millimetres."""
    depth_m, picture = image_of(depth), image_of(image)
    depth_m = depth_m * 1e-3 if depth_m.dtype.kind == "u" else np.nan_to_num(depth_m, nan=0.0, posinf=0.0, neginf=0.0)
    return {"depth": depth_m, "albedo": picture}


def fill_depth(message: Any, depth_m: NDArray[np.float32]) -> None:
    """Writes depth [height, width], metres, into a Gazebo or ROS message, as 32-bit floats."""
    message.height, message.width = depth_m.shape
    message.step, message.data = 4 * depth_m.shape[1], np.ascontiguousarray(depth_m, "<f4").tobytes()
    if hasattr(message, "encoding"):
        message.encoding, message.is_bigendian = "32FC1", 0
    else:
        message.pixel_format_type = 13
