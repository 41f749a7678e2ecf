# SPDX-License-Identifier: Apache-2.0
"""Which findings cannot be told apart, and how sure each is."""

from collections.abc import Sequence

import numpy as np

from activestereo.diagnose.findings import BaseFit, Finding, Ranking
from activestereo.diagnose.verdict.acceptance import passes


def equivalents(ranking: Ranking, finding: Finding) -> list[str]:
    """Ids of the other findings that explain the images equally well: within the standard error of the paired
    difference, or within the model discrepancy. The discrepancy is a share of the remaining error, and at most the
    part of the gain that inexact formulas may miss.

    A finding is no alternative where it gains little compared with this one, by weights or in DN, since errors of the
    scene measurement may gain as much; nor where a shape parameter ended at a limit of its range.
    """
    thresholds = ranking.thresholds
    if finding.score.nats <= 0 or not finding.on_images:
        return []
    excess = ranking.excess_after(finding.chi2)
    discrepancy = (thresholds.same_excess_ratio - 1.0) * excess + thresholds.same_excess_reduced_chi2
    limit = excess + min(discrepancy, thresholds.formulas_share * finding.score.gain_reduced_chi2)
    chosen = []
    for other in ranking.findings:
        if other is finding or not other.on_images or other.score.nats <= 0:
            continue
        if not _is_as_large(finding, other, thresholds.same_gain_share):
            continue
        error = thresholds.paired_errors * ranking.difference_error(finding, other) + thresholds.paired_nats
        leaves_alike = ranking.excess_after(other.chi2) <= limit and not other.checks.at_range_end
        if finding.score.nats - other.score.nats <= error or leaves_alike:
            chosen.append(other.id)
    return chosen


def _is_as_large(finding: Finding, other: Finding, least_share: float) -> bool:
    """Whether `other` gains at least `least_share` of the finding's gain, and of its gain in DN where both are
    known."""
    if other.score.gain_reduced_chi2 < least_share * finding.score.gain_reduced_chi2:
        return False
    if finding.checks.plain_share is None or other.checks.plain_share is None:
        return True
    return other.checks.plain_reduced_chi2 >= least_share * finding.checks.plain_reduced_chi2


def confidences(ranking: Ranking) -> dict[str, float]:
    """{id: probability of being what is missing}.

    It is a softmax over minus the logarithm of each finding's remaining excess, its gain in likelihood and the penalty
    for its free parameters. Findings that may be named share `named_probability`; the others share the rest with
    'none', or everything where nothing may be named. Noise and the depth engine are judged on other data and do not
    compete with effects on the images.
    """
    thresholds = ranking.thresholds
    rivals = [f for f in ranking.findings if f.on_images]
    named = np.array([passes(ranking, f) for f in rivals] + [False])
    logits = _logits(ranking, rivals, ranking.base, named)
    weights = np.empty(len(logits))
    groups = (
        ((named, thresholds.named_probability), (~named, 1.0 - thresholds.named_probability))
        if named.any()
        else ((~named, 1.0),)
    )
    for group, share in groups:
        likely = np.exp(logits[group] - logits[group].max())
        weights[group] = share * likely / likely.sum()
    out = {f.id: float(w) for f, w in zip(rivals, weights, strict=False)}
    others = (f for f in ranking.findings if not f.on_images)
    return out | {f.id: thresholds.named_probability if passes(ranking, f) else 0.0 for f in others}


def _logits(ranking: Ranking, rivals: Sequence[Finding], base: BaseFit, named: np.ndarray) -> np.ndarray:
    """The logits of the confidences; the last one is of 'none'.

    Gains count only for findings that may be named, since errors of the scene measurement also produce gains.
    """
    thresholds = ranking.thresholds
    excess = np.array([ranking.excess_after(f.chi2) for f in rivals] + [ranking.excess_after(base.chi2)])
    gains, costs = (np.array([getattr(f.score, name) for f in rivals] + [0.0]) for name in ("nats", "occam_nats"))
    likeness = -np.log(excess + thresholds.smallest_gain_reduced_chi2) / thresholds.temperature
    return likeness + np.where(named, gains, 0.0) / thresholds.nats_per_unit + costs / thresholds.occam_nats_per_unit
