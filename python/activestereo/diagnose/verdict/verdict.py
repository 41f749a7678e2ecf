# SPDX-License-Identifier: Apache-2.0
"""The verdict on a sensor, from the findings on top of the given model and of the model that was found."""

from dataclasses import replace

from activestereo.diagnose.findings import Ranking
from activestereo.diagnose.verdict.acceptance import passes
from activestereo.diagnose.verdict.completeness import (
    exceeds_scene_errors,
    fields_hide_a_varying_effect,
    is_unexplained,
)

EFFECT, NONE, UNKNOWN, UNDETERMINED = "effect", "none", "unknown", "undetermined"


def is_named(ranking: Ranking) -> bool:
    """Whether the first finding may be named."""
    return ranking.best is not None and passes(ranking, ranking.best)


def verdict_of(first: Ranking, last: Ranking, has_floor: bool) -> str:
    """The verdict: EFFECT, NONE, UNKNOWN or UNDETERMINED.

    first: the ranking on top of the given model; last: on top of the model that was found. has_floor: whether the noise
    was measured.
    """
    best = first.best
    if best is None or not is_named(first):
        if not has_floor:
            return UNDETERMINED
        is_missing = is_unexplained(first, first.base_remainder) or exceeds_scene_errors(first)
        return UNKNOWN if is_missing else NONE
    if not best.on_images:
        # Its own channel is evidence enough where the images lack nothing else.
        rest = replace(last.base_remainder, repeats_reduced_chi2=best.explanation.repeats_reduced_chi2)
        return UNKNOWN if is_unexplained(last, rest) else EFFECT
    if best.checks.at_range_end and is_unexplained(last, best.remainder, first):
        return UNKNOWN  # a confounder; further effects would only correct its misfit
    if fields_hide_a_varying_effect(last):
        return UNKNOWN
    passing = [f.remainder for f in last.findings if passes(last, f)]
    end = min([last.base_remainder, *passing], key=lambda rest: rest.chi2)
    return UNKNOWN if all(is_unexplained(last, rest, first) for rest in (best.remainder, end)) else EFFECT
