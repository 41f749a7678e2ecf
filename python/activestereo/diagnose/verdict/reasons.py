# SPDX-License-Identifier: Apache-2.0
"""Why a finding stands where it does in a ranking, in words and numbers."""

from activestereo.diagnose.findings import Finding, Ranking
from activestereo.diagnose.thresholds import share_words
from activestereo.diagnose.verdict.acceptance import (
    closes_enough,
    is_large,
    least_nats,
    passes,
    smallest_share,
    varies_little,
)


def reason_of(ranking: Ranking, finding: Finding) -> str:
    """Why a finding may be named or not, and what stands before it."""
    place = ranking.findings.index(finding)
    if passes(ranking, finding):
        if place == 0:
            return "it explains the data best"
        first, own = ranking.findings[0], finding.score.nats
        return f"it may be named, but {first.id} is likelier ({first.score.nats:.0f} nats against {own:.0f})"
    return "it may not be named: " + "; ".join(_faults(ranking, finding))


def _faults(ranking: Ranking, finding: Finding) -> list[str]:
    thresholds, score = ranking.thresholds, finding.score
    least = least_nats(ranking, finding)
    faults = []
    if score.nats <= least:
        faults.append(f"it gains {score.nats:.1f} nats, a name needs {least:.1f}")
    if not is_large(ranking, finding):
        needed = smallest_share(ranking, finding)
        faults.append(
            f"it explains {100 * score.explained_share:.1f} % of the error ({score.gain_reduced_chi2:.3f} noise "
            f"variances), a name needs {share_words(needed)} and {thresholds.smallest_gain_reduced_chi2:g}"
        )
    low = finding.checks.plain_share_low
    if low is not None and not closes_enough(ranking, finding):
        faults.append(
            f"of the squared error in DN it removes {100 * low:.1f} % or more, a name needs "
            f"{share_words(thresholds.least_share)}"
        )
    if score.consistency < thresholds.consistent_share:
        faults.append(
            f"it improves {100 * score.consistency:.0f} % of the images that it changes, a name needs "
            f"{share_words(thresholds.consistent_share)}"
        )
    if not varies_little(ranking, finding):
        faults.append("its amplitude differs between parts of the images")
    return faults or ["the infrared images still lack something, and the depth engine matched those"]
