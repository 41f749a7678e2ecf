# SPDX-License-Identifier: Apache-2.0
"""The law of decision: posterior probabilities of models from their marginal likelihoods, and what may be named.

No model is exact. Formulas, and errors of the scene measurement that no nuisance takes, leave a discrepancy in each
view whose mean square, in noise variances, is exponential with mean Law.discrepancy. Two things follow. A likelihood of
data that are that near to a model, not equal to it, is the usual one to the power alpha / (alpha + n) with alpha = 2 /
discrepancy: a view counts as alpha pixels (Miller and Dunson 2019, Robust Bayesian inference via coarsening, sections 2
and 3), and tells that much less of parameters, too. And where something is missing that the library lacks, the
discrepancy is as large as effects are: that is the model of something else (Kennedy and O'Hagan 2001, Bayesian
calibration of computer models). Its discrepancy is a linear basis in each tile (score/structure.py), with its variance
integrated out.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, permutations
from math import log, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.decision.records import Findings, Freedom, ModelRecord
from activestereo.effects.core.judging import Channel

EFFECT, NONE, UNKNOWN, UNDETERMINED = "effect", "none", "unknown", "undetermined"
Effects = tuple[str, ...]
Values = NDArray[np.float64]
# A mean square of no less counts, and a discrepancy explains at most this share of a residual: logarithms end there.
_LEAST, _MOST = 0.05, 0.95


@dataclass(frozen=True)
class Law:
    """All constants of a decision.

    discrepancy: mean square that a right model leaves in a view (calibrated: the truths of training cases are
    likeliest). rendering: the same where it has no structure (theory: Monte Carlo noise of 32 samples). largest: scale
    of something else's mean square (convention: the noise). something_else: prior probability of what the library
    lacks; shows: that it shows in a view; more: that one more effect is missing (conventions). alpha: expected share
    of false names, least_share: of the squared error that a name removes, both a user's. alike: ratio of probabilities
    within which two models predict alike (convention).
    """

    discrepancy: float = 0.0075
    rendering: float = 0.06
    largest: float = 1.0
    something_else: float = 0.1
    shows: float = 0.5
    more: float = 0.5
    alpha: float = 0.01
    least_share: float = 0.05
    alike: float = 0.01


@dataclass(frozen=True)
class Posterior:
    """known: {effects: probability that they are what is missing, and all of it}, () of nothing. unknown: the same
    where something else is missing, too. They add up to 1."""

    known: Mapping[Effects, float]
    unknown: Mapping[Effects, float]

    @property
    def none(self) -> float:
        return sum(p for effects, p in self.known.items() if not effects)

    @property
    def something_else(self) -> float:
        return sum(self.unknown.values())

    def of(self, names: Iterable[str]) -> float:
        """The probability that one of these effects is missing, whatever else is."""
        both, wanted = chain(self.known.items(), self.unknown.items()), set(names)
        return sum(p for effects, p in both if wanted & set(effects))


@dataclass(frozen=True)
class Decision:
    """verdict: as diagnose.json has it. named: effects, likeliest first. equivalent: of each effect of the likeliest
    model, what predicts alike."""

    verdict: str
    named: Effects
    equivalent: Mapping[str, Effects]
    posterior: Posterior

    def confidence(self, name: str) -> float:
        """The probability that an effect is missing, and nothing that the library lacks."""
        return sum(p for effects, p in self.posterior.known.items() if name in effects)

    def likeness(self, name: str) -> float:
        """The probability that an effect is missing, whatever else is."""
        return self.posterior.of([name])

    def as_json(self) -> dict[str, Any] | None:
        """{"named": {id: p}, "none": p, "something_else": p}, which add up to 1, several effects by the likeliest of
        them; None where the data cannot tell."""
        if self.verdict == UNDETERMINED:
            return None
        named: dict[str, float] = {}
        for effects, p in self.posterior.known.items():
            if effects:
                first = max(effects, key=self.confidence)
                named[first] = named.get(first, 0.0) + p
        return {"named": named, "none": self.posterior.none, "something_else": self.posterior.something_else}


def decide(law: Law, findings: Findings) -> Decision:
    """The Decision that findings allow."""
    given = posterior(law, findings)
    best = max(given.known, key=lambda effects: given.known[effects])
    alike = {name: _alike(law, given, best, name) for name in best}
    sure = {name: given.of({name, *alike[name]}) for name in best if given.something_else <= 0.5}
    order = sorted((name for name in sure if _may_be_named(law, findings, name)), key=lambda name: -sure[name])
    named: list[str] = []
    for name in order:  # the expected share of false names (Mueller, Parmigiani and Rice 2007)
        if sum(1.0 - sure[n] for n in (*named, name)) <= law.alpha * (len(named) + 1):
            named.append(name)
    if set(named) & set(findings.together):
        named += [name for name in findings.together if name not in named]
    if named:
        verdict = EFFECT
    elif not findings.has_floor:
        verdict = UNDETERMINED
    else:
        verdict = NONE if given.none >= given.something_else else UNKNOWN
    return Decision(verdict, tuple(named), alike, given)


def posterior(law: Law, findings: Findings) -> Posterior:
    """The Posterior of all models; of fits of the same effects the best one counts. Later steps have other weights:
    their models are compared with their own base, which is as likely as the first step has it."""
    known: dict[Effects, float] = {}
    unknown: dict[Effects, float] = {}
    for step in findings.steps():
        floor = np.minimum(1.0, np.min([_left(findings, step[0], m) for m in step], axis=0))
        logs = [(tuple(sorted(m.effects)), *log_evidence(law, findings, m, step[0], floor)) for m in step]
        base, offset = logs[0][0], 0.0
        if known:  # what took another effect's place on the way is as likely as the best of its size
            alike = [value for effects, value in known.items() if len(effects) == len(base)]
            before = known.get(base, max(alike, default=max(known.values())))
            offset = before - logs[0][1]
            unknown.pop(base, None)
        for effects, alone, beside in logs:
            known[effects] = max(known.get(effects, -np.inf), alone + offset)
            unknown[effects] = max(unknown.get(effects, -np.inf), beside + offset)
    most = max(chain(known.values(), unknown.values()))
    total = float(sum(np.exp(value - most) for value in chain(known.values(), unknown.values())))
    share = lambda logs: {e: float(np.exp(value - most)) / total for e, value in logs.items()}  # noqa: E731
    return Posterior(share(known), share(unknown))


def log_evidence(
    law: Law, findings: Findings, model: ModelRecord, base: ModelRecord, floor: Values
) -> tuple[float, float]:
    """(log of prior times marginal likelihood of a model, the same beside something else), up to a constant that all
    models on top of a base share. floor: mean square of each view that no discrepancy goes below. What was not
    computed of a model is as the base has it."""
    fitted, left = model if model.freedom else base, _left(findings, base, model)
    told = 2.0 / (2.0 + law.discrepancy * findings.independent)
    common = len(model.effects) * log(law.more / max(findings.tried, 1)) - model.choice_nats
    common += _volume(fitted.freedom, told) - 0.5 * (fitted.strain or 0.0)
    if model.channel == Channel.STATIC_FIELD.value or model.own_nats is not None:
        common -= 0.5 * log(2.0 / law.discrepancy)  # a deviation alone is free (Schwarz 1978)
    if model.own_nats is not None:
        gain = len(left) / law.discrepancy * -log(max(1.0 - model.own_share, 1.0 - _MOST))
        common += max(min(model.own_nats, gain), 0.0)
    # Draws look like structure where none of them was taken off: what else is beside them is not known then.
    drawn = model.channel == Channel.STATIC_FIELD.value and model.structure is None
    missing = np.maximum(0.0 if drawn else model.structure or base.structure or 0.0, fitted.varying)
    missing = np.clip(missing, 0.0, np.clip(left - floor, 0.0, _MOST * left))
    beside = left - missing
    narrow = -np.log(left) / law.discrepancy
    broad = -np.log(beside) / law.discrepancy + _broad(law, missing / beside, law.discrepancy)
    known = common + narrow.sum() + log(1.0 - law.something_else)
    unknown = common + _somewhere(law, narrow, broad) + log(law.something_else)
    if model.effects:
        return float(known), float(unknown)
    # What a view's frames do not share, and what has no structure, is known of nothing else: it tells only whether
    # something is missing where no effect is.
    size, mean = _of_none(law, findings)
    narrow = np.append(narrow, -size / mean)
    odds = _somewhere(law, narrow, np.append(broad, _broad(law, size, mean))) - narrow.sum()
    odds += log(law.something_else / (1.0 - law.something_else))
    both = np.logaddexp(known, unknown)
    return float(both - np.logaddexp(0.0, odds)), float(both - np.logaddexp(0.0, -odds))


def _somewhere(law: Law, narrow: Values, broad: Values) -> float:
    """log of the likelihood where something else shows in some view: narrow, broad are each one's without and with."""
    without = np.log1p(-law.shows) + narrow
    somewhere = np.logaddexp(without, np.log(law.shows) + broad).sum()
    return float(somewhere + np.log1p(-np.exp(min(without.sum() - somewhere, -1e-12))))


def _left(findings: Findings, base: ModelRecord, model: ModelRecord) -> Values:
    """The mean square that a model leaves of each view. The renderer's own noise, which stays between repeats, is no
    model's but a field's."""
    field = model.channel == Channel.STATIC_FIELD.value
    own = base.left if model.channel == Channel.NOISE_MODEL.value else model.left
    return np.maximum(np.array(own) - model.rounding - (0.0 if field else findings.white), _LEAST)


def _of_none(law: Law, findings: Findings) -> tuple[Values, Values]:
    """Further discrepancies where nothing is named, and their means."""
    plain = max(findings.plain - findings.white, 0.0)
    return np.array([findings.unsteady, plain]), np.array([law.discrepancy, law.rendering])


def _broad(law: Law, size: Values, mean: Values | float) -> Values:
    """log of Cauchy's density of a discrepancy, which something else makes, over the exponential one's at zero."""
    return np.log(2.0 / pi / law.largest * np.asarray(mean)) - np.log1p((size / law.largest) ** 2)


def _volume(freedom: Freedom | None, told: float) -> float:
    """Laplace's integral over the parameters, beside the best likelihood; those that are better left neutral are.
    told: the share of the information that counts."""
    if freedom is None or not freedom.away:
        return 0.0
    kept, best = list(range(len(freedom.away))), -np.inf
    while kept:
        value = _volume_of(freedom, kept, told)
        if value <= best:
            break
        best = value
        fewer = [[i for i in kept if i != gone] for gone in kept]
        kept = max(fewer, key=partial(_volume_of, freedom, told=told)) if len(kept) > 1 else []
    return best


def _volume_of(freedom: Freedom, kept: Sequence[int], told: float) -> float:
    away, density = np.array(freedom.away), np.array(freedom.log_density)
    information = told * np.array(freedom.information)
    used, unused = np.array(kept, dtype=np.int64), np.setdiff1d(np.arange(len(away)), kept)
    across, inner = information[np.ix_(unused, used)], information[np.ix_(used, used)]
    alone = information[np.ix_(unused, unused)] - across @ np.linalg.pinv(inner, hermitian=True) @ across.T
    loss = away[unused] @ alone @ away[unused]
    volume = np.log(2.0 * np.pi / (1.0 + np.maximum(np.linalg.eigvalsh(inner), 0.0)))
    return float(density[used].sum() + 0.5 * volume.sum() - 0.5 * max(loss, 0.0))


def _may_be_named(law: Law, findings: Findings, name: str) -> bool:
    """Whether an effect removes its share of the error, and views are predicted better with it than without, as far as
    that is known."""
    closed, predicts = [], []
    for step in findings.steps():
        for model in (m for m in step if m.channel and m.effects[-1] == name):
            if model.closed_low is not None:
                closed.append(model.closed_low >= law.least_share)
            if model.left_out is not None and step[0].left_out is not None:
                predicts.append(sum(model.left_out) < sum(step[0].left_out))
    return all(not known or any(known) for known in (closed, predicts))


def _alike(law: Law, given: Posterior, best: Effects, name: str) -> Effects:
    """The effects that stand for one as well in models of as many, likeliest first: each took another's place in a
    model that predicts like the best one."""
    sets = [set(e) for e, p in given.known.items() if len(e) == len(best) and p >= law.alike * given.known[best]]
    swaps = [(*(a - b), *(b - a)) for a, b in permutations(sets, 2) if len(a - b) == 1]
    alike = {name}
    while more := {new for old, new in swaps if old in alike} - alike - set(best):
        alike |= more
    chance = {one: sum(p for effects, p in given.known.items() if one in effects) for one in alike - {name}}
    return tuple(sorted(chance, key=lambda one: -chance[one]))
