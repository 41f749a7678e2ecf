# SPDX-License-Identifier: Apache-2.0
"""Whether what an explanation leaves asks for another effect."""

from dataclasses import replace

from activestereo.diagnose.findings import Finding, Ranking, Remainder
from activestereo.diagnose.verdict.acceptance import passes, varies_too_much
from activestereo.effects.core.judging import Channel


def has_other_signature(ranking: Ranking, remainder: Remainder, first: Ranking) -> bool:
    """Whether an added effect's amplitude varies between parts of the images more than its formula allows, so that the
    true effect has another signature.

    first: the ranking without effects.
    """
    thresholds = ranking.thresholds
    limit = max(
        thresholds.other_signature_share * (first.base.chi2 - remainder.chi2) / ranking.pixels,
        thresholds.other_signature_reduced_chi2,
    )
    return any(varying > limit for varying in remainder.variation.values())


def fields_hide_a_varying_effect(ranking: Ranking) -> bool:
    """Whether a deterministic effect gains more than every random field that may be named, and is refused only because
    its amplitude varies. The fields then absorb a deterministic effect that the library lacks.
    """
    fields = [f.score.nats for f in ranking.findings if f.channel is Channel.STATIC_FIELD and passes(ranking, f)]
    images = (f for f in ranking.findings if f.channel is Channel.EXPECTED_IMAGE)
    varying = [f.score.nats for f in images if varies_too_much(ranking, f)]
    return bool(fields and varying) and max(varying) > max(fields)


def lacks_nothing(ranking: Ranking, noise: Finding) -> bool:
    """Whether a finding on the noise model leaves no excess above the noise floor for other effects to explain."""
    rest = replace(ranking.base_remainder, repeats_reduced_chi2=noise.explanation.repeats_reduced_chi2)
    return noise.channel is Channel.NOISE_MODEL and _excess_beside(ranking, rest) <= 0.0


def _excess_beside(ranking: Ranking, remainder: Remainder) -> float:
    """The excess above the noise and above the error of coarse digital steps, which repeats share, in noise
    variances."""
    return (
        remainder.chi2 / ranking.pixels
        - 1.0
        - (1.0 + ranking.thresholds.rounding_known_to) * remainder.repeats_reduced_chi2
    )


def exceeds_scene_errors(ranking: Ranking) -> bool:
    """Whether the base model's residual cannot come from errors of the scene measurement alone: it is larger than they
    make it, it differs between the frames of one view, or one image has much more structure than the others.
    """
    thresholds, checks, white = ranking.thresholds, ranking.base_checks, ranking.base.white_reduced_chi2
    return (
        checks.plain_excess_reduced_chi2 - white > thresholds.largest_scene_error_reduced_chi2
        or checks.unsteady_reduced_chi2 > thresholds.unsteady_reduced_chi2
        or checks.uneven_structure_reduced_chi2 > thresholds.uneven_structure_reduced_chi2
    )


def is_unexplained(ranking: Ranking, remainder: Remainder, first: Ranking | None = None) -> bool:
    """Whether what an explanation leaves (the base, where nothing is named) asks for another effect.

    first: the ranking without effects, where an effect is named. An effect whose fit moves the calibration or the scene
    measurement further than their priors allow is a confounder of the true one, however small its residual. Noise of
    single pixels needs no effect: its level is a nuisance, and random patterns that stay have candidates of their own.
    Those explain no structure, so the base's structure counts beside them. Where no effect is named, a residual above
    what errors of the scene measurement leave needs one too; a named effect has to have its own signature.
    """
    thresholds = ranking.thresholds
    excess = _excess_beside(ranking, remainder)
    if first is None and excess - ranking.base.white_reduced_chi2 > thresholds.largest_scene_error_reduced_chi2:
        return True
    if first is not None and remainder.prior_sigmas > thresholds.largest_prior_sigmas:
        return True
    if first is not None and excess > 0.0 and has_other_signature(ranking, remainder, first):
        return True
    structure = remainder.structure_reduced_chi2 or 0.0
    if excess <= thresholds.unexplained_reduced_chi2:
        return False
    if structure <= (
        thresholds.unexplained_reduced_chi2 if first is None else thresholds.structure_of_named_reduced_chi2
    ):
        return False
    return first is None or structure > thresholds.unexplained_share * (first.base_checks.structure_reduced_chi2 or 0.0)
