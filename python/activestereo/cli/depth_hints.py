# SPDX-License-Identifier: Apache-2.0
"""Hints of `depth` at a result that could be better: exchanged cameras, depth that was cut off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import simsense
    from activestereo.cli.import_calibration import RectifiedPair

# Matched the other way round at least so many times as much, and more than half of the image: the cameras are
# exchanged.
_TIMES = 1.5
_SUSPICIOUS_FILL = 0.6
_LEAST_FILL = 0.5


def depth_hints(
    cameras: RectifiedPair,
    engine: simsense.Engine,
    left: np.ndarray,
    right: np.ndarray,
    result: Mapping[str, np.ndarray],
) -> list[str]:
    """Lines to print, none where all is well. cameras: of the pair; result: the engine's depth and disparity."""
    return [hint for hint in (_cut(cameras, engine, result), _exchanged(engine, left, right, result)) if hint]


def _cut(cameras: RectifiedPair, engine: simsense.Engine, result: Mapping[str, np.ndarray]) -> str | None:
    """Pixels that were matched and have no depth: they lie outside of the depths that are kept."""
    disparity, p = result["disparity"], engine.parameters
    lost = (disparity > 0) & (result["depth"] == 0)
    if not lost.any():
        return None
    z = cameras.focal_baseline_px_m / np.where(lost, disparity + cameras.offset_px, 1.0)
    far, near = int((lost & (z >= p["max_depth_m"])).sum()), int((lost & (z < p["min_depth_m"])).sum())
    parts = [
        f"{count} pixels {words}, {100.0 * count / disparity.size:.1f} %, were dropped ({option} {p[name]:g})"
        for count, words, option, name in (
            (far, f"from {p['max_depth_m']:g} m on", "--max-depth-m", "max_depth_m"),
            (near, f"nearer than {p['min_depth_m']:g} m", "--min-depth-m", "min_depth_m"),
        )
        if count
    ]
    return "cut off: " + "; ".join(parts) if parts else None


def _exchanged(
    engine: simsense.Engine, left: np.ndarray, right: np.ndarray, result: Mapping[str, np.ndarray]
) -> str | None:
    """Only where little was measured: the pair is matched the other way round."""
    fill = float((result["disparity"] > 0).mean())
    if fill >= _SUSPICIOUS_FILL:
        return None
    other = float((engine.compute(right, left, ("disparity",))["disparity"] > 0).mean())
    if other < max(_LEAST_FILL, _TIMES * fill):
        return None
    return (
        f"hint: exchanged, the images give {100 * other:.1f} % instead of {100 * fill:.1f} %: is LEFT the right "
        "camera's image?"
    )
