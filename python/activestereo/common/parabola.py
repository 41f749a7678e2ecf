# SPDX-License-Identifier: Apache-2.0
"""Finds where sampled values are largest, to a fraction of a pixel."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", float, NDArray[np.float64])


def vertex(before: Number, middle: Number, after: Number) -> Number:
    """Returns the position of the top of the parabola through the values of three neighbouring pixels, in pixels from
    the middle one. The middle value must be the largest."""
    return 0.5 * (before - after) / np.minimum(before - 2.0 * middle + after, -1e-12)
