# SPDX-License-Identifier: Apache-2.0
"""Compares how simulated worlds and a real one rank methods: `activestereo benchmark sim-to-real SCORES.csv`.

Scores are read from CSV tables with one of two headers:

    criterion,method,world,view,found         found: 1 where the method succeeds at a view, else 0
    criterion,method,world,score              score: share of the views, 0 to 1

Each method needs a score for each world, criterion and view. 95 % intervals come from resampling views, the same ones
in both worlds (Efron and Tibshirani, An Introduction to the Bootstrap, 1993, ch. 6). A `score` is not resampled."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from math import isnan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from activestereo.common.input_files import read_text
from activestereo.common.shown import listed
from activestereo.common.text_table import markdown

_DRAWS, _LEVEL = 2000, 0.95
_HEAD = ("criterion", "method", "world")
_FORMS = ((*_HEAD, "view", "found"), (*_HEAD, "score"))


@dataclass(frozen=True)
class Figure:
    """A value with its 95 % interval; NaN = undefined, because all scores of a world are equal."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return "–" if isnan(self.value) else f"{self.value:.2f} ({self.low:.2f} to {self.high:.2f})"


@dataclass(frozen=True)
class Agreement:
    """Measures how well two worlds agree in their scores of methods. pearson, spearman: correlation of the scores over
    the methods. gap: mean absolute difference of the scores."""

    pearson: Figure
    spearman: Figure
    gap: Figure

    def as_json(self) -> dict[str, list[float | None]]:
        """Returns {figure: [value, low, high]}; null for an undefined number."""
        return {name: [None if isnan(v) else v for v in figure.values()] for name, figure in asdict(self).items()}


def pearson(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns Pearson's correlation, [...], of scores [..., methods]; NaN where all of a or all of b are equal."""
    a, b = a - a.mean(axis=-1, keepdims=True), b - b.mean(axis=-1, keepdims=True)
    scale = np.sqrt((a * a).sum(axis=-1) * (b * b).sum(axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(scale > 1e-12, (a * b).sum(axis=-1) / scale, np.nan))


def spearman(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns pearson() of the scores' ranks; equal scores share their mean rank."""
    return pearson(rankdata(a, axis=-1), rankdata(b, axis=-1))


def mean_gap(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the mean absolute difference, [...], of scores [..., methods]."""
    return np.asarray(np.abs(a - b).mean(axis=-1))


def agreement(
    simulated: NDArray[np.bool_], real: NDArray[np.bool_], seed: int = 0,
    known: tuple[Sequence[float], Sequence[float]] = ((), ()),
) -> Agreement:  # fmt: skip
    """Computes the Agreement of two worlds from the methods' successes [methods, views]. known: (simulated, real)
    scores of further methods, which have no views to resample. Raises ValueError if the two differ in methods or
    views."""
    if simulated.shape != real.shape or simulated.ndim != 2:
        raise ValueError(f"successes of both worlds are [methods, views], not {simulated.shape} and {real.shape}")
    views = simulated.shape[1]
    drawn = np.random.default_rng(seed).multinomial(views, np.full(views, 1.0 / views), _DRAWS) / views
    scores = []
    for own, more in zip((simulated, real), known, strict=True):
        draws = drawn @ own.T.astype(np.float64)
        fixed = np.broadcast_to(np.array(more, np.float64), (_DRAWS, len(more)))
        scores.append((np.append(own.mean(axis=1), more), np.concatenate([draws, fixed], axis=1)))
    figures = []
    for measure in (pearson, spearman, mean_gap):
        value = float(measure(*(own for own, _ in scores)))
        draws = measure(*(draw for _, draw in scores))
        draws = draws[np.isfinite(draws)]
        tail = 50.0 * (1.0 - _LEVEL)
        low, high = np.percentile(draws, (tail, 100.0 - tail)) if draws.size else (np.nan, np.nan)
        figures.append(Figure(value, float(low), float(high)))
    return Agreement(*figures)


Scores = dict[str, dict[str, dict[str, NDArray[np.float64]]]]  # criterion, method, world: [views], or one score


def read_scores(paths: Sequence[Path]) -> Scores:
    """Reads the scores of CSV tables, {criterion: {method: {world: [views]}}}. Raises ValueError with the line or the
    missing part."""
    values: dict[tuple[str, str], dict[str, dict[str, float]]] = {}
    for path in paths:
        for line, (criterion, method, world, view, value) in _rows(path):
            own = values.setdefault((criterion, method), {}).setdefault(world, {})
            if view in own:
                raise ValueError(f"{path}, line {line}: {method} has this line twice")
            own[view] = value
    worlds = list(dict.fromkeys(world for own in values.values() for world in own))
    every = {view for own in values.values() for of_views in own.values() for view in of_views if view}
    out: Scores = {}
    for (criterion, method), of_worlds in values.items():
        views = sorted(every) if any(view for of_views in of_worlds.values() for view in of_views) else [""]
        for world in worlds:
            if missing := [view for view in views if view not in of_worlds.get(world, {})]:
                place = f" view {missing[0]} in" if missing[0] else ""
                raise ValueError(f"{paths[-1]}: {method} has no line of{place} {world}, criterion {criterion}")
        out.setdefault(criterion, {})[method] = {w: np.array([of_worlds[w][view] for view in views]) for w in worlds}
    return out


def _rows(path: Path) -> Iterator[tuple[int, tuple[str, str, str, str, float]]]:
    try:
        rows = list(csv.reader(io.StringIO(read_text(path, "utf-8-sig"), newline="")))  # Excel writes a mark
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}: is not a table of text: {error}") from error
    columns = tuple(word.strip() for word in rows[0]) if rows else ()
    if columns not in _FORMS or len(rows) < 2:
        forms = " or ".join(",".join(form) for form in _FORMS)
        raise ValueError(f"{path}: the first line is '{','.join(columns)}', expected {forms} and then scores")
    for line, row in enumerate(rows[1:], 2):
        words = [word.strip() for word in row]
        if not words:
            continue
        if len(words) != len(columns) or not all(words):
            raise ValueError(f"{path}, line {line}: has {sum(map(bool, words))} values, expected {len(columns)}")
        try:
            value = float(words[-1])
        except ValueError:
            value = float("nan")
        if not (value in (0.0, 1.0) if columns[-1] == "found" else 0.0 <= value <= 1.0):
            raise ValueError(
                f"{path}, line {line}: {columns[-1]} is {words[-1]}, expected 0 {'or' if 'view' in columns else 'to'} 1"
            )
        criterion, method, world, *view = words[:-1]
        yield line, (criterion, method, world, view[0] if view else "", value)


def agreements(scores: Scores, real: str, seed: int = 0) -> dict[str, dict[str, Agreement]]:
    """Computes {criterion: {world: Agreement with the world `real`}} for all other worlds. Raises ValueError if `real`
    has no scores, or there is only one method."""
    out: dict[str, dict[str, Agreement]] = {}
    for criterion, methods in scores.items():
        worlds = next(iter(methods.values())).keys()
        if real not in worlds:
            raise ValueError(f"no scores are of the world '{real}' (known: {', '.join(worlds)}): --real names it")
        if len(worlds) < 2:
            raise ValueError(f"all scores are of the world '{real}', and none of a simulated one to rank beside it")
        if len(methods) < 2:
            raise ValueError(f"criterion {criterion}: a ranking needs two methods, not one")
        drawn = [own for own in methods.values() if len(own[real]) > 1]
        fixed = [own for own in methods.values() if len(own[real]) == 1]
        views = len(drawn[0][real]) if drawn else 1
        found = {w: np.array([own[w] > 0.0 for own in drawn], bool).reshape(len(drawn), views) for w in worlds}
        known = {world: [float(own[world][0]) for own in fixed] for world in worlds}
        out[criterion] = {
            world: agreement(found[world], found[real], seed, (known[world], known[real]))
            for world in worlds
            if world != real
        }
    return out


def closest(found: dict[str, dict[str, Agreement]], real: str) -> tuple[str, str]:
    """Returns (a sentence, the name of the world whose scores correlate best with the real ones, in the mean over the
    criteria). found: as agreements() returns it, of one world at least. The sentence also names worlds whose intervals
    reach the best world's value."""
    worlds = list(next(iter(found.values())))
    figures = {w: [own[w].pearson for own in found.values() if not isnan(own[w].pearson.value)] for w in worlds}
    if not any(figures.values()):
        return f"Nothing ranks: each world, or {real}, gives all methods one score.", worlds[0]
    value = {w: float(np.mean([own.value for own in figures[w]])) if figures[w] else -1.0 for w in worlds}
    best = max(worlds, key=value.__getitem__)
    gap = np.mean([own[best].gap.value for own in found.values()])
    rivals = [
        w for w in worlds if w != best and figures[w] and np.mean([own.high for own in figures[w]]) >= value[best]
    ]
    others = f"; {listed(rivals)} may do as well" if rivals else ""
    said = f"correlation {value[best]:.2f}, scores {100.0 * gap:.0f} points apart in the mean"
    return f"{best} ranks the methods most as {real} does: {said}{others}.", best


def agreement_table(found: dict[str, dict[str, Agreement]]) -> list[str]:
    """Returns Markdown lines of a table that shows how each world agrees with the real one."""
    return markdown(
        ("criterion", "ranked in", "Pearson", "Spearman", "mean gap"),
        [
            (criterion, f"`{world}`", own.pearson, own.spearman, own.gap)
            for criterion, worlds in found.items()
            for world, own in worlds.items()
        ],
    )
