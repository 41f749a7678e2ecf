# SPDX-License-Identifier: Apache-2.0
"""Finds the maximum of sampled values between two pixels."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", float, NDArray[np.float64])


def vertex(before: Number, middle: Number, after: Number) -> Number:
    """Computes the offset, in pixels from the middle one, of the vertex of a parabola through three neighbouring
    pixels' values. The middle value must be the largest."""
    return 0.5 * (before - after) / np.minimum(before - 2.0 * middle + after, -1e-12)
