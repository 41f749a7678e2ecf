# SPDX-License-Identifier: Apache-2.0
"""The verdict on a sensor, from the findings on top of the given model and of the model that was found."""

from dataclasses import replace
from typing import Any

import numpy as np

from activestereo.diagnose.findings import Ranking
from activestereo.diagnose.verdict.acceptance import passes
from activestereo.diagnose.verdict.completeness import (
    fields_hide_a_varying_effect,
    is_unexplained,
    scene_errors_ratio,
    unexplained_ratio,
)
from activestereo.diagnose.verdict.confidence import confidences

EFFECT, NONE, UNKNOWN, UNDETERMINED = "effect", "none", "unknown", "undetermined"
_MOST_RATIO = 100.0


def is_named(ranking: Ranking) -> bool:
    """Whether the first finding may be named."""
    return ranking.best is not None and passes(ranking, ranking.best)


def verdict_of(first: Ranking, last: Ranking, has_floor: bool) -> str:
    """The verdict: EFFECT, NONE, UNKNOWN or UNDETERMINED.

    first: the ranking on top of the given model; last: on top of the model that was found. has_floor: whether the noise
    was measured.
    """
    if not is_named(first) and not has_floor:
        return UNDETERMINED
    if missing_ratio(first, last) > 1.0:
        return UNKNOWN
    return EFFECT if is_named(first) else NONE


def missing_ratio(first: Ranking, last: Ranking) -> float:
    """The remainder in units of what may remain: beyond 1 something is missing that the library does not explain."""
    best = first.best
    if best is None or not is_named(first):
        return max(unexplained_ratio(first, first.base_remainder), scene_errors_ratio(first))
    if not best.on_images:
        # Its own channel is evidence enough where the images lack nothing else.
        rest = replace(last.base_remainder, repeats_reduced_chi2=best.explanation.repeats_reduced_chi2)
        return unexplained_ratio(last, rest)
    if best.checks.at_range_end and is_unexplained(last, best.remainder, first):
        return unexplained_ratio(last, best.remainder, first)  # a confounder; more would only correct its misfit
    if fields_hide_a_varying_effect(last):
        return float("inf")
    passing = [f.remainder for f in last.findings if passes(last, f)]
    end = min([last.base_remainder, *passing], key=lambda rest: rest.chi2)
    return min(unexplained_ratio(last, rest, first) for rest in (best.remainder, end))


def probabilities(first: Ranking, last: Ranking, has_floor: bool) -> dict[str, Any] | None:
    """{"named": {id: p}, "none": p, "something_else": p}, which add up to 1; None where the data cannot tell.

    Something else is as likely as not where the verdict turns, and its odds go with a power of missing_ratio(); the
    rest is shared by the effects that may be named, as confidences() has them, and by none.
    """
    if verdict_of(first, last, has_floor) == UNDETERMINED:
        return None
    thresholds = first.thresholds
    odds = float(np.clip(missing_ratio(first, last), 0.0, _MOST_RATIO)) ** thresholds.missing_exponent
    known = 1.0 / (1.0 + odds)
    best = first.best
    named: dict[str, float] = {}
    if best is not None and is_named(first):
        sure = confidences(first)
        named = {f.id: sure[f.id] for f in first.findings if passes(first, f) and f.on_images == best.on_images}
        total = sum(named.values())
        named = {name: known * thresholds.named_probability * p / total for name, p in named.items()}
    return {"named": named, "none": known - sum(named.values()), "something_else": 1.0 - known}
