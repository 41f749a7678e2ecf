# SPDX-License-Identifier: Apache-2.0
"""Open3D's DepthNoiseSimulator, as its file of a distortion model.

The file is that of Redwood's simdepth.py (Choi, Zhou and Koltun, CVPR 2015; Teichman et al., RSS 2013), as Open3D reads
it (t::io::DepthNoiseSimulator): five skipped lines, then a row of 23 numbers for each cell of 8 x 6 pixels of a 640x480
image. Three are not read; five are counts, and a cell is blind if all are below 8000; ten are not read; the last are
divisors of depth at 1, 3, 5, 7 and 9 m. The noise is fixed: 1/36 px in steps of 1/8 px of a camera with 35.13 px m.
Depths in another unit have more of it, so depth_scale, simulate()'s argument, sets its size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.noise_profiles.profile import Profile, Views
from activestereo.sensor.rival_noise import redwood

_FOCAL_BASELINE_PX_M = 35.13
_CELLS, _CELL_PX, _PLANES, _SEEN = 80, 8, 5, 8000


@dataclass(frozen=True)
class Open3D(Profile):
    """zoom: metres of its depth in one of ours. bias_px: in its disparities, given to all cells. blind_cells: columns
    of cells at the left edge that give no depth."""

    FILE = "open3d.txt"
    LACKS = (
        "images of other sizes than 640x480",
        "noise and steps by themselves: both grow with depth_scale",
        "holes, other than cells of 8x6 pixels that never measure",
        "errors that neighbours share, but for pairs of pixels",
    )
    FITTED: ClassVar = {"zoom": (0.2, 20.0, 3.0), "bias_px": (-0.5, 0.5, 0.0)}

    zoom: float = 1.0
    bias_px: float = 0.0
    blind_cells: int = 0

    @classmethod
    def known(cls, views: Views) -> Open3D:
        is_there = (views.truth_m >= views.near_m) & (views.truth_m <= views.far_m)
        holes = 1.0 - (is_there & (views.found_m > 0)).sum(axis=(0, 1)) / np.maximum(is_there.sum(axis=(0, 1)), 1)
        cells = holes[: holes.size // _CELLS * _CELLS].reshape(_CELLS, -1).mean(axis=1) > 0.5
        return cls(blind_cells=int(np.argmin(cells)))

    def apply(self, views: Views, random: np.random.Generator) -> NDArray[np.float32]:
        inner = views.truth_m * np.float32(self.zoom)
        factor = 1.0 + self.bias_px * inner / _FOCAL_BASELINE_PX_M
        inner = (inner / np.maximum(factor, 0.1)).astype(np.float32)
        depth = redwood(inner, _FOCAL_BASELINE_PX_M, random, farthest_m=np.inf) / np.float32(self.zoom)
        depth[..., : self.blind_cells * views.truth_m.shape[2] // _CELLS] = 0.0
        return depth

    def file_text(self, views: Views) -> str:
        factors = 1.0 + self.bias_px * (2.0 * np.arange(_PLANES) + 1.0) / _FOCAL_BASELINE_PX_M
        head = [
            f"% simulate(image, depth_scale={1000.0 / self.zoom:.6g}) of 16-bit depth in millimetres",
            *("%" for _ in range(4)),
        ]
        rows = [self._row(column, factors) for _ in range(_CELLS) for column in range(_CELLS)]
        return "\n".join([*head, *rows, ""])

    def _row(self, column: int, factors: NDArray[np.float64]) -> str:
        seen = 0 if column < self.blind_cells else _SEEN
        return " ".join(["0 0 0", *[str(seen)] * _PLANES, *["0"] * 10, *(f"{factor:.6f}" for factor in factors)])
