# SPDX-License-Identifier: Apache-2.0
"""Which findings cannot be told apart, and how sure each is."""

from collections.abc import Sequence

import numpy as np

from activestereo.diagnose.findings import BaseFit, Finding, Ranking
from activestereo.diagnose.verdict.acceptance import passes


def equivalents(ranking: Ranking, finding: Finding) -> list[str]:
    """Ids of other findings that explain the images as well, within their paired error or the models' own
    discrepancy, which is a share of what a model leaves, and no more than formulas miss of what it explains: what
    errors of the scene measurement leave says nothing of either.

    A finding that explains little beside the other, by its weights or in DN, is no other explanation: what it gains
    may be an error of the scene measurement. Where a shape was driven to an end of its range, its formula is not what
    the fit lacked.
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
    """Whether another finding gains a share of what a finding gains, and of what it gains in DN where both were
    looked at.
    """
    if other.score.gain_reduced_chi2 < least_share * finding.score.gain_reduced_chi2:
        return False
    if finding.checks.plain_share is None or other.checks.plain_share is None:
        return True
    return other.checks.plain_reduced_chi2 >= least_share * finding.checks.plain_reduced_chi2


def confidences(ranking: Ranking) -> dict[str, float]:
    """{id: probability of being what is missing}.

    It is a softmax of minus the logarithm of what each finding leaves above the floor, of its gain and of what its
    freedom costs. What may be named shares `named_probability`; the others share the rest with 'none', or all where
    nothing may be named. Noise and the depth engine have evidence of their own: they are no rivals of what is missing
    in the images.
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
    """The logits of the confidence; the last one is 'none'.

    The gain of what may not be named is not believed: errors of the scene measurement gain, too.
    """
    thresholds = ranking.thresholds
    excess = np.array([ranking.excess_after(f.chi2) for f in rivals] + [ranking.excess_after(base.chi2)])
    gains, costs = (np.array([getattr(f.score, name) for f in rivals] + [0.0]) for name in ("nats", "occam_nats"))
    likeness = -np.log(excess + thresholds.noise_known_to) / thresholds.temperature
    return likeness + np.where(named, gains, 0.0) / thresholds.nats_per_unit + costs / thresholds.occam_nats_per_unit
