# SPDX-License-Identifier: Apache-2.0
"""How much likelier each effect makes a room's images than none does, with textures and calibration left free.

The scores s of all columns are N(0, V + H (D + P) H): V their covariance, from tiles (the sandwich; White 1982); H the
information; D what sessions of good units differ by; P an effect's prior. Few sessions tell D, so that evidence counts
as Student's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.room.cells_out import Normal
from activestereo.diagnose.room.columns import Column
from activestereo.effects import Effect

# Of V, the share that independent tiles make up: their own scatter is known from a few dozen of them.
_BY_TILES, _INFLATED = 0.7, 1.5
_RIDGE = 1e-9
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Reduced:
    """Scores of the columns that are asked about, all other nuisances projected out: score [c], information and
    covariance [c][c] of it."""

    columns: tuple[Column, ...]
    score: Matrix
    information: Matrix
    covariance: Matrix


@dataclass(frozen=True)
class Found:
    """An effect's evidence in nats, by its tempered and Student's likelihood, and parameters {name: (value, deviation)}
    as a fit beside all other columns has them. tells: nats that an effect of twice its typical size would reach.
    finding: what is said in place of the effect's own sentence."""

    effect: Effect
    nats: float
    parameters: Mapping[str, tuple[float, float]]
    tells: float
    finding: str = ""


def reduced(normal: Normal, columns: Sequence[Column], asked: Iterable[int]) -> Reduced:
    """The Reduced of the columns numbered `asked`."""
    E = np.array(sorted(asked))
    N = np.setdiff1d(np.arange(len(columns)), E)
    H, s = normal.information.sum(axis=0), normal.score.sum(axis=0)
    prior = np.array([c.sd**-2.0 for c in columns])
    inner = H[np.ix_(N, N)] + np.diag(prior[N] + _RIDGE * np.diag(H)[N])
    A = np.linalg.solve(inner, H[np.ix_(N, E)]).T
    information = H[np.ix_(E, E)] - A @ H[np.ix_(N, E)]
    information = _semidefinite(information, np.sqrt(np.maximum(np.diag(H)[E], 1e-12)))
    score = s[E] - A @ s[N]
    chosen = tuple(columns[j] for j in E)
    if not score.any():  # nothing was recorded yet
        return Reduced(chosen, score, information, information + 1e-9 * np.diag(np.diag(information) + 1e-9))
    own = np.linalg.solve(information + np.diag(prior[E]), score)
    beside = np.linalg.solve(inner, s[N] - H[np.ix_(N, E)] @ own)
    each = normal.score - normal.information[:, :, N] @ beside - normal.information[:, :, E] @ own
    each = each[:, E] - each[:, N] @ A.T
    each -= each.mean(axis=0)
    covariance = _BY_TILES * each.T @ each + (1.0 - _BY_TILES) * information
    covariance += 1e-6 * np.diag(np.diag(covariance) + 1e-12)
    return Reduced(chosen, score, information, covariance)


def _semidefinite(information: Matrix, scale: Matrix) -> Matrix:
    """An information that nuisances take almost whole may come out below zero by rounding."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.T) / np.outer(scale, scale))
    return np.asarray((vectors * np.maximum(values, _RIDGE)) @ vectors.T * np.outer(scale, scale))


def judged(room: Reduced, spread: Mapping[str, float], looked: Mapping[str, float], few: float) -> list[Found]:
    """The Found of every effect, likeliest first.

    spread: {column: deviation between sessions, in units}; columns that are not there may have any value. looked:
    {effect: logarithm of the places where it was looked for}. few: degrees of freedom that spread rests on.
    """
    names = [c.name for c in room.columns]
    both = zip(names, room.columns, strict=True)
    D = np.array([_INFLATED * spread[name] ** 2 if name in spread else c.sd**2 for name, c in both])
    H, V, s = room.information, room.covariance, room.score
    null = V + H @ np.diag(D) @ H
    at_null, out = _log_normal(s, null), []
    for effect in {c.effect.id: c.effect for c in room.columns if c.effect is not None}.values():
        own = np.array([j for j, c in enumerate(room.columns) if c.effect is effect])
        if not any(names[j] in spread for j in own):
            continue
        P = np.zeros(len(names))
        P[own] = [room.columns[j].sd ** 2 for j in own]
        more = null + H @ np.diag(P) @ H
        cost = looked.get(effect.id, 0.0)
        nats = _log_normal(s, more) - at_null - cost
        S = np.diag(P + D)
        M = S @ H @ np.linalg.inv(H @ S @ H + V)
        value, deviation = M @ s, np.sqrt(np.maximum(np.diag(S - M @ H @ S), 0.0))
        typical = np.zeros(len(names))
        typical[own] = 2.0
        seen = H @ typical
        occam = 0.5 * (np.linalg.slogdet(more)[1] - np.linalg.slogdet(null)[1])
        tells = 0.5 * seen @ np.linalg.solve(null, seen) - occam
        parameters = {
            names[j]: (float(value[j] * room.columns[j].step), float(deviation[j] * room.columns[j].step)) for j in own
        }
        if any(room.columns[j].step * value[j] < 0.0 for j in own if _one_sided(room.columns[j])):
            nats = min(nats, 0.0)  # something else than the effect does that
        out.append(Found(effect, student(float(nats), few), parameters, student(float(tells) - cost, few)))
    return sorted(out, key=lambda found: -found.nats)


def _one_sided(column: Column) -> bool:
    """Whether a column's parameter is never below its neutral value; waves have either sign by their phase."""
    p = column.parameter
    return p is not None and p.low == p.neutral and not column.name.endswith("sine")


def student(nats: float, few: float) -> float:
    """Gaussian nats as Student's."""
    return 0.5 * (few + 1.0) * float(np.log1p(2.0 * nats / few)) if nats > 0 else nats


def _log_normal(x: Matrix, covariance: Matrix) -> float:
    scale = np.sqrt(np.diag(covariance))
    lower = np.linalg.cholesky(covariance / np.outer(scale, scale))
    y = np.linalg.solve(lower, x / scale)
    return float(-0.5 * y @ y - np.log(np.diag(lower)).sum() - np.log(scale).sum())
