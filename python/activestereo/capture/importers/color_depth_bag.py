# SPDX-License-Identifier: Apache-2.0
"""Reads bags of depth and colour without infrared streams, as librealsense's own samples are. Depth is in the depth
camera's image, or is realsense-ros' depth aligned to colour."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from activestereo.capture.capture import Camera, ColorCamera
from activestereo.capture.images import write_gray
from activestereo.capture.importers.bag import (
    IMAGES,
    ROS2_DEPTH_SCALE_M,
    depth_units_of,
    intrinsic_of,
    messages,
    pixels_of,
    place_of,
    stream_of,
    topics,
)
from activestereo.capture.importers.color_depth import ColorDepthFrame, ColorDepthRecording, nearest
from activestereo.capture.importers.realsense_text import INFRARED
from activestereo.common.output_files import write_png

_WITHIN_S = 0.02
_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4}
# Two bytes a pixel: librealsense's names and ROS' (sensor_msgs/image_encodings.hpp).
_YUV = {
    "yuyv": cv2.COLOR_YUV2RGB_YUYV, "yuv422_yuy2": cv2.COLOR_YUV2RGB_YUYV, "uyvy": cv2.COLOR_YUV2RGB_UYVY,
    "yuv422": cv2.COLOR_YUV2RGB_UYVY,
}  # fmt: skip


def has_color_depth_alone(path: Path) -> bool:
    """Returns whether a bag has depth but no infrared stream. Raises ValueError if it cannot be read."""
    streams = {stream_of(topic) for topic, kind in topics(path) if kind in IMAGES}
    return not streams & set(INFRARED) and bool(streams & {"Depth", "Aligned"})


def read_color_depth_bag(
    path: Path, folder: Path, K: NDArray[np.float64] | None = None, depth_scale: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> ColorDepthRecording:  # fmt: skip
    """Writes a bag's images into `folder` and returns them as a recording. K and depth_scale override the bag's. Raises
    ValueError, one line, with the bag and the missing part, also without rosbags."""
    there = {stream_of(topic) for topic, kind in topics(path) if kind in IMAGES}
    depth_stream = "Depth" if "Depth" in there else "Aligned"
    lenses: dict[str, Camera] = {}
    places: dict[str, NDArray[np.float64]] = {}  # from the device's first stream
    files: dict[str, dict[float, Path]] = {depth_stream: {}, "Color": {}}
    units_m: float | None = None
    for topic, message, time_ms, share in messages(path, streams=(depth_stream, "Color")):
        stream, kind = stream_of(topic), type(message).__name__
        if kind.endswith(("sensor_msgs__msg__Image", "CompressedImage")) and stream in files:
            file = folder / f"{stream} {time_ms:.3f}.png"
            if stream == "Color":
                write_png(file, _color_pixels(path, topic, message))
            else:
                write_gray(file, pixels_of(path, topic, message))
                units_m = units_m or (None if topic.startswith("/device_") else ROS2_DEPTH_SCALE_M)
            files[stream][1e-3 * time_ms] = file
        elif (told := depth_units_of(topic, message)) is not None:
            units_m = told
        elif kind.endswith("CameraInfo") and stream is not None:
            lenses.setdefault(stream, intrinsic_of(path, topic, message))
        elif stream is not None and (place := place_of(path, topic, message)) is not None:
            places.setdefault(stream, place)
        if progress is not None:
            progress(share)
    depths, colors = files[depth_stream], files["Color"]
    if not depths:
        raise ValueError(f"{path}: Depth: its topic has no images: record depth")
    if K is None and depth_stream not in lenses:
        raise ValueError(f"{path}: Depth: no camera_info topic: give --k FX,FY,CX,CY, or record it")
    scale = depth_scale or units_m
    if scale is None:
        raise ValueError(f"{path}: depth scale: is not in it: give --depth-scale, often 0.001")
    frames = []
    for time_s, depth in depths.items():
        at = nearest(colors, time_s, _WITHIN_S)
        frames.append(ColorDepthFrame(time_s, depth, None if at is None else colors[at], scale))
    own = lenses[depth_stream].K if K is None else K
    color, lens, assumed = None, lenses.get("Color"), []
    if depth_stream != "Aligned" and lens is not None:
        # Without a transform colour stands in the depth camera's place.
        to_depth = places.get(depth_stream, np.eye(4))
        depth_to_color = places.get("Color", to_depth) @ np.linalg.inv(to_depth)
        color = ColorCamera(lens.width, lens.height, lens.K, lens.distortion, depth_to_color)
    if colors and depth_stream != "Aligned" and "Color" not in places:
        assumed.append("colour is seen from depth's place: the bag has no transform of it")
    if colors and depth_stream != "Aligned" and color is None:
        assumed.append("colour lies on depth's pixels: the bag has no camera_info of it")
    return ColorDepthRecording(path, "a bag", own, tuple(frames), color=color, assumed=tuple(assumed))


def _color_pixels(path: Path, topic: str, message: Any) -> NDArray[np.uint8]:
    """Decodes a colour image message as RGB, uint8 [height, width, 3]."""
    content = np.asarray(message.data, np.uint8)
    if hasattr(message, "format"):
        try:
            return np.asarray(Image.open(io.BytesIO(content.tobytes())).convert("RGB"))
        except (OSError, SyntaxError) as error:
            raise ValueError(f"{path}: {topic}: a compressed image is damaged: {error}") from error
    name, size = message.encoding.lower(), (message.height, message.width)
    depth = 2 if name in _YUV else _CHANNELS.get(name, 1)
    if depth == 1 and name not in ("mono8", "8uc1", "y8"):
        known = ", ".join([*_CHANNELS, *_YUV, "mono8"])
        raise ValueError(f"{path}: {topic}: encoding is '{message.encoding}', expected one of {known}")
    if message.step < depth * message.width or content.size != message.step * message.height:
        raise ValueError(f"{path}: {topic}: {content.size} bytes do not fill {message.width}x{message.height}")
    pixels = content.reshape(message.height, message.step)[:, : depth * message.width].reshape(*size, depth)
    if name in _YUV:
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), _YUV[name]), np.uint8)
    if depth == 1:
        return np.repeat(pixels, 3, axis=2)
    return np.ascontiguousarray(pixels[..., 2::-1] if name.startswith("bgr") else pixels[..., :3])
