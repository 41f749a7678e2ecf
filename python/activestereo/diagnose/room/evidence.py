# SPDX-License-Identifier: Apache-2.0
"""Computes how much likelier a room's images are with each effect than with none; textures and calibration stay free.

The scores s of all columns are N(0, V + H (D + P) H). V is their covariance, from tiles (the sandwich; White 1982). H
is the information. D is the covariance of coefficients between sessions of good units, and P an effect's prior. D comes
from few sessions, so evidence is converted to that of Student's distribution.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.room.cells_out import Normal
from activestereo.diagnose.room.columns import BEND, LOOKED, Column
from activestereo.diagnose.room.sessions import ALIKE, FEW, FREEDOM
from activestereo.effects import Effect

# Nats that an effect needs to be named.
NEEDED = 4.5
# Share of V that comes from the tiles' scatter, which is uncertain: there are only a few dozen tiles.
_BY_TILES, _INFLATED = 0.7, 1.5
_RIDGE = 1e-9
ONE_SIDED = 1.0  # deviations: five of six recordings fall short by less
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Reduced:
    """Holds the scores of selected columns: derivatives of the log-likelihood by their coefficients. All other columns
    are projected out. score [c]; information and covariance of the score [c][c]; prior covariance of the coefficients
    [c][c]."""

    columns: tuple[Column, ...]
    score: Matrix
    information: Matrix
    covariance: Matrix
    prior: Matrix


@dataclass(frozen=True)
class Found:
    """The evidence for one effect in a room's images. nats: gain of log-likelihood over no effect (Student's
    distribution). parameters: {name: (value, standard deviation)}, fitted together with all other columns. least:
    {parameter: smallest size that is detected in five of six such recordings}. finding: a sentence in place of the
    effect's own; "" = none. members: {effect: probability} of all effects that this recording cannot distinguish, this
    one included; empty if it is not named."""

    effect: Effect
    nats: float
    parameters: Mapping[str, tuple[float, float]]
    least: Mapping[str, float] = field(default_factory=dict)
    finding: str = ""
    members: Mapping[str, float] = field(default_factory=dict)


def reduced(normal: Normal, columns: Sequence[Column], asked: Iterable[int]) -> Reduced:
    """Projects all columns except those with the indices `asked` out of the normal equations. Returns the scores of the
    asked columns."""
    E = np.array(sorted(asked))
    N = np.setdiff1d(np.arange(len(columns)), E)
    H, s = normal.information.sum(axis=0), normal.score.sum(axis=0)
    prior, tied = normal.prior[np.ix_(N, N)], normal.prior[np.ix_(N, E)]
    inner, across = H[np.ix_(N, N)] + prior + np.diag(_RIDGE * np.diag(H)[N]), H[np.ix_(N, E)] + tied
    A = np.linalg.solve(inner, across).T
    information = H[np.ix_(E, E)] + tied.T @ np.linalg.solve(prior, tied) - A @ across
    before = np.linalg.inv(normal.prior)[np.ix_(E, E)]
    # Rounding makes negative eigenvalues if nuisances take almost all of the information.
    scale = np.sqrt(np.maximum(np.diag(H)[E], 1e-12))
    values, vectors = np.linalg.eigh(0.5 * (information + information.T) / np.outer(scale, scale))
    information = np.asarray((vectors * np.maximum(values, _RIDGE)) @ vectors.T * np.outer(scale, scale))
    score = s[E] - A @ s[N]
    chosen = tuple(columns[j] for j in E)
    if not score.any():  # the blocks are of a recording not made yet
        return Reduced(chosen, score, information, information + 1e-9 * np.diag(np.diag(information) + 1e-9), before)
    fit = np.empty(len(columns))
    fit[E] = np.linalg.solve(information + np.linalg.inv(before), score)
    fit[N] = np.linalg.solve(inner, s[N] - across @ fit[E])
    each = normal.score - np.matmul(normal.information, fit)
    each = each[:, E] - each[:, N] @ A.T
    each -= each.mean(axis=0)
    covariance = _BY_TILES * each.T @ each + (1.0 - _BY_TILES) * information
    covariance += 1e-6 * np.diag(np.diag(covariance) + 1e-12)
    return Reduced(chosen, score, information, covariance, before)


def judged(room: Reduced, spread: Mapping[str, float]) -> list[Found]:
    """Compares every effect with no effect by the columns' scores; returns a Found for each, likeliest first. An effect
    is tried with each of its parameters alone and with all together.

    spread: {column: standard deviation of its coefficient between sessions of good cameras}. A column that is not in it
    has its prior covariance instead.
    """
    names = [c.name for c in room.columns]
    D = _between_sessions(room, spread)
    H, V, s = room.information, room.covariance, room.score
    null = V + H @ D @ H
    at_null, out = _log_normal(s, null), []
    for effect in {c.effect.id: c.effect for c in room.columns if c.effect is not None}.values():
        own = np.array([j for j, c in enumerate(room.columns) if c.effect is effect])
        if not any(names[j] in spread for j in own):
            continue
        cost, few = LOOKED.get(effect.id, 0.0), FREEDOM.get(effect.id, FEW)
        S = np.diag(_prior(room.columns, own)) + D
        M = S @ H @ np.linalg.inv(H @ S @ H + V)
        value, deviation = M @ s, np.sqrt(np.maximum(np.diag(S - M @ H @ S), 0.0))
        ways = _ways(room.columns, own)
        if any(value[j] < 0.0 for j in own if names[j].endswith(BEND)):
            ways = ways[:-1]  # no camera responds more and more to brighter light
        each = [null + (H * _prior(room.columns, way)) @ H for way in ways]
        nats = np.logaddexp.reduce([_log_normal(s, more) for more in each]) - at_null - cost - np.log(len(ways))
        least: dict[str, float] = {}
        for way, more in zip(ways, each, strict=True):
            lead = room.columns[way[0]]
            if lead.parameter is None or lead.parameter.name in least:
                continue  # this way is all parameters together
            unit = H[:, way] @ [np.sqrt(0.5) if names[j].endswith("sine") else 1.0 for j in way]
            occam = 0.5 * (np.linalg.slogdet(more)[1] - np.linalg.slogdet(null)[1])
            missing = gaussian(NEEDED, few) + occam + cost + np.log(len(ways))
            units = (np.sqrt(2.0 * missing) + ONE_SIDED) / np.sqrt(max(unit @ np.linalg.solve(null, unit), 1e-12))
            least[lead.parameter.name] = float(lead.step * units)
        parameters = {
            names[j]: (float(value[j] * room.columns[j].step), float(deviation[j] * room.columns[j].step)) for j in own
        }
        positive = {p.name for p in effect.parameters if p.low == p.neutral}  # flicker's waves may have either sign
        if any(told[0] < 0.0 for name, told in parameters.items() if name.split(".")[1] in positive):
            nats = min(nats, 0.0)  # the effect cannot have this sign
        out.append(Found(effect, student(float(nats), few), parameters, least))
    return sorted(out, key=lambda found: -found.nats)


def _ways(columns: Sequence[Column], own: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Returns the ways in which an effect may show, each as indices of columns: each parameter's alone, without its
    saturation column (BEND), then all columns together."""
    parameters = dict.fromkeys(columns[j].parameter for j in own)
    linear = [j for j in own if not columns[j].name.endswith(BEND)]
    alone = [np.array([j for j in linear if columns[j].parameter == p]) for p in parameters]
    return alone if len(alone[0]) == len(own) else [*alone, own]


def _prior(columns: Sequence[Column], own: NDArray[np.int64]) -> Matrix:
    """Returns the prior variances [c] of all coefficients if an effect acts through the columns `own`; 0 for the
    others."""
    out = np.zeros(len(columns))
    out[own] = [columns[j].sd ** 2 for j in own]
    return out


def _between_sessions(room: Reduced, spread: Mapping[str, float]) -> Matrix:
    """Returns the covariance [c][c] of the columns' coefficients between good sessions. Columns that `spread`, {column:
    standard deviation}, lacks have their prior covariance."""
    names = [c.name for c in room.columns]
    deviation = np.array([np.sqrt(_INFLATED) * spread.get(name, np.nan) for name in names])
    told = np.isfinite(deviation)
    D = np.where(np.add.outer(told, told), np.diag(np.nan_to_num(deviation) ** 2), room.prior)
    for (one, other), correlation in ALIKE.items():
        if one in spread and other in spread:
            a, b = names.index(one), names.index(other)
            D[a, b] = D[b, a] = correlation * deviation[a] * deviation[b]
    return D


def student(nats: float, few: float) -> float:
    """Converts a log-likelihood gain of a normal distribution to that of Student's distribution with `few` degrees of
    freedom. Negative gains are returned unchanged."""
    return 0.5 * (few + 1.0) * float(np.log1p(2.0 * nats / few)) if nats > 0 else nats


def gaussian(nats: float, few: float) -> float:
    """Converts a log-likelihood gain of Student's distribution back to that of a normal one; inverse of student()."""
    return 0.5 * few * float(np.expm1(2.0 * nats / (few + 1.0))) if nats > 0 else nats


def _log_normal(x: Matrix, covariance: Matrix) -> float:
    scale = np.sqrt(np.diag(covariance))
    lower = np.linalg.cholesky(covariance / np.outer(scale, scale))
    y = np.linalg.solve(lower, x / scale)
    return float(-0.5 * y @ y - np.log(np.diag(lower)).sum() - np.log(scale).sum())
