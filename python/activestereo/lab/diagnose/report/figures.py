# SPDX-License-Identifier: Apache-2.0
"""Held-out figures of the models along a diagnosis's way: the only use of test frames."""

from collections.abc import Sequence

import numpy as np

from activestereo.lab.diagnose.evidence import Evidence
from activestereo.lab.diagnose.findings import BaseFit, Finding
from activestereo.lab.diagnose.refine import Fitter, Fitters


def held_out_figures(
    evidence: Evidence, fitters: Fitters, bases: Sequence[tuple[tuple[str, ...], BaseFit]], beside: Sequence[Finding]
) -> dict[str, object]:
    """Held-out figures, and error against effects added: pooled over images, DN.

    bases: (effects added, BaseFit) along the way; beside: findings added on top of the last. What images do not show
    leaves their error as it was.
    """
    shown: list[tuple[tuple[str, ...], BaseFit | Finding]] = list(bases)
    for finding in beside:
        names, before = shown[-1]
        shown.append(((*names, finding.id), finding if finding.on_images else before))
    curve = []
    for names, entry in shown:
        train, test = _rmse(fitters.train, entry, False), _rmse(fitters.test, entry, True)
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


def _rmse(fitter: Fitter, entry: BaseFit | Finding, is_test: bool) -> float | None:
    residuals = _residuals(fitter, entry, is_test)
    if not residuals:
        return None
    squares = sum((r.astype(np.float64) ** 2).sum() for r in residuals)
    return float(np.sqrt(squares / sum(r.size for r in residuals)))


def _residuals(fitter: Fitter, entry: BaseFit | Finding, is_test: bool) -> Sequence[np.ndarray]:
    if isinstance(entry, Finding) and entry.explanation.fields is not None:
        fields = entry.explanation.fields
        return fields.test_residuals if is_test else fields.residuals
    solution = entry.fitted if isinstance(entry, Finding) else entry.solution
    return [row.residual for row in fitter.residuals(solution)]
