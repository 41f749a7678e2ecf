# SPDX-License-Identifier: Apache-2.0
"""Computes the mean and standard deviation of images in a window around each pixel."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter


def mean_and_deviation(
    images: NDArray[Any], window: tuple[int, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (mean, standard deviation) of each pixel's window. Borders repeat the edge pixels. window: its size along
    each axis of `images`."""
    values = np.asarray(images, np.float64)
    mean = uniform_filter(values, window, mode="nearest")
    return mean, np.sqrt(np.maximum(uniform_filter(values**2, window, mode="nearest") - mean**2, 0.0))
