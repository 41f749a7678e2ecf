# SPDX-License-Identifier: Apache-2.0
"""Which findings cannot be told apart, and how sure each is."""

import numpy as np

from activestereo.diagnose.findings import Finding, Ranking
from activestereo.diagnose.verdict.acceptance import passes


def equivalents(ranking: Ranking, finding: Finding) -> list[str]:
    """Ids of the other findings that explain the images equally well: within the standard error of the paired
    difference, or within the part of the gain that inexact formulas may miss.

    A finding is no alternative where it gains little compared with this one, by weights or in DN, since errors of the
    scene measurement may gain as much; nor where a shape parameter ended at a limit of its range.
    """
    thresholds = ranking.thresholds
    if finding.score.nats <= 0 or not finding.on_images:
        return []
    limit = ranking.excess_after(finding.chi2) + thresholds.formulas_share * finding.score.gain_reduced_chi2
    chosen = []
    for other in ranking.findings:
        if other is finding or not other.on_images or other.score.nats <= 0:
            continue
        if not _is_as_large(finding, other, thresholds.smallest_share):
            continue
        error = thresholds.paired_errors * ranking.difference_error(finding, other)
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

    Findings that may be named share `named_probability` by their tempered likelihood and Laplace's penalty for their
    free parameters. The others share the rest, or everything where nothing may be named, by the share of the error that
    each explains, with 'none' for what the best of them leaves: errors of the scene measurement give likelihood, too.
    Noise and the depth engine are judged on other data and do not compete with effects on the images.
    """
    thresholds = ranking.thresholds
    rivals = [f for f in ranking.findings if f.on_images]
    named = [f for f in rivals if passes(ranking, f)]
    others = {f.id: min(max(f.score.explained_share, 0.0), 1.0) for f in rivals if not passes(ranking, f)}
    known = thresholds.named_probability if named else 0.0
    total = sum(others.values()) + 1.0 - max(others.values(), default=0.0)
    out = {name: (1.0 - known) * share / total for name, share in others.items()}
    logits = np.array([f.score.nats / thresholds.nats_per_unit + f.score.occam_nats for f in named])
    likely = np.exp(logits - logits.max(initial=-np.inf))
    out |= {f.id: known * float(p) for f, p in zip(named, likely / likely.sum(), strict=True)}
    apart = (f for f in ranking.findings if not f.on_images)
    return out | {f.id: thresholds.named_probability if passes(ranking, f) else 0.0 for f in apart}
