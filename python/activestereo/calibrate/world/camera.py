# SPDX-License-Identifier: Apache-2.0
"""Estimates focal length and centre from overlapping views: surfaces agree only under the true values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

# Scenes of one camera agree to this, px. Common errors of depth are in no scene's own interval.
_SCENE_PX = 0.4
# A scene with a larger deviation than this, px, does not determine the camera.
_MOST_DEVIATION_PX = 6.0
_Z90 = 1.645


@dataclass(frozen=True)
class CameraEstimate:
    """The estimated intrinsics. mean: (focal length, centre's column, centre's row), px. covariance: [3, 3]. source:
    'overlaps' or 'nominal'. text: a line for the user."""

    mean: Vector
    covariance: NDArray[np.float64]
    source: str
    text: str

    @property
    def K(self) -> NDArray[np.float64]:
        f, cx, cy = self.mean
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])


def camera_from_overlaps(scenes: Sequence[tuple[Vector, NDArray[np.float64]]]) -> CameraEstimate | None:
    """Combines the (mean, covariance) that each scene's overlapping views give to one estimate; None if no scene
    determines the camera. Scenes that differ by more than their intervals widen the result (Birge 1932)."""
    told = [(m, c) for m, c in scenes if np.sqrt(np.diag(c)).max() < _MOST_DEVIATION_PX]
    if not told:
        return None
    weights = [np.linalg.inv(c + _SCENE_PX**2 * np.eye(3)) for _, c in told]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    mean = covariance @ np.sum([w @ m for w, (m, _) in zip(weights, told, strict=True)], axis=0)
    misfit = sum(float((m - mean) @ w @ (m - mean)) for w, (m, _) in zip(weights, told, strict=True))
    covariance *= max(1.0, misfit / max(3 * (len(told) - 1), 1))
    (f, cx, cy), sd = mean, _Z90 * np.sqrt(np.diag(covariance))
    text = (
        f"camera: f {f:.1f} +- {sd[0]:.1f} px, centre ({cx:.1f} +- {sd[1]:.1f}, {cy:.1f} +- {sd[2]:.1f}) px, from "
        f"overlaps of views in {len(told)} scene{'s' * (len(told) > 1)} (90 %)"
    )
    return CameraEstimate(mean, covariance, "overlaps", text)
