# SPDX-License-Identifier: Apache-2.0
"""Holds rendered images of one camera. Exposure, power and scales are applied to them without a new render."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from activestereo.effects.core.resample import SupersampledImages


@dataclass(frozen=True)
class Layers:
    """One camera's images of light and geometry, float32 [height][width] unless stated. Radiance is the mean over the
    pixel's square.

    direct, indirect: the projector's light at power 1, after one reflection and after more; flat: `direct` under a
    pattern that is 1 everywhere, NaN in frames under a model; ambient: under uniform radiance 1 from all directions.
    depth_m: z, 0 = nothing hit; normal: [height][width][3], world frame; material: uint32. ambient_direct: the part of
    `ambient` that is reflected once, or None. supersampled: the finer and wider images (direct, indirect, ambient,
    flat) of which the pixels are means, or None.
    """

    direct: np.ndarray
    indirect: np.ndarray
    ambient: np.ndarray
    flat: np.ndarray
    depth_m: np.ndarray
    normal: np.ndarray
    material: np.ndarray
    ambient_direct: np.ndarray | None = None
    supersampled: SupersampledImages | None = None

    @property
    def projector(self) -> np.ndarray:
        return self.direct + self.indirect
