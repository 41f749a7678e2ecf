# SPDX-License-Identifier: Apache-2.0
"""The error of a found pose, and the criteria of success."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim_to_real.objects import BenchmarkObject

# Criteria of success: (mm, degrees), as in the tables of BOP and the paper.
CRITERIA = ((10.0, 10.0), (20.0, 20.0))


def pose_error(
    found: NDArray[np.float64] | None, true: NDArray[np.float64], thing: BenchmarkObject
) -> tuple[float, float]:
    """(mm, degrees) between two poses of an object, up to its symmetry; infinite if no pose was found."""
    if found is None or not np.isfinite(found).all():
        return float("inf"), float("inf")
    offset_mm = 1000.0 * float(np.linalg.norm(found[:3, 3] - true[:3, 3]))
    candidates = true[:3, :3] @ thing.turns
    if thing.is_round:
        cosines = candidates[:, :, 2] @ found[:3, 2]
    else:
        cosines = 0.5 * (np.einsum("nij,ij->n", candidates, found[:3, :3]) - 1.0)
    return offset_mm, float(np.degrees(np.arccos(np.clip(cosines.max(), -1.0, 1.0))))


def successes(errors: NDArray[np.float64], criterion: tuple[float, float]) -> NDArray[np.bool_]:
    """[...] of errors [..., 2], mm and degrees: both below the criterion's."""
    return np.asarray((errors[..., 0] < criterion[0]) & (errors[..., 1] < criterion[1]))
