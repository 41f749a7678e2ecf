# SPDX-License-Identifier: Apache-2.0
"""One measured image while an effect is put into it: its light, and the variance of the noise that it carries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Light:
    """value: DN above the black level, [height][width]. variance: DN^2 of the noise in it."""

    value: Image
    variance: Image

    def scaled(self, factor: Image | float) -> Light:
        """The light times a factor per pixel, its noise too."""
        return Light(self.value * factor, self.variance * np.square(factor))


@dataclass(frozen=True)
class View:
    """The conditions of an image. time_s: of the frame's middle row; row_time_s: from one row to the next; max_dn: full
    scale above the black level; depth: z of this camera in metres, 0 = unknown, None if the frame has none."""

    K: NDArray[np.float64]
    is_right: bool
    time_s: float
    row_time_s: float
    max_dn: float
    depth: Image | None
    camera_to_projector: NDArray[np.float64]
    projector_K: NDArray[np.float64]
    projector_size: tuple[int, int]
    temporal: np.random.Generator  # this image's own
    static: np.random.Generator  # the same in all images of the capture

    def rays(self, shape: tuple[int, ...]) -> tuple[Image, Image]:
        """Ray slopes (x / z, y / z) through the pixels' centres."""
        v, u = np.indices(shape, dtype=np.float64)
        y = (v - self.K[1, 2]) / self.K[1, 1]
        return (u - self.K[0, 2] - self.K[0, 1] * y) / self.K[0, 0], y
