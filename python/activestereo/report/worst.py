# SPDX-License-Identifier: Apache-2.0
"""Picks the frame that a report shows first, and computes its residual and the residual's colour scale."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from activestereo.capture.capture import Capture, ImageKey

# The colour scale keeps white noise pale, and spans all but a few pixels of the residual.
_NOISE_FLOORS, _SPANNED = 4.0, 0.995


def worst_frame(scores: dict[str, Any], split: str) -> dict[str, Any]:
    """Returns the entry of scores["frames"] in `split` whose infrared error is furthest above the noise floor, or
    largest without floors."""
    entries = [e for e in scores["frames"] if e["split"] == split]
    return max(
        entries, key=lambda e: (e["rmse_dn"] if e["explainable_rmse_dn"] is None else e["explainable_rmse_dn"]) or 0.0
    )


def known_residual(
    capture: Capture, key: ImageKey, measured: Mapping[ImageKey, NDArray], expected: Mapping[ImageKey, NDArray]
) -> NDArray[np.float64]:
    """Returns measured minus expected DN [height][width], NaN at pixels whose scene is unknown; the report's figures
    leave them out too."""
    residual = measured[key].astype(np.float64) - expected[key]
    known = capture.known(next(f for f in capture.frames if f.id == key[0]), key[1])
    return residual if known is None else np.where(known, residual, np.nan)


def rmse(residual: NDArray[np.float64]) -> float:
    """Returns the root mean square of the pixels that are not NaN."""
    return float(np.sqrt(np.nanmean(residual**2)))


def residual_limit(residual: NDArray[np.float64], floor_dn: float | None) -> float:
    """Returns the DN at both ends of a residual's colour scale. floor_dn: the noise floor, or None."""
    spanned = float(np.nanquantile(np.abs(residual), _SPANNED))
    return max(_NOISE_FLOORS * (floor_dn or 0.0), spanned, 1e-3)
