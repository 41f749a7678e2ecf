# SPDX-License-Identifier: Apache-2.0
"""Whether what an explanation leaves asks for another effect."""

from dataclasses import replace

import numpy as np

from activestereo.diagnose.findings import Finding, Ranking, Remainder
from activestereo.diagnose.verdict.acceptance import passes, varies_too_much
from activestereo.effects.core.judging import Channel


def _over(value: float, limit: float) -> float:
    """value in units of a limit that it should not exceed."""
    return value / limit if limit > 0.0 else np.inf if value > 0.0 else 0.0


def fields_hide_a_varying_effect(ranking: Ranking) -> bool:
    """Whether a deterministic effect gains more than everything that may be named, random fields among it, and is
    refused only because its amplitude varies. The fields then absorb a deterministic effect that the library lacks.
    """
    passing = [f for f in ranking.findings if f.on_images and passes(ranking, f)]
    images = (f for f in ranking.findings if f.channel is Channel.EXPECTED_IMAGE)
    varying = [f.score.nats for f in images if varies_too_much(ranking, f)]
    has_fields = any(f.channel is Channel.STATIC_FIELD for f in passing)
    return has_fields and max(varying, default=-np.inf) > max(f.score.nats for f in passing)


def lacks_nothing(ranking: Ranking, noise: Finding) -> bool:
    """Whether a finding on the noise model leaves no excess above the noise floor for other effects to explain."""
    rest = replace(ranking.base_remainder, repeats_reduced_chi2=noise.explanation.repeats_reduced_chi2)
    return noise.channel is Channel.NOISE_MODEL and _excess_beside(ranking, rest) <= 0.0


def _excess_beside(ranking: Ranking, remainder: Remainder) -> float:
    """The excess above the noise and above the error of coarse digital steps, which repeats share, in noise
    variances."""
    return remainder.chi2 / ranking.pixels - 1.0 - remainder.repeats_reduced_chi2


def scene_errors_ratio(ranking: Ranking) -> float:
    """The base model's residual in units of what errors of the scene measurement leave: its size, its difference
    between the frames of one view, and the structure of one image beyond that of the others."""
    thresholds, checks, white = ranking.thresholds, ranking.base_checks, ranking.base.white_reduced_chi2
    return max(
        _over(checks.plain_excess_reduced_chi2 - white, thresholds.largest_scene_error_reduced_chi2),
        _over(checks.unsteady_reduced_chi2, thresholds.unexplained_reduced_chi2),
        _over(checks.uneven_structure_reduced_chi2, thresholds.unexplained_reduced_chi2),
    )


def unexplained_ratio(ranking: Ranking, remainder: Remainder, first: Ranking | None = None) -> float:
    """The remainder of an explanation (of the base, where nothing is named) in units of what may remain: beyond 1 it
    asks for another effect.

    first: the ranking without effects, where an effect is named. An effect whose fit moves the calibration or the scene
    measurement further than their priors allow is a confounder of the true one, however small its residual. Noise of
    single pixels needs no effect: its level is a nuisance, and random patterns that stay have candidates of their own.
    Those explain no structure, so the base's structure counts beside them. Where no effect is named, a residual above
    what errors of the scene measurement leave needs one too, whatever its shape; beside a named effect, one above
    `unexplained_reduced_chi2` that is larger than what this explains.
    """
    thresholds, white, excess = ranking.thresholds, ranking.base.white_reduced_chi2, _excess_beside(ranking, remainder)
    structure, limit = remainder.structure_reduced_chi2 or 0.0, thresholds.unexplained_reduced_chi2
    left = min(_over(excess, limit), _over(structure, limit))  # structure counts as far as there is that much excess
    if first is None:
        return max(_over(excess - white, thresholds.largest_scene_error_reduced_chi2), left)
    kept = _over(structure, thresholds.smallest_share * (first.base_checks.structure_reduced_chi2 or 0.0))
    explained = max((first.base.chi2 - remainder.chi2) / first.pixels, 0.0)
    most = 0.0 if remainder.is_of_draws else min(_over(excess - white, limit), _over(excess - white, explained))
    return max(_over(remainder.prior_sigmas, thresholds.largest_prior_sigmas), min(left, kept), most)


def is_unexplained(ranking: Ranking, remainder: Remainder, first: Ranking | None = None) -> bool:
    """Whether unexplained_ratio() asks for another effect."""
    return unexplained_ratio(ranking, remainder, first) > 1.0
