# SPDX-License-Identifier: Apache-2.0
"""Converts a search's outcome to entries of diagnose.json: the ranking, the sets, the numbers behind the verdict."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from activestereo.diagnose.fields import field_parameters
from activestereo.diagnose.goodness import Interval, design_effect, intervals
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.outcome import Name, Outcome, Round
from activestereo.diagnose.verdict import missing, probability_right
from activestereo.effects import Effect, Parameter
from activestereo.effects.core.surfaces import material_numbers

_SHOWN = 12
Parameters = Mapping[str, Interval]
Json = dict[str, object]


def entry_json(
    effect: Effect, channel: str, nats: float, confidence: float, share: float | None, found: Parameters,
    equivalent: list[str], name_of: Callable[[int], str],
) -> Json:  # fmt: skip
    """Returns an effect's entry in a ranking. A choice of surfaces also lists its materials; an empty list means all.
    found: the fitted parameters. name_of: returns a material's name."""

    def told(p: Parameter) -> Json:
        names = {"materials": [name_of(k) for k in material_numbers(found[p.name].value)]} if p.choice else {}
        return vars(found[p.name]) | names

    return {
        "effect": effect.id,
        "family": effect.family,
        "finding": effect.finding,
        "channel": channel,
        "score_nats": nats,
        "confidence": confidence,
        "explained_share": share,
        "parameters": {p.name: told(p) for p in effect.parameters},
        "equivalent": equivalent,
    }


def parameters_of(outcome: Outcome, name: Name) -> Parameters:
    """Returns a named effect's parameters with 90 % intervals."""
    if name.field is not None:
        return field_parameters(name.effect, name.field, outcome.evidence.capture.binning)
    if name.id in outcome.noise:
        return outcome.noise[name.id].parameters()
    return intervals(outcome.fitter, outcome.solution, name.effect)


def ranking_of(
    outcome: Outcome, numbers: Numbers, verdict_is_effect: bool, name_of: Callable[[int], str]
) -> list[Json]:
    """Returns the ranking: named effects in order, then effects that this recording cannot distinguish from them, then
    other fitted effects by gain, then the rest by score. name_of: returns a material's name."""
    entries: dict[str, Json] = {}
    pixels, known = outcome.fitter.pixels_used(), _known(outcome, numbers)

    def add(effect: Effect, gain: float, nats: float, p: float, found: Parameters, same: list[str]) -> None:
        if effect.id not in entries:
            channel, share = "noise" if effect.id in outcome.noise else "infrared", _explained(outcome, gain)
            entry = entry_json(effect, channel, nats, p, share, found, same, name_of)
            entries[effect.id] = entry | {"gain_reduced_chi2": gain}

    def add_fit(seen: Round, member: str, p: float, same: list[str]) -> None:
        fit = seen.fits[member].solution
        effect = fit.effects[-1]
        own = fit.theta[len(fit.theta) - len(effect.parameters) :]
        found = {q.name: Interval(float(v), q.low, q.high, q.unit) for q, v in zip(effect.parameters, own, strict=True)}
        gain = (seen.chi2 - fit.sums.total) / pixels
        add(effect, gain, _nats(outcome, gain), p, found, same)

    for name in outcome.names:
        own = outcome.noise.get(name.id)
        nats = _nats(outcome, name.gain) if own is None else own.nats
        same = [other for other in name.members if other != name.id]
        add(name.effect, name.gain, nats, known * name.members[name.id], parameters_of(outcome, name), same)
    for name in outcome.names:
        for member, p in name.members.items():
            if name.seen is not None and member in name.seen.fits:
                add_fit(name.seen, member, known * p, [m for m in name.members if m != member])
    rivals = outcome.rounds[:1] + outcome.rounds[-1:]  # beside no named effect, and beside all of them
    for seen in rivals if verdict_is_effect else reversed(rivals):
        for member in sorted(seen.fits, key=lambda m: seen.fits[m].chi2):
            add_fit(seen, member, 0.0, [])
    for candidate in list(outcome.rounds[0].candidates.values())[:_SHOWN]:
        effect, line = candidate.best.atom.effect, candidate.best.values()
        found = {q.name: Interval(line[q.name], q.low, q.high, q.unit) for q in effect.parameters}
        nats = max(candidate.evidence, 0.0) / max(1.0, _design(outcome))
        add(effect, candidate.gain / pixels, nats, 0.0, found, [])
    for term in outcome.noise.values():
        add(term.effect, 0.0, term.nats, 0.0, term.parameters(), [])
    return list(entries.values())


def _nats(outcome: Outcome, gain: float) -> float:
    """Returns the gain of profile log-likelihood that belongs to a fall of the first round's mean square, in noise
    variances. The noise's scale is free: the residual of every model counts as noise."""
    pixels = outcome.fitter.pixels_used()
    left = max(1.0 - gain * pixels / outcome.rounds[0].chi2, 1e-3)
    return -0.5 * pixels / _design(outcome) * float(np.log(left))


def _design(outcome: Outcome) -> float:
    return design_effect(outcome.solution.sums.tile_chi2, outcome.fitter.tile_pixels())


def _known(outcome: Outcome, numbers: Numbers) -> float:
    """Returns the probability that the named effects are right, or, without a name, that none is missing."""
    is_named = bool(outcome.names)
    return probability_right(missing(outcome.rest, numbers), is_named)


def probabilities_of(outcome: Outcome, numbers: Numbers) -> Json:
    """Returns {"named": {id: p}, "none": p, "something_else": p}, which add up to 1."""
    known = _known(outcome, numbers)
    first = outcome.names[0].members if outcome.names else {}
    total = sum(first.values())
    named = {name: known * p / total for name, p in first.items()}
    return {"named": named, "none": known - sum(named.values()), "something_else": 1.0 - known}


def sets_of(outcome: Outcome) -> list[Json]:
    """Returns [{effects, probabilities, rivals}], one entry for each named effect. effects: those that this recording
    cannot distinguish, likeliest first. rivals: {effect: share of the error that it explains} of the other fitted
    effects, best first."""
    pixels, sets = outcome.fitter.pixels_used(), list[Json]()
    for name in outcome.names:
        seen, rivals = name.seen, dict[str, float]()
        if seen is not None:
            shares = {id: _explained(outcome, (seen.chi2 - fit.chi2) / pixels) for id, fit in seen.fits.items()}
            rivals = {id: share for id, share in shares.items() if id not in name.members}
            rivals = dict(sorted(rivals.items(), key=lambda rival: -rival[1]))
        sets.append({"effects": [*name.members], "probabilities": [*name.members.values()], "rivals": rivals})
    return sets


def _explained(outcome: Outcome, gain: float) -> float:
    """Returns the share of the error beyond noise that a fall of the mean square explains, at most 1. Error and noise
    are those of the first round, because fits have its weights. The noise is at most what the best fit leaves."""
    first = outcome.rounds[0]
    noise = min([outcome.fitter.pixels_used(), *(fit.chi2 for fit in first.fits.values())])
    return min(gain * outcome.fitter.pixels_used() / max(first.chi2 - noise, 1e-9), 1.0)


def judging_of(outcome: Outcome) -> dict[str, Any]:
    """Returns the numbers that the verdict rests on, and the scores, fits and draws of each round."""
    rounds = [
        {
            "floor": seen.floor, "structure": seen.structure, "gain": seen.gain, "chance": seen.chance,
            "lines": {name: c.gain / seen.chi2 for name, c in list(seen.candidates.items())[:_SHOWN]},
            "fits": {name: f.chi2 / seen.chi2 for name, f in seen.fits.items()},
            "draws": {name: fit.explained for name, fit in seen.fields.items()},
        }
        for seen in outcome.rounds
    ]  # fmt: skip
    return vars(outcome.rest) | {"rounds": rounds}
