# SPDX-License-Identifier: Apache-2.0
"""The place between pixels of a maximum that was found at a pixel."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", float, NDArray[np.float64])


def vertex(before: Number, middle: Number, after: Number) -> Number:
    """Offset in pixels, from the middle, of the vertex of a parabola through three pixels. The middle pixel is the
    largest."""
    return 0.5 * (before - after) / np.minimum(before - 2.0 * middle + after, -1e-12)
