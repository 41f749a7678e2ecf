# SPDX-License-Identifier: Apache-2.0
"""The law of decision: posterior probabilities of models from their marginal likelihoods, and what may be named.

No model is exact. Formulas, and errors of the scene measurement that no nuisance takes, leave a discrepancy whose
mean square, in noise variances, is taken to be exponential with mean DISCREPANCY. This has two consequences. A
likelihood conditional on the data being that near to a model, not equal to it, is the usual one to the power
alpha / (alpha + n) with alpha = 2 / DISCREPANCY, so that images count as alpha pixels (Miller and Dunson 2019, Robust
Bayesian inference via coarsening, sections 2 and 3). And where something is missing that no effect of the library is,
the discrepancy is as large as effects are: that is the model of something else (Kennedy and O'Hagan 2001), whose
discrepancy is what both halves of the images agree on (score/structure.py).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, log, log1p, pi

import numpy as np

from activestereo.diagnose.decision.records import Findings, Freedom, ModelRecord

Effects = tuple[str, ...]
# A discrepancy explains at most this share of a residual.
_MOST = 0.95


@dataclass(frozen=True)
class Law:
    """discrepancy: mean square that a right model leaves, noise variances: the tempering exponent follows from it.
    something_else: prior probability of what the library lacks. more: prior probability of one more effect. alpha:
    expected share of false names. least_share: of the squared error above the floor, that a name removes. largest:
    scale of something else's mean square, noise variances. alike: ratio of probabilities within which two models
    predict alike."""

    discrepancy: float = 0.01
    something_else: float = 0.1
    more: float = 0.5
    alpha: float = 0.01
    least_share: float = 0.05
    largest: float = 1.0
    alike: float = 0.01
    left_out: bool = True
    use_strain: float = 1.0
    use_unsteady: float = 1.0

    @property
    def observations(self) -> float:
        """So many independent pixels the images count as."""
        return 2.0 / self.discrepancy


@dataclass(frozen=True)
class Posterior:
    """known: {effects: probability that they are what is missing, all of it}, () of nothing. unknown: the same where
    something else is missing, too. They add up to 1."""

    known: Mapping[Effects, float]
    unknown: Mapping[Effects, float]

    @property
    def none(self) -> float:
        return self.known.get((), 0.0)

    @property
    def something_else(self) -> float:
        return sum(self.unknown.values())


def log_evidence(law: Law, findings: Findings, model: ModelRecord, base: ModelRecord) -> tuple[float, float]:
    """(log of prior times marginal likelihood of a model, the same beside something else), up to a constant that all
    models on top of one base share. What was not computed of a model is as the base has it."""
    n, pixels = law.observations, float(sum(findings.pixels))
    chi2 = model.chi2
    if law.left_out and base.view_left_out:
        own = sum(model.view_left_out) if model.view_left_out else None
        chi2 = sum(base.view_left_out) + model.chi2 - base.chi2 if own is None else own
    left = max(chi2 / pixels - findings.white - model.rounding, 1e-3)
    fitted = model if model.freedom else base
    common = len(model.effects) * log(law.more / max(findings.tried, 1)) - model.choice_nats
    common += _occam(fitted.freedom, n / pixels) - 0.5 * law.use_strain * (fitted.strain or 0.0)
    if model.own_nats is not None:
        common += max(min(model.own_nats, -0.5 * n * log(max(1.0 - model.own_share, 1e-9))), 0.0)
    known = common - 0.5 * n * log(left)
    missing = max(float(np.mean(model.structure or base.structure or (0.0,))) + fitted.varying, 0.0)
    if model.effects == ():
        missing = max(missing, law.use_unsteady * findings.unsteady)
    missing = min(missing, _MOST * left)
    beside = left - missing
    # Cauchy's density of what is missing, exponential where nothing is.
    size = missing / beside / law.largest
    broad = log(2.0 / pi / law.largest) - log1p(size**2)
    unknown = common - 0.5 * n * log(beside) + broad + log(law.discrepancy)
    return known + log(1.0 - law.something_else), unknown + log(law.something_else)


def _occam(freedom: Freedom | None, part: float) -> float:
    """Laplace's volume of the parameters, of so large a part of the information; those that are better left neutral
    are."""
    if freedom is None or not freedom.away:
        return 0.0
    away, density = np.array(freedom.away), np.array(freedom.log_density)
    information = part * np.array(freedom.information)
    kept = list(range(len(away)))
    best = _volume(kept, away, density, information)
    while len(kept) > 1:
        fewer = [(_volume([i for i in kept if i != gone], away, density, information), gone) for gone in kept]
        value, gone = max(fewer)
        if value <= best:
            break
        best = value
        kept.remove(gone)
    return best


def _volume(kept: list[int], away: np.ndarray, density: np.ndarray, information: np.ndarray) -> float:
    used, unused = np.array(kept, dtype=np.int64), np.setdiff1d(np.arange(len(away)), kept)
    across, inner = information[np.ix_(unused, used)], information[np.ix_(used, used)]
    alone = information[np.ix_(unused, unused)] - across @ np.linalg.pinv(inner, hermitian=True) @ across.T
    loss = away[unused] @ alone @ away[unused]
    volume = np.log(2.0 * np.pi / (1.0 + np.maximum(np.linalg.eigvalsh(inner), 0.0)))
    return float(density[kept].sum() + 0.5 * volume.sum() - 0.5 * max(loss, 0.0))


def posterior(law: Law, findings: Findings) -> Posterior:
    """The Posterior of all models; of fits of the same effects the best one counts. Later steps have other weights:
    their models are compared with their own base, which is as likely as the first step has it."""
    logs: dict[tuple[Effects, bool], float] = {}
    for step in findings.steps():
        of_step = [(tuple(sorted(m.effects)), *log_evidence(law, findings, m, step[0])) for m in step]
        base = of_step[0][0]
        if base:
            before = max(
                (value for (effects, missing), value in logs.items() if not missing and effects == base), default=None
            )
            if before is None:  # swapped: as likely as what it stands for
                before = max(
                    value for (effects, missing), value in logs.items() if not missing and len(effects) == len(base)
                )
            offset = before - of_step[0][1]
            logs = {key: value for key, value in logs.items() if key[0] != base}
        else:
            offset = 0.0
        for effects, known, unknown in of_step:
            for value, missing in ((known, False), (unknown, True)):
                logs[effects, missing] = max(logs.get((effects, missing), -np.inf), value + offset)
    most = max(logs.values())
    weights = {key: exp(value - most) for key, value in logs.items()}
    total = sum(weights.values())
    of = [{e: w / total for (e, missing), w in weights.items() if missing == kind} for kind in (False, True)]
    return Posterior(*of)


@dataclass(frozen=True)
class Decision:
    """verdict: as diagnose.json has it. named: effects, likeliest first; equivalent: of each, what predicts alike."""

    verdict: str
    named: Effects
    equivalent: Mapping[str, Effects]
    posterior: Posterior


def decide(law: Law, findings: Findings) -> Decision:
    """The Decision that findings allow."""
    given = posterior(law, findings)
    best = max(given.known, key=lambda e: given.known[e])
    alike = {name: _alike(law, given, best, name) for name in best}
    sure = {name: _any_of(given, (name, *alike[name])) for name in best}
    closed = {m.effects: m.closed_low for m in findings.models}
    order = sorted((name for name in best if _closes(law, closed, name)), key=lambda name: -sure[name])
    named: list[str] = []
    for name in order:  # expected share of false names (Mueller, Parmigiani and Rice 2007)
        if sum(1.0 - sure[n] for n in (*named, name)) <= law.alpha * (len(named) + 1):
            named.append(name)
    if named:
        verdict = "effect"
    elif not findings.has_floor:
        verdict = "undetermined"
    else:
        verdict = "none" if given.none >= given.something_else else "unknown"
    return Decision(verdict, tuple(named), alike, given)


def _closes(law: Law, closed: Mapping[Effects, float | None], name: str) -> bool:
    lows = [low for effects, low in closed.items() if effects and effects[-1] == name and low is not None]
    return not lows or max(lows) >= law.least_share


def _alike(law: Law, given: Posterior, best: Effects, name: str) -> Effects:
    rest = set(best) - {name}
    others = {e for effects in given.known for e in effects if len(effects) == len(best) and rest <= set(effects)}
    out = []
    for other in sorted(others - set(best)):
        p = given.known.get(tuple(sorted(rest | {other})), 0.0)
        if p >= law.alike * given.known[best]:
            out.append((p, other))
    return tuple(other for _, other in sorted(out, reverse=True))


def _any_of(given: Posterior, names: Effects) -> float:
    return sum(p for effects, p in given.known.items() if set(effects) & set(names))
