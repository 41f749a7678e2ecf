# SPDX-License-Identifier: Apache-2.0
"""Which effects a measured room shows: the likeliest is named where it is beyond what sessions of one good unit differ
by, then the next one beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.diagnose.room.cells_out import blocks_of, normal
from activestereo.diagnose.room.columns import Column, effects_of, nuisances, pedestals, waves
from activestereo.diagnose.room.evidence import Found, judged, reduced
from activestereo.diagnose.room.light import RoomLight, room_light
from activestereo.diagnose.room.rows import row_variance
from activestereo.diagnose.search.selection import credible
from activestereo.effects import Effect, Model

# A name needs so many nats; sessions tell their spread with so many degrees of freedom.
NEEDED, FEW = 5.0, 5.0
_MOST_NAMES, _MASS = 3, 0.95
_ROW_FLOOR_DN2, _LEAST_ROWS_DN2, _MOST_NATS = 0.002, 0.01, 30.0
_BLACK_SD_DN, _EXPONENT_SD = 1.5, 0.5
# Asked about along with the effects: what `calibrate world` measured of the camera itself.
_CAMERA = ("black", "falloff", "right row")


@dataclass(frozen=True)
class Named:
    """An effect that was named, with {effect: probability} of those that this recording cannot tell apart."""

    found: Found
    members: Mapping[str, float]


@dataclass(frozen=True)
class Names:
    """named: in the order of their evidence; ranking: all that were asked about, as they stood before the first name;
    period_rows: of the waves that were looked at."""

    named: tuple[Named, ...]
    ranking: tuple[Found, ...]
    period_rows: int | None


def names_of(
    room: Room, given: Model, effects: Sequence[Effect], spread: Mapping[str, float]
) -> Names:
    """The Names of a room beside a given model. spread: {effect.parameter: deviation of good units, in the parameter's
    unit}; others cannot be named."""
    measured = room.capture.measured.get("exposure", {})
    black = room.capture.rig.black_dn[0] if room.capture.rig.black_dn else 0.0
    exponent = (measured.get("vignetting_exponent") or (0.0,))[0]
    light = room_light(room, black, exponent)
    asked = [e for e in effects if e.id not in {g.id for g, _ in given.effects}]
    still = nuisances(room, light, _BLACK_SD_DN, _EXPONENT_SD)
    period, wave = _wave(room, light, still, asked)
    columns = [*still, *effects_of(room, light, asked), *pedestals(room, asked), *wave]
    columns = [c for c in columns if c.effect is None or key(c) in spread]
    blocks = blocks_of(room, light, columns)
    sums = normal(room, columns, blocks, range(len(still)))
    of = [j for j, c in enumerate(columns) if c.effect is not None or c.name.startswith(_CAMERA)]
    seen = reduced(sums, columns, of)
    rows = _rows(room, asked)
    named: list[Named] = []
    ranking: tuple[Found, ...] = ()
    known = {c.name: spread[key(c)] / c.step for c in seen.columns if c.effect is not None}
    while len(named) < _MOST_NAMES:
        before = {n.found.effect.id for n in named}
        found = [*(f for f in judged(seen, known, _looked(), FEW) if f.effect.id not in before), *rows]
        found.sort(key=lambda f: -f.nats)
        ranking = ranking or tuple(found)
        if not found or found[0].nats < NEEDED:
            break
        best = found[0]
        members = credible({f.effect.id: f.nats for f in found if f.nats > 0.0}, _MASS)
        named.append(Named(best, members if best not in rows else {best.effect.id: 1.0}))
        rows = [f for f in rows if f is not best]
        known = {c.name: c.sd if c.effect is best.effect else known.get(c.name, c.sd) for c in seen.columns}
    return Names(tuple(named), ranking, period)


def key(column: Column) -> str:
    """A column's place in a table of spreads."""
    assert column.effect is not None and column.parameter is not None
    return f"{column.effect.id}.{column.parameter.name}"


def _looked() -> dict[str, float]:
    """Waves were looked for at many periods."""
    return {"flicker_banding": float(np.log(21.0))}


def _wave(
    room: Room, light: RoomLight, still: Sequence[Column], effects: Sequence[Effect]
) -> tuple[int | None, list[Column]]:
    """(rows of a period, columns) of the waves that the slow light shows best."""
    sets = waves(room, effects)
    if not sets:
        return None, []
    columns = [*still, *(c for each in sets.values() for c in each)]
    sums = normal(room, columns, blocks_of(room, light, columns, ("slow",)), range(len(still)))
    seen, gains, first = reduced(sums, columns, range(len(still), len(columns))), {}, 0
    for period, each in sets.items():
        own = slice(first, first + len(each))
        first += len(each)
        prior = np.diag([c.sd**-2.0 for c in each])
        gain = seen.score[own] @ np.linalg.solve(seen.information[own, own] + prior, seen.score[own])
        gains[period] = float(gain)
    best = max(gains, key=lambda period: gains[period])
    return best, sets[best]


def _rows(room: Room, effects: Sequence[Effect]) -> list[Found]:
    """The evidence for noise of rows."""
    effect = next((e for e in effects if e.id == "row_noise"), None)
    if effect is None:
        return []
    value, deviation = row_variance(room)
    z = value / max(deviation, _ROW_FLOOR_DN2)
    nats = min(0.5 * z * z, _MOST_NATS) if value > _LEAST_ROWS_DN2 else -1.0
    sigma = float(np.sqrt(max(value, 0.0)))
    tells = 0.5 * (4.0 * effect.parameters[0].typical ** 2 / max(deviation, _ROW_FLOOR_DN2)) ** 2
    found = {"row_noise.sigma_dn": (sigma, 0.5 * deviation / max(sigma, 1e-2))}
    return [Found(effect, nats, found, min(tells, _MOST_NATS))]
