# SPDX-License-Identifier: Apache-2.0
"""Ranks effects by how likely they are missing. Bayes factors of all atoms (trial shapes of an effect) are averaged per
effect. Errors of formulas are allowed for: what a named effect's formula misses is not another effect.

A coefficient has a normal prior. The likelihood is tempered, because a residual that no effect explains counts as
noise. The residual of a formula looks like the effect itself, weighted by image position or by brightness, or like its
smooth part (such as glare that fades with distance).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES
from activestereo.diagnose.dictionary import Atom, first_dictionary
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.fitter import Fitter, Solution
from activestereo.diagnose.kept import FitCache
from activestereo.diagnose.linear import Columns, Linear, Scores, score_alone, scores
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.pixels import SCALES
from activestereo.effects import Effect, Model, builtin
from activestereo.effects.core.surfaces import SURFACES

# A coefficient with less information than this stays 0.
_LEAST = 1e-3
# A surface shows an effect if it gains this part of the best surface's gain.
_SHOWS = 0.05
# Fits start at so many atoms with fitted coefficients, and at so many points of the dictionary with this part of the
# best gain. Where a coefficient leads a narrow peak farther than this factor, the peak itself is a start, too.
_LINES, _POINTS, _NEAR, _FAR = 2, 2, 0.3, 1.1
_FIRST_NAMES = 3  # most effects that the first words name


@dataclass(frozen=True)
class Hit:
    """The linear fit of one atom (a trial shape of an effect) to the residual. surfaces: indices of the surfaces that
    it acts on, None = all. coefficients: of the atom's columns, under their priors. log_factor: log Bayes factor
    against no effect, nats. gain: fall of chi2 by the best coefficients without priors. at_point: the fall at the
    atom's own parameters."""

    atom: Atom
    surfaces: tuple[int, ...] | None
    coefficients: NDArray[np.float64]
    log_factor: float
    gain: float
    at_point: float

    def values(self) -> dict[str, float]:
        """Returns the effect's parameters at the fitted coefficients."""
        return self._at(self.coefficients)

    def point(self) -> dict[str, float]:
        """Returns {parameter: value} of the atom itself, before any fit."""
        return self._at(np.eye(1, len(self.coefficients))[0])

    def _at(self, coefficients: NDArray[np.float64]) -> dict[str, float]:
        values, parameters = dict(self.atom.values), {p.name: p for p in self.atom.effect.parameters}
        (lead, step), *more = self.atom.steps
        values[lead] = parameters[lead].neutral + coefficients[0] * step
        for (name, step), b in zip(more, coefficients[1:], strict=True):
            values[name] += b * step
        if self.surfaces is not None:
            values[SURFACES.name] = float(sum(2**k for k in self.surfaces))
        return {name: float(np.clip(v, parameters[name].low, parameters[name].high)) for name, v in values.items()}


@dataclass(frozen=True)
class Candidate:
    """An effect's linear fits over all its trial shapes. best: the fit with the largest Bayes factor. evidence: log of
    the mean Bayes factor, nats. starts: (atom, parameters) pairs from which a full fit may start."""

    best: Hit
    evidence: float
    starts: tuple[tuple[Atom, dict[str, float]], ...]

    @property
    def id(self) -> str:
        return self.best.atom.effect.id

    @property
    def gain(self) -> float:
        return self.best.gain


def candidates(atoms: Sequence[Atom], scores: Scores, pixels: int) -> dict[str, Candidate]:
    """Ranks effects by the scores of their atoms; returns {effect: Candidate}, likeliest first. Effects without gain
    are left out. pixels: gains are scaled to this number of pixels."""
    hits: dict[str, list[Hit]] = {}
    temper, times = max(scores.total / scores.pixels, 1e-3), pixels / scores.pixels
    for atom in atoms:
        found = [_hit(atom, scores, temper, None)]
        if SURFACES in atom.effect.parameters and len(scores.surfaces) > 1:
            each = [_hit(atom, scores, temper, (k,)) for k in scores.surfaces]
            showing = tuple(h.surfaces[0] for h in each if h.gain > _SHOWS * max(o.gain for o in each) and h.surfaces)
            found += each
            if 1 < len(showing) < len(each):
                found.append(_hit(atom, scores, temper, showing))
        hits.setdefault(atom.effect.id, []).extend(
            replace(h, gain=times * h.gain, at_point=times * h.at_point) for h in found
        )
    out = {name: _candidate(rows) for name, rows in hits.items() if max(row.gain for row in rows) > 0.0}
    return dict(sorted(out.items(), key=lambda item: -item[1].evidence))


def first_words(evidence: Evidence, model: Model, effects: Sequence[Effect], numbers: Numbers, memory: FitCache) -> str:
    """Returns a clause that names the likeliest effects before anything is fitted: by their scores at the stated poses.
    memory: keeps the image changes, which the search scores again."""
    if all(np.ptp(o.measured) == 0 for o in evidence.train):
        return "the infrared images are blank"
    first = first_dictionary(evidence, model, effects, numbers.prior_reach, memory)
    likely = list(candidates(first.atoms, scores(first.linear, first.columns), evidence.pixels))
    return f"looks like {', '.join(likely[:_FIRST_NAMES])}" if likely else "no effect of images fits"


def own_ranks(found: Mapping[str, Candidate], chi2: float) -> list[str]:
    """Returns a sentence on the rank of each user-defined effect among all scores."""
    best, out = max(c.gain for c in found.values()), []
    for rank, (name, c) in enumerate(found.items(), 1):
        if builtin().get(name) is not c.best.atom.effect:
            shares = f"{100 * c.gain / chi2:.1f} % of the error, the best one {100 * best / chi2:.1f} %"
            out.append(f"{name} ranks {rank} of {len(found)} by its score: it explains {shares}")
    return out


def _candidate(hits: list[Hit]) -> Candidate:
    hits = sorted(hits, key=lambda hit: -hit.log_factor)
    best = hits[0]
    evidence = best.log_factor + np.log(np.exp([h.log_factor - best.log_factor for h in hits]).sum() / len(hits))
    if best.atom.effect.starts is not None:  # each of its points is a narrow peak of its own
        peaks = [h for h in hits if h.gain > 0.0]
        starts = [(h.atom, h.values()) for h in peaks]
        starts += [(h.atom, h.point()) for h in peaks if not 1.0 / _FAR < h.coefficients[0] < _FAR]
        return Candidate(best, float(evidence), tuple(starts))
    points = sorted((h for h in hits if h.gain > _NEAR * best.gain and h.at_point > 0.0), key=lambda h: -h.at_point)
    starts = [(h.atom, h.values()) for h in hits[:_LINES] if h.gain > 0.0]
    starts += [(h.atom, h.point()) for h in points[:_POINTS]]
    return Candidate(best, float(evidence), tuple(starts))


def _hit(atom: Atom, scores: Scores, temper: float, surfaces: tuple[int, ...] | None) -> Hit:
    S, u = scores.select(atom.columns(), surfaces)
    on, gain = _within_signs(S, u, atom.signed)
    coefficients = np.zeros(len(u))
    at_point = float(2.0 * u[0] - S[0, 0])
    if gain <= 0.0:
        return Hit(atom, surfaces, coefficients, -1.0, 0.0, at_point)
    prior = np.array(atom.sigma)[on]
    s, v = S[np.ix_(on, on)] / temper, u[on] / temper
    coefficients[on] = np.linalg.solve(s + np.diag(prior**-2.0), v)
    volume = np.linalg.slogdet(np.eye(len(on)) + prior[:, None] * s * prior)[1]
    signs = sum(not atom.signed[j] for j in on) * np.log(2.0)
    factor = 0.5 * coefficients[on] @ v - 0.5 * volume + signs
    return Hit(atom, surfaces, coefficients, float(factor), gain, at_point)


def _within_signs(S: NDArray[np.float64], u: NDArray[np.float64], signed: Sequence[bool]) -> tuple[list[int], float]:
    """Returns (indices of the coefficients that are not 0, fall of chi2) of the best fit with the signs allowed."""
    free = [j for j in range(len(u)) if S[j, j] > _LEAST]
    while free:
        ridge = 1e-6 * np.diag(np.diag(S)[free])
        b = np.linalg.solve(S[np.ix_(free, free)] + ridge, u[free])
        bad = [j for j, x in zip(free, b, strict=True) if x < 0.0 and not signed[j]]
        if not bad:
            return free, float(b @ u[free])
        free = [j for j in free if j not in bad]
    return [], 0.0


def freed(linear: Linear, effects: Iterable[Effect], share: float) -> Linear:
    """Returns the linear model with extra nuisances that absorb the error of each named effect's formula. They are the
    effect's image change times image position, squared distance from the centre, or brightness, and its mean over
    tiles. share: prior variance of each coefficient."""
    model = linear.solution.model
    here = linear.images(model)
    fields = [(p, *p.observation.view.field()) for p in linear.fitter.pixels()]
    places = ([p.gather(np.asarray(by)) for by in (u, v, u**2 + v**2)] for p, u, v in fields)
    weights = [np.concatenate(by) for by in (*zip(*places, strict=True), here)]
    rows = [-linear.change(model.without_effect(e.id), here) for e in effects]
    added = [row * standard for row in rows for weight in weights if (standard := _standard(weight, row)) is not None]
    added += [_smooth(linear, row) for row in rows]
    if not added:
        return linear
    return replace(
        linear,
        nuisances=np.concatenate([linear.nuisances, np.stack(added).astype(np.float32)]),
        precision=np.concatenate([linear.precision, np.full(len(added), 1.0 / share)]),
        pull=np.concatenate([linear.pull, np.zeros(len(added))]),
    )


def gain_beyond(linear: Linear, fit: Solution) -> float:
    """Returns the fall of chi2 by the part of a fit's image change that no nuisance of the linear model can imitate."""
    left = linear.fitter.residuals(fit)
    pairs = zip(linear.fitter.pixels(), left, strict=True)
    change = linear.residual - np.concatenate([p.gather(row.residual) * p.root_weight for p, row in pairs])
    information, score = score_alone(linear, change.astype(np.float32))
    return score**2 / max(information, 1e-9)


def other_law(linear: Linear, missed: Mapping[str, float]) -> float:
    """Returns Remainder.by_frame: by how much chi2 falls if a drift acts in each frame by an amplitude of its own. A
    lens that grows with time, for example, moves the images of cold frames, too. missed: {effect: the fall of chi2 per
    pixel that its formula may miss}, the unit."""
    model = linear.solution.model
    drifts = [e for e, _ in model.effects if e.id in missed and any(p.drifts for p in e.parameters)]
    if not drifts:
        return 0.0
    fitter, there = linear.fitter, []
    warmest = max(fitter.observations, key=lambda o: abs(o.view.warming_k)).frame.temperature_c
    for o in fitter.observations:
        frame = replace(o.frame, temperature_c=warmest)
        there.append(replace(o, frame=frame, view=replace(o.view, frame=frame)))
    warm = replace(linear, fitter=Fitter(there, fitter.nuisance_prior, 1))
    images = warm.images(model)
    frame_of = np.concatenate([np.full(len(p.index), p.observation.frame.id) for p in fitter.pixels()])
    is_in, ratios = [frame_of == id for id in np.unique(frame_of)], []
    for effect in drifts:
        change = warm.change(model.without_effect(effect.id), images)
        information, score = scores(linear, np.stack([change * here for here in is_in])).select(slice(None))
        gain = _within_signs(information, score, [True] * len(score))[1]
        ratios.append(gain / len(linear.residual) / missed[effect.id])
    return max(ratios)


def stand_ins(
    linear: Linear, effect: Effect, atoms: Sequence[Atom], columns: Columns, floor: float, numbers: Numbers
) -> list[str]:
    """Returns the ids of other effects that can imitate one parameter of a named effect: the change by an amplitude, or
    by a step of one typical value in a shape. For example, a black level that moves with temperature can imitate the
    doubling temperature of a dark signal. atoms, columns: the other effects' trial shapes and image changes. floor:
    image changes with a smaller chi2 per pixel are ignored."""
    space, model = linear.solution.space, linear.solution.model
    own, values = next((e, values) for e, values in model.effects if e.id == effect.id)
    here, out = linear.images(model), dict[str, None]()
    for i in (i for i, (e, p) in enumerate(space.pairs) if atoms and e.id == effect.id and not p.choice):
        p = space.pairs[i][1]
        usual = values[p.name] + p.typical if p.neutral else 0.0
        usual = usual if usual <= p.high else max(values[p.name] - p.typical, p.low)
        change = linear.change(model.with_effect(own, **values | {p.name: usual}), here)
        rest = {name: np.delete(getattr(linear, name), i, axis=0) for name in ("nuisances", "precision")}
        alone = replace(linear, **rest, pull=np.zeros(len(rest["precision"])), residual=change)
        seen = scores(alone, columns)
        found = candidates(atoms, seen, seen.pixels) if seen.total > floor * seen.pixels else {}
        out |= dict.fromkeys(name for name, c in found.items() if c.gain > (1.0 - numbers.formula_error) * seen.total)
    return list(out)


def most_like_rig(linear: Linear, atoms: Sequence[Atom], columns: Columns) -> tuple[Effect, dict[str, float]]:
    """Returns (effect, its parameters) of the trial shape whose image change is most like the change by the corrections
    of focal lengths and poses, from the stated to the fitted ones. atoms, columns: the trial shapes and their image
    changes."""
    fitter, (phi, own) = linear.fitter, (linear.solution.phi, len(linear.solution.theta) + SCALES)
    moved = phi[SCALES:] - fitter.nuisance_prior.value
    moved[len(SIDES) : len(SIDES) + fitter.materials] = 0.0
    change = moved.astype(np.float32) @ linear.nuisances[own : own + len(moved)]
    first = columns[[atom.first for atom in atoms]]
    alike = first @ change
    norms = np.maximum((first**2).sum(axis=1), _LEAST)
    best = int(np.argmax(alike**2 / norms))
    effect, (name, step) = atoms[best].effect, atoms[best].steps[0]
    lead = next(p for p in effect.parameters if p.name == name)
    value = float(np.clip(lead.neutral + step * alike[best] / norms[best], lead.low, lead.high))
    return effect, {**atoms[best].values, name: value}


def _smooth(linear: Linear, row: Columns) -> Columns:
    """Returns the means over tiles of an image change `row`, scaled to the same norm."""
    pixels = linear.fitter.pixels()
    tile, root = (np.concatenate(x) for x in ([p.tile for p in pixels], [p.root_weight for p in pixels]))
    mean = np.bincount(tile, row / np.maximum(root, 1e-12)) / np.maximum(np.bincount(tile), 1)
    smooth = mean[tile] * root
    return np.asarray(smooth * np.sqrt(float(row @ row) / max(float(smooth @ smooth), 1e-12)), np.float32)


def _standard(weight: NDArray[np.float64], change: Columns) -> NDArray[np.float64] | None:
    """Returns a weight [n] scaled to mean 0 and deviation 1 under the squared change; None if it is constant."""
    square = change.astype(np.float64) ** 2
    total = max(float(square.sum()), 1e-12)
    away = weight - float(weight @ square) / total
    deviation = np.sqrt(float(away**2 @ square) / total)
    return away / deviation if deviation > 1e-6 * max(np.abs(weight).max(), 1e-12) else None
