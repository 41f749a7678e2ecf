# SPDX-License-Identifier: Apache-2.0
"""Infrared images of one's own, checked before the depth engine takes them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Pair = tuple[NDArray[np.float32], NDArray[np.float32]]


def checked_radiance(
    left: ArrayLike, right: ArrayLike, left_laser: ArrayLike | None, right_laser: ArrayLike | None,
    shape: tuple[int, ...],
) -> tuple[Pair, dict[str, NDArray[np.float32]]]:  # fmt: skip
    """((left, right), keyword arguments of simsense.Engine.compute for the laser's part), float32 of this shape. Raises
    ValueError with the image, the place and the value that is no radiance."""
    if (left_laser is None) != (right_laser is None):
        raise ValueError("left_laser and right_laser come together, or not at all: then all light has speckle")
    pair = _checked("left", left, shape), _checked("right", right, shape)
    if left_laser is None or right_laser is None:
        return pair, {}
    lasers = ("left_laser", left_laser), ("right_laser", right_laser)
    return pair, {name: _checked(name, image, shape) for name, image in lasers}


def _checked(name: str, image: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float32]:
    values = np.ascontiguousarray(image, np.float32)
    if values.shape != shape:
        raise ValueError(f"{name} is {list(values.shape)}, expected {list(shape)} of W/(sr m^2)")
    is_light = np.isfinite(values) & (values >= 0.0)
    if not is_light.all():
        place = np.unravel_index(int(np.argmin(is_light)), shape)
        where = ", ".join(str(int(i)) for i in place)
        raise ValueError(f"{name}[{where}] is {values[place]}, expected a radiance of 0 or more")
    return values
