# SPDX-License-Identifier: Apache-2.0
"""The tests that a finding has to pass before it may be named: significance, practical size and consistency."""

from dataclasses import replace

from activestereo.diagnose.findings import Finding, Ranking
from activestereo.effects.core.judging import Channel


def is_significant(ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding's gain is significant given the number of effects tried, most of the images that it changes
    improve, and its amplitude is constant.
    """
    score = finding.score
    is_steady = score.consistency >= ranking.thresholds.consistent_share
    return score.nats > least_nats(ranking, finding) and is_steady and varies_little(ranking, finding)


def least_nats(ranking: Ranking, finding: Finding) -> float:
    """The gain, in nats, that chance may reach given the number of effects tried and of choices made."""
    return ranking.thresholds.chance_nats(len(ranking.findings)) + finding.score.choice_nats


def varies_little(ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding's amplitude is nearly constant over the images."""
    return finding.checks.varying_reduced_chi2 <= ranking.thresholds.largest_variation * finding.score.gain_reduced_chi2


def passes(ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding may be named: significant, and of practical size."""
    if finding.channel is Channel.DEPTH_ENGINE and not ranking.at_floor:
        return False  # the engine matched these images, so their errors are explained first
    return is_large(ranking, finding) and closes_enough(ranking, finding) and is_significant(ranking, finding)


def varies_too_much(ranking: Ranking, finding: Finding) -> bool:
    """Whether a varying amplitude is the only reason that a finding may not be named."""
    constant = replace(finding, checks=replace(finding.checks, varying_reduced_chi2=0.0))
    return not passes(ranking, finding) and passes(ranking, constant)


def comes_near(ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding reaches `near_size_share` of the size that a name needs, so that rendering it may give the
    rest."""
    part = ranking.thresholds.near_size_share
    return is_large(ranking, finding, part) and closes_enough(ranking, finding, part)


def smallest_share(ranking: Ranking, finding: Finding) -> float:
    """The share of the error on its channel that a finding has to explain to be named."""
    thresholds = ranking.thresholds
    of_channel = {
        Channel.EXPECTED_IMAGE: thresholds.smallest_share,
        Channel.DEPTH_ENGINE: thresholds.least_share,
    }
    return of_channel.get(finding.channel, thresholds.smallest_field_share)


def is_large(ranking: Ranking, finding: Finding, part: float = 1.0) -> bool:
    """Whether a finding is of practical size. part: of the size that is asked for."""
    score, least_gain = finding.score, ranking.thresholds.smallest_gain_reduced_chi2
    has_share = score.explained_share >= part * smallest_share(ranking, finding)
    return has_share and score.gain_reduced_chi2 >= part * least_gain


def closes_enough(ranking: Ranking, finding: Finding, part: float = 1.0) -> bool:
    """Whether the lower end of the share of the unweighted error that a finding removes, where it is known, is above
    the least. part: of the share that is asked for."""
    low = finding.checks.plain_share_low
    return low is None or low >= part * ranking.thresholds.least_share
