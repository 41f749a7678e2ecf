# SPDX-License-Identifier: Apache-2.0
"""Measures the right camera relative to the left one: compares the position of a surface in the right image with the
position that its measured depth predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.joint import block
from activestereo.calibrate.world.views import Image, SceneView, blurred, high_pass, right_at_depth
from activestereo.capture.capture import Rig

_BLOCK_PX = 12.0  # sigma of the Gaussian windows in which shifts are measured
_STEP = 24
_LEAST_R = 0.6
# Depth that the device computed from this very pair agrees with it at every distance.
_OWN_PX = 0.05
_MOST_VIEWS = 6


@dataclass(frozen=True)
class PairEstimate:
    """The right camera's geometry. column_px, row_px: shift of its principal point from the stated rig's. deviation:
    standard deviations of baseline, column and row, from the scatter over views. own_depth: whether the scene's depth
    came from this device; then baseline_m and column_px repeat the stated rig."""

    baseline_m: float
    column_px: float
    row_px: float
    deviation: tuple[float, float, float]
    own_depth: bool

    def as_json(self) -> dict[str, Any]:
        return {
            "baseline_m": self.baseline_m,
            "right_centre_shift_px": [self.column_px, self.row_px],
            "joint": block(("baseline", "right column", "right row"), np.diag(np.square(self.deviation))),
            "depth_is_the_devices": self.own_depth,
        }

    @property
    def text(self) -> str:
        metre, row = (
            f" +- {1.645 * scale * x:.2f}" if x < np.inf else ""
            for scale, x in ((1e3, self.deviation[0]), (1.0, self.deviation[2]))
        )
        baseline = f"baseline {1e3 * self.baseline_m:.2f}"
        baseline += " mm (nominal: depth was computed with it)" if self.own_depth else f"{metre} mm"
        sure = "90 %" if row else "no interval: fewer than two views tell it"
        return f"cameras: {baseline}; the right camera's rows are {self.row_px:+.2f}{row} px off ({sure})"


def pair_geometry(views: Sequence[SceneView], rig: Rig) -> PairEstimate:
    """Estimates baseline and the right camera's principal point from rectified pairs with measured depth."""
    each = np.array([f for view in views[:_MOST_VIEWS] if (f := _one(view, rig)) is not None])
    if not len(each):
        return PairEstimate(rig.baseline_m, 0.0, 0.0, (np.inf, np.inf, np.inf), True)
    mean = np.median(each, axis=0)
    deviation = each.std(axis=0, ddof=1) / np.sqrt(len(each)) if len(each) > 1 else np.full(3, np.inf)
    own = abs(mean[0]) < _OWN_PX and abs(mean[1]) < _OWN_PX
    share = 0.0 if own else float(mean[0]) / rig.left.K[0, 0]
    return PairEstimate(
        rig.baseline_m - share, 0.0 if own else float(mean[1]), float(mean[2]),
        (float(deviation[0]) / rig.left.K[0, 0], float(deviation[1]), float(deviation[2])), bool(own),
    )  # fmt: skip


def _one(view: SceneView, rig: Rig) -> tuple[float, float, float] | None:
    """Compares, for one view, positions in the right image with those that the measured depth predicts. Returns the
    offsets (focal length x baseline in px m, columns in px, rows in px), or None if too few windows correlate."""
    left = high_pass(view.left)
    shifted = {s: right_at_depth(view, rig, s) for s in ((0.0, 0.0), (-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0))}
    inside = np.all([ok for _, ok in shifted.values()], axis=0).astype(np.float32)
    r = {}  # the local correlation of both images under each shift
    for s, (image, _) in shifted.items():
        ab, aa, bb = (blurred(x * y * inside, _BLOCK_PX) for x, y in ((left, image), (left, left), (image, image)))
        r[s] = (ab / np.sqrt(np.maximum(aa * bb, 1e-12)))[::_STEP, ::_STEP]
    full = blurred(inside, _BLOCK_PX)[::_STEP, ::_STEP] > 0.9
    chosen = full & (r[0.0, 0.0] > _LEAST_R)
    if chosen.sum() < 50:
        return None
    across = _top(r[-1.0, 0.0], r[0.0, 0.0], r[1.0, 0.0])[chosen]
    down = _top(r[0.0, -1.0], r[0.0, 0.0], r[0.0, 1.0])[chosen]
    inverse = 1.0 / view.depth_m[::_STEP, ::_STEP][chosen]
    design = np.stack([inverse, np.ones_like(inverse)], axis=1)
    keep = np.isfinite(across) & (np.abs(across) < 0.9)
    for _ in range(4):
        slope = np.linalg.lstsq(design[keep], across[keep], rcond=None)[0]
        rest = across - design @ slope
        keep = np.abs(rest) < 3.0 * 1.4826 * np.median(np.abs(rest[keep])) + 1e-6
    return float(slope[0]), float(slope[1]), float(np.median(down[np.isfinite(down)]))


def _top(before: Image, middle: Image, after: Image) -> NDArray[np.float64]:
    """Returns the offset, in steps, of the top of a parabola through three values; NaN if there is no top."""
    bend = before - 2.0 * middle + after
    return np.where(bend < -1e-6, 0.5 * (before - after) / np.where(bend < -1e-6, bend, -1.0), np.nan)
