# SPDX-License-Identifier: Apache-2.0
"""The dictionary of a search: how each effect changes the expected images, at a few amplitudes and shapes.

A column is the exact difference of two expected images, not a derivative: dots that move or clip are far from linear.
Effects whose likelihood has narrow peaks propose their own trial parameters (Effect.starts).
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from mmap import mmap

import numpy as np
from numpy.typing import NDArray

from activestereo.common.processes import forked
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.fitter import Fitter
from activestereo.diagnose.kept import FitCache, content_key, effect_content
from activestereo.diagnose.linear import Columns, Linear, as_gathered
from activestereo.diagnose.pixels import SCALES, AllPixels, exposed
from activestereo.effects import Effect, Model, Parameter, Stage
from activestereo.effects.core.descriptor import Channel, StartImage
from activestereo.effects.core.model import scales

# Amplitudes in typical values; parts of a short range, for effects that act near a threshold; the largest numbers of
# shapes of an effect and of its own proposals.
_AMPLITUDES, _PARTS, _SHORT = (0.5, 3.0), (0.5, 0.65, 0.8), 4.0
_MOST_SHAPES, _MOST_PROPOSED = 6, 4


@dataclass(frozen=True)
class Atom:
    """One trial shape of an effect. Its image changes are one or more columns of the dictionary, each with a free
    coefficient.

    values: the effect's parameters at coefficient 1 of the first column and 0 of the others. steps: for each column,
    (the parameter that it changes, the change per unit of coefficient). signed: whether each coefficient may be
    negative. sigma: prior standard deviation of each coefficient. first: index of the first column in the dictionary.
    """

    effect: Effect
    values: Mapping[str, float]
    steps: tuple[tuple[str, float], ...]
    signed: tuple[bool, ...]
    sigma: tuple[float, ...]
    first: int

    def columns(self) -> slice:
        """Returns the slice of the dictionary that holds this atom's columns."""
        return slice(self.first, self.first + len(self.steps))


@dataclass(frozen=True)
class Dictionary:
    """The trial shapes of effects and their image changes. columns: of `atoms`, [columns][n] over the pixels of
    `linear`, in noise deviations. others: atoms without columns."""

    linear: Linear
    atoms: list[Atom]
    columns: Columns
    others: list[Atom]

    def grown(self, leads: Collection[str]) -> "Dictionary":
        """Returns the dictionary with columns of all shapes of the effects `leads`."""
        more, others = ([a for a in self.others if (a.effect.id in leads) == is_lead] for is_lead in (True, False))
        more = numbered(more)
        columns = np.concatenate([self.columns, columns_of(self.linear, more)])
        return Dictionary(self.linear, numbered([*self.atoms, *more]), columns, others)


def first_dictionary(
    evidence: Evidence, model: Model, effects: Sequence[Effect], reach: float, memory: FitCache | None
) -> Dictionary:
    """Returns a dictionary of the effects that change the expected images, but for those that start late. It has
    columns of their first_shapes() alone; their other trial shapes are in `others`. reach: prior standard deviation of
    an amplitude, in typical values. memory: keeps the columns."""
    linear = as_gathered(evidence, model, memory)
    at_once = [e for e in effects if e.channel is Channel.EXPECTED_IMAGE and not e.starts_late]
    atoms = atoms_of(linear, at_once, reach)
    first = first_shapes(atoms)
    others = [a for a in atoms if not any(a is tried for tried in first)]
    return Dictionary(linear, numbered(first), columns_of(linear, numbered(first)), others)


def atoms_of(linear: Linear, effects: Sequence[Effect], reach: float) -> list[Atom]:
    """Returns the trial shapes (atoms) of effects, at a few amplitudes and shape parameters each. reach: prior standard
    deviation of an amplitude, in typical values."""
    atoms: list[Atom] = []
    proposals = _proposals(linear, [e for e in effects if e.starts is not None])
    first = 0
    for effect in effects:
        for values, steps, sigma in _plans(effect, proposals.get(effect.id), reach):
            signed = tuple(p.low < p.neutral for p, _ in steps)
            atoms.append(Atom(effect, values, tuple((p.name, s) for p, s in steps), signed, sigma, first))
            first += len(steps)
    return atoms


def numbered(atoms: Sequence[Atom]) -> list[Atom]:
    """Returns the atoms with their columns renumbered from 0, as a dictionary without other atoms."""
    ends = np.cumsum([0, *(len(atom.steps) for atom in atoms)])
    return [replace(atom, first=int(first)) for atom, first in zip(atoms, ends, strict=False)]


def first_shapes(atoms: Sequence[Atom]) -> list[Atom]:
    """Returns one atom, of middle amplitude and shape, for each effect, parameter of a first column, and sign. Atoms
    that effects propose themselves are all returned."""
    groups: dict[object, list[Atom]] = {}
    for atom in atoms:
        name, step = atom.steps[0]
        group = atom.first if atom.effect.starts else (atom.effect.id, name, step > 0)
        groups.setdefault(group, []).append(atom)
    ascending = (sorted(group, key=lambda a: abs(a.steps[0][1])) for group in groups.values())
    return [group[len(group) // 2] for group in ascending]


def _proposals(linear: Linear, effects: Sequence[Effect]) -> dict[str, NDArray[np.float64]]:
    """Returns {effect: parameters [n][parameter]}, the trial parameters that effects propose (Effect.starts) near
    narrow likelihood peaks. NaN stands for a neutral value. The fitter's memory keeps them."""
    memory = linear.fitter.memory
    contents = {e.id: effect_content(e) for e in effects}
    keys = {name: c and content_key("starts", linear.residual, c) for name, c in contents.items()}
    seen = cache(lambda: start_images(linear))

    def proposed(effect: Effect) -> dict[str, NDArray[np.float64]]:
        assert effect.starts is not None
        starts = effect.starts(seen())[:_MOST_PROPOSED]
        values = [start.get(p.name, np.nan) for start in starts for p in effect.parameters]
        return {"starts": np.array(values).reshape(-1, len(effect.parameters))}

    def kept(effect: Effect) -> NDArray[np.float64]:
        found = proposed(effect) if memory is None else memory.once(keys[effect.id], lambda: proposed(effect))
        return found["starts"]

    if memory is not None and (new := [e for e in effects if keys[e.id] not in (None, *memory)]):
        seen()
        memory.make_ahead(kept, new)
    return {effect.id: kept(effect) for effect in effects}


def columns_of(linear: Linear, atoms: Sequence[Atom]) -> Columns:
    """Returns the image changes of all trial shapes, [columns][n], over the pixels of all observations, in noise
    standard deviations. The fitter's memory keeps the columns of built-in effects."""
    memory = linear.fitter.memory
    contents = {a.effect.id: effect_content(a.effect) for a in atoms}
    known, own = ([a for a in atoms if (contents[a.effect.id] is None) == is_own] for is_own in (False, True))
    if memory is None:
        stored = _compute_columns(linear, known)
    else:
        shapes = [(contents[a.effect.id], list(a.values.items()), a.steps) for a in known]
        key = content_key("columns", linear.residual, shapes)
        stored = memory.once(key, lambda: {"columns": _compute_columns(linear, known)})["columns"]
    if not own:
        return stored.astype(np.float32)
    columns = np.zeros((sum(len(a.steps) for a in atoms), len(linear.residual)), np.float32)
    for some, of_some in ((known, stored), (own, _compute_columns(linear, own))):
        for atom, alone in zip(some, numbered(some), strict=True):
            columns[atom.columns()] = of_some[alone.columns()]
    return columns


def _compute_columns(linear: Linear, atoms: Sequence[Atom]) -> NDArray[np.float16]:
    """Computes columns_of() without a cache, [columns][n]. float16 suffices, as its rounding is far below the noise."""
    if not atoms:
        return np.zeros((0, len(linear.residual)), np.float16)
    model = linear.solution.model
    images = linear.images(model)
    ends, pixels = np.cumsum([0, *(len(atom.steps) for atom in atoms)]), len(linear.residual)
    shared = mmap(-1, max(1, int(ends[-1]) * pixels) * np.dtype(np.float16).itemsize)
    columns = np.frombuffer(shared, np.float16)[: ends[-1] * pixels].reshape(ends[-1], pixels)

    def fill(i: int) -> None:
        atom, own = atoms[i], columns[ends[i] : ends[i + 1]]
        lead = linear.change(model.with_effect(atom.effect, **atom.values), images)
        own[0] = _in_halves(lead)
        if not lead.any() and len(own) > 1 and atom.effect.parameters[0].name != atom.steps[0][0]:
            return  # a drift that alone shows nothing is left to the atoms of the first amplitude
        for column, (name, step) in zip(own[1:], atom.steps[1:], strict=True):
            p = next(p for p in atom.effect.parameters if p.name == name)
            moved = dict(atom.values) | {name: min(atom.values[name] + step, p.high)}
            column[:] = _in_halves(linear.change(model.with_effect(atom.effect, **moved), images) - lead)

    workers = 1 if linear.fitter.memory is None else linear.fitter.memory.workers
    done = {i for i, work in forked(fill, range(len(atoms)), workers) if work.exception() is None}
    for i in range(len(atoms)):
        if i not in done:
            fill(i)
    return columns


def _in_halves(change: Columns) -> NDArray[np.float16]:
    most = np.finfo(np.float16).max
    return np.clip(change, -most, most).astype(np.float16)


def carried(columns: Columns, before: Fitter, after: Fitter) -> Columns:
    """Converts columns [columns][n] from the pixels and weights of one fitter to those of another. Pixels that the
    first fitter lacks get 0."""
    out = np.zeros((len(columns), sum(len(p.index) for p in after.pixels())), np.float32)
    first = start = 0
    for old, new in zip(before.pixels(), after.pixels(), strict=True):
        place = np.full(old.observation.measured.size, -1)
        place[old.index] = np.arange(len(old.index))
        there = place[new.index]
        ratio = new.root_weight / np.maximum(old.root_weight[there], 1e-12)
        ratio[(there < 0) | (old.root_weight[there] == 0.0)] = 0.0
        out[:, start : start + len(there)] = columns[:, first + np.maximum(there, 0)] * ratio.astype(np.float32)
        first, start = first + len(old.index), start + len(there)
    return out


def start_images(linear: Linear) -> list[StartImage]:
    """Returns a StartImage for each observation: the inputs from which effects propose their own trial points."""
    fitter, solution, images = linear.fitter, linear.solution, []
    phi, lights = solution.phi, fitter.lights(solution.space, solution.theta)
    for (o, expected, _, residual), light in zip(fitter.residuals(solution), lights, strict=True):
        slopes = exposed(solution.model, AllPixels(o), light, phi, True)[1]
        assert slopes is not None
        ambient = phi[1] * slopes[1].reshape(o.measured.shape)
        lit, ambient_dn = expected - phi[SCALES - 1], phi[1] * scales(o.frame)[1]
        images.append(StartImage(o.view, light, o.weight, residual, ambient, ambient_dn, lit))
    return images


_Plan = tuple[dict[str, float], list[tuple[Parameter, float]], tuple[float, ...]]


def _plans(effect: Effect, starts: NDArray[np.float64] | None, reach: float) -> Iterator[_Plan]:
    """Yields (values, steps, sigma) for each Atom of an effect, as defined there. starts: trial parameters that the
    effect proposes, [n][parameter], NaN = neutral; None if it proposes none. reach: as in atoms_of()."""
    if starts is not None:
        lead = effect.parameters[0]
        for start in starts:
            within = zip(effect.parameters, start, strict=True)
            values = {p.name: p.neutral if np.isnan(v) else float(np.clip(v, p.low, p.high)) for p, v in within}
            if values[lead.name] != lead.neutral:
                yield values, [(lead, values[lead.name] - lead.neutral)], (1.0,)
        return
    shapes = [p for p in effect.parameters if p.neutral != 0 and not p.choice]
    amplitudes = [p for p in effect.parameters if p.neutral == 0 and not p.choice]
    choices = list(product(*map(_ladder, shapes)))
    if len(choices) > _MOST_SHAPES:
        choices = [choices[k] for k in np.linspace(0, len(choices) - 1, _MOST_SHAPES).round().astype(int)]
    # A drift may be large though the constant error is zero.
    for lead in [p for p in amplitudes if p is amplitudes[0] or p.drifts]:
        others = [p for p in amplitudes if p is not lead] if lead is amplitudes[0] else amplitudes[:1]
        for level, choice in product(_levels(lead, effect.stage), choices):
            own = {p.name: v for p, v in zip(shapes, choice, strict=True)} | {lead.name: lead.neutral + level}
            steps = [(lead, level), *((p, p.typical) for p in others)]
            yield effect.neutral_values | own, steps, tuple(reach * p.typical / abs(step) for p, step in steps)


def _levels(p: Parameter, stage: Stage) -> list[float]:
    """Returns the amplitudes to try, relative to neutral. One suffices for a stage where images are linear in it;
    others need several, because dots move or pixels clip."""
    up, down = p.high - p.neutral, p.neutral - p.low
    if Stage.MEDIUM <= stage <= Stage.SURFACE or stage in (Stage.OPTICS, Stage.DIGITAL):
        return [min(p.typical, up)] if up > 0 else [-min(p.typical, down)]
    rising = [m * p.typical for m in _AMPLITUDES if m * p.typical <= up * (1 + 1e-9)] or [0.8 * up] * (up > 0)
    if stage >= Stage.CHARGE and 0 < up < _SHORT * p.typical:
        rising = sorted({*rising, *(part * up for part in _PARTS)})
    return rising + [-m * p.typical for m in _AMPLITUDES if m * p.typical <= down * (1 + 1e-9)]


def _ladder(p: Parameter) -> list[float]:
    """Returns the values of a shape parameter to try, ascending."""
    if p.low > 0:
        return sorted({p.neutral, *np.geomspace(max(p.low, 0.2 * p.neutral), min(p.high, 4 * p.neutral), 4).tolist()})
    return sorted({v for v in (p.neutral, p.neutral + p.typical, p.neutral - p.typical) if p.low <= v <= p.high})
