# SPDX-License-Identifier: Apache-2.0
"""Which findings may be named: beyond chance, of practical size, and an improvement wherever they act."""

from dataclasses import replace

import numpy as np

from activestereo.diagnose.findings import Finding, Ranking
from activestereo.effects.core.judging import Channel


def is_significant(ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding's gain is beyond chance among all that were tried, an improvement in most images, and the
    same everywhere.
    """
    thresholds, score = ranking.thresholds, finding.score
    threshold = thresholds.margin_nats + np.log(max(len(ranking.findings), 1)) + score.choice_nats
    varies_little = finding.checks.varying_floors <= thresholds.largest_variation * score.gain_floors
    return score.nats > threshold and score.consistency >= thresholds.consistent_share and varies_little


def passes(ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding may be named: significant, and of practical size."""
    if finding.channel is Channel.DEPTH_ENGINE and not ranking.at_floor:
        return False  # first what the images show: the engine matched those
    return _is_large(ranking, finding) and is_significant(ranking, finding)


def varies_too_much(ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding may not be named for the sole reason that its amplitude is not the same everywhere."""
    constant = replace(finding, checks=replace(finding.checks, varying_floors=0.0))
    return not passes(ranking, finding) and passes(ranking, constant)


def comes_near(ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding has so much of the size that a name needs that better images may give the rest."""
    return _is_large(ranking, finding, ranking.thresholds.near_size_share)


def _is_large(ranking: Ranking, finding: Finding, part: float = 1.0) -> bool:
    """part: of the size that is asked for."""
    thresholds, score, checks = ranking.thresholds, finding.score, finding.checks
    share = thresholds.smallest_field_share
    if finding.channel is Channel.EXPECTED_IMAGE:
        share = thresholds.smallest_share
    elif finding.channel is Channel.DEPTH_ENGINE:
        share = thresholds.smallest_depth_share
    large = score.explained_share >= part * share and score.gain_floors >= part * thresholds.smallest_gain_floors
    if checks.plain_share is None:
        return large
    large_in_dn = (
        checks.plain_share >= part * thresholds.smallest_share
        and checks.plain_floors >= part * thresholds.smallest_plain_floors
    )
    return (large and checks.plain_share >= part * thresholds.patch_share) or large_in_dn
