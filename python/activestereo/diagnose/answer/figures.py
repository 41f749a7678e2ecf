# SPDX-License-Identifier: Apache-2.0
"""Held-out figures of the models along a diagnosis's way: the only use of test frames."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from activestereo.compare.render_noise import noise_square, rmse_without_noise
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.findings import BaseFit, Finding
from activestereo.diagnose.refine import Fitter, Fitters, Solution

# Names of the effects so far, what was found last, and the fit whose expected images it has or is added to.
_Shown: TypeAlias = tuple[tuple[str, ...], BaseFit | Finding, Solution]


def held_out_figures(
    evidence: Evidence, fitters: Fitters, bases: Sequence[tuple[tuple[str, ...], BaseFit]], beside: Sequence[Finding]
) -> dict[str, object]:
    """Held-out figures, and error against effects added: pooled over images, DN. Held-out errors are without the
    renderer's own noise (render_noise.py).

    bases: (effects added, BaseFit) along the way; beside: findings added on top of the last. What images do not show
    leaves their error as it was.
    """
    shown: list[_Shown] = [(names, base, base.solution) for names, base in bases]
    for finding in beside:
        names, before, solution = shown[-1]
        shown.append(((*names, finding.id), finding if finding.on_images else before, finding.solution or solution))
    curve = []
    for names, entry, solution in shown:
        train = _rmse(_residuals(fitters.train, entry, False), 0.0)
        test = _rmse(_residuals(fitters.test, entry, True), _render_noise(fitters, solution))
        curve.append({"effects": list(names), "train_ir_rmse": train, "heldout_ir_rmse": test})
    floor = {}
    for name, split in (("train", evidence.train), ("heldout", evidence.test)):
        floor[name] = float(np.sqrt(evidence.floor_variance(split))) if split and evidence.has_floor else None
    return {
        "heldout_ir_rmse_before": curve[0]["heldout_ir_rmse"],
        "heldout_ir_rmse_after": curve[-1]["heldout_ir_rmse"],
        "heldout_noise_floor": floor["heldout"],
        "train_noise_floor": floor["train"],
        "curve": curve,
    }


def _render_noise(fitters: Fitters, solution: Solution) -> float:
    """The sum of squares of the renderer's noise in the test images under a solution, DN^2."""
    halves = [fitter.residuals(solution) for fitter in fitters.test_halves]
    return sum(noise_square(a.expected, b.expected) * a.expected.size for a, b in zip(*halves, strict=True))


def _rmse(residuals: Sequence[np.ndarray], noise_squares: float) -> float | None:
    if not residuals:
        return None
    squares = sum(float((r.astype(np.float64) ** 2).sum()) for r in residuals)
    return rmse_without_noise(squares, sum(r.size for r in residuals), noise_squares)


def _residuals(fitter: Fitter, entry: BaseFit | Finding, is_test: bool) -> Sequence[np.ndarray]:
    if isinstance(entry, Finding) and entry.explanation.fields is not None:
        fields = entry.explanation.fields
        return fields.test_residuals if is_test else fields.residuals
    solution = entry.fitted if isinstance(entry, Finding) else entry.solution
    return [row.residual for row in fitter.residuals(solution)]
