# SPDX-License-Identifier: Apache-2.0
"""Picks the frame to show first, by its error, and says how its residual is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from activestereo.capture.capture import Capture, ImageKey

# White noise stays pale on a residual's scale, and the scale spans the residual but for a few pixels.
_NOISE_FLOORS, _SPANNED = 4.0, 0.995


def worst_frame(scores: dict[str, Any], split: str) -> dict[str, Any]:
    """The entry of scores["frames"] with the infrared error furthest above its floor, or with the largest error without
    floors."""
    entries = [e for e in scores["frames"] if e["split"] == split]
    return max(
        entries, key=lambda e: (e["rmse_dn"] if e["explainable_rmse_dn"] is None else e["explainable_rmse_dn"]) or 0.0
    )


def known_residual(
    capture: Capture, key: ImageKey, measured: Mapping[ImageKey, NDArray], expected: Mapping[ImageKey, NDArray]
) -> NDArray[np.float64]:
    """Measured minus expected DN [height][width], NaN where the scene is not known: figures leave that out, too."""
    residual = measured[key].astype(np.float64) - expected[key]
    known = capture.known(next(f for f in capture.frames if f.id == key[0]), key[1])
    return residual if known is None else np.where(known, residual, np.nan)


def rmse(residual: NDArray[np.float64]) -> float:
    """Root mean square of the pixels that are not NaN."""
    return float(np.sqrt(np.nanmean(residual**2)))


def residual_limit(residual: NDArray[np.float64], floor_dn: float | None) -> float:
    """DN at the ends of the colours of a residual."""
    spanned = float(np.nanquantile(np.abs(residual), _SPANNED))
    return max(_NOISE_FLOORS * (floor_dn or 0.0), spanned, 1e-3)
