# SPDX-License-Identifier: Apache-2.0
"""Makes ROS 2 messages for images and their cameras, with any package's message classes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def image_message(make: Callable[..., Any], header: Any, pixels: NDArray[Any], encoding: str) -> Any:
    """Makes a sensor_msgs/msg/Image of pixels [height, width(, channels)]. make(type, **fields): makes a message."""
    return make(
        "sensor_msgs/msg/Image",
        header=header,
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=pixels.shape[1] * pixels[0, 0].nbytes,
        data=np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8),
    )


def camera_info_message(
    make: Callable[..., Any], header: Any, height: int, width: int, k: NDArray[np.float64], distortion: ArrayLike,
    tx: float = 0.0, ty: float = 0.0,
) -> Any:  # fmt: skip
    """Makes a sensor_msgs/msg/CameraInfo. k: [3, 3], pixels. distortion: k1 k2 p1 p2 k3. tx, ty: the last column of P,
    pixels times metres; for a right camera tx is minus the focal length times the baseline. make: as in
    image_message()."""
    region = make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=header,
        height=height,
        width=width,
        distortion_model="plumb_bob",
        d=np.array(distortion, np.float64),
        k=k.ravel(),
        r=np.eye(3).ravel(),
        p=np.hstack([k, [[tx], [ty], [0.0]]]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=region,
    )
