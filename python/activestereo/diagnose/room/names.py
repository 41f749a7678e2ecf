# SPDX-License-Identifier: Apache-2.0
"""Names the effects that a measured room shows. The likeliest effect is named if it exceeds the differences between
sessions of good units. Then the likeliest remaining one is tested beside it, unless both cannot be distinguished."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.common.computed_once import computed_once
from activestereo.diagnose.credible_set import credible
from activestereo.diagnose.room.beside import beside_columns
from activestereo.diagnose.room.cells_out import blocks_of, normal
from activestereo.diagnose.room.columns import Column, alternatives, effects_of, nuisances, pedestals, size_of
from activestereo.diagnose.room.evidence import NEEDED, Found, Reduced, gaussian, judged, reduced
from activestereo.diagnose.room.further import room_beside, with_turned_view
from activestereo.diagnose.room.light import RoomLight, room_light
from activestereo.diagnose.room.sessions import BETWEEN, FEW, OF_A_UNIT, SAME_PLACE, SHARED
from activestereo.effects import Effect, Model

_MOST_NAMES, _MASS, _PROMISED = 3, 0.95, 5.0 / 6.0
# Columns scored together with the effects: properties of the camera that `calibrate world` measured.
_CAMERA = ("black", "falloff", "right row")
# Effects of single views or scenes, not of a unit.
_OF_ONE_VIEW = ("flicker_banding", "black_level", "veiling_glare")
# Black levels are no glare if the views' light leaves more than this share of their squares.
_UNLIKE_GLARE = 0.2
# A response that differs from the columns' form leaves an error in dark pixels.
_LEFT_BY = {"response_gamma": ("black_level",)}


@dataclass(frozen=True)
class Names:
    """The result of names_of(). named: the effects found, in order. ranking: all effects, likeliest first, as judged
    before any was named. seen: the analysis of the room without reference sessions."""

    named: tuple[Found, ...]
    ranking: tuple[Found, ...]
    seen: Seen


@dataclass(frozen=True)
class Seen:
    """One analysis of a room. asked: {id: effect to judge}. scores: of the effects' columns and of the camera's own
    (black level, falloff, row offset). chosen: {effect: its likeliest alternative} for effects with alternatives
    (columns.py). promised: {effect: (an alternative at least as hard to detect as five of six likely ones, factor on
    its least detectable size)}. trust: {band: factor on cell weights}, as in cells_out.Normal."""

    room: Room
    light: RoomLight
    asked: Mapping[str, Effect]
    scores: Reduced
    chosen: Mapping[str, tuple[float, ...]]
    promised: Mapping[str, tuple[tuple[float, ...], float]]
    trust: Mapping[str, float]

    @computed_once
    def sizes(self) -> Callable[[str], Callable[[float], tuple[float, float]]]:
        """Returns a cached function from a column's name to its size_of()."""
        columns = {c.name: c for c in self.scores.columns}
        return cache(lambda name: size_of(self.room, self.light, columns[name]))


def names_of(room: Room, given: Model, effects: Mapping[str, Effect], reference: Sequence[Room] = ()) -> Names:
    """Finds the effects that a room shows beyond a given model. reference: rooms recorded with the same camera when it
    was good. A reference of the same views is fitted together with the room. References of other views give the
    camera's lasting errors, which are subtracted."""
    known_effects = {effect.id for effect, _ in given.effects}
    asked = {name: effect for name, effect in effects.items() if name not in known_effects}
    seen = score_room(room, asked)
    scores, spread = seen.scores, OF_A_UNIT
    both = next(filter(None, (room_beside(room, other) for other in reference)), None)
    if both is not None:
        scores, spread = score_room(both, asked).scores, SAME_PLACE
    elif reference:
        others = [score_room(other, asked, seen.chosen, _lasting).scores for other in reference]
        scores, spread = _less_lasting(scores, others), BETWEEN
    beside = beside_columns(room, seen.light.lens, asked, reference)
    # A bent response lifts views alike; only another session or two exposures tell it.
    is_response_told = both is not None or any(f.effect.id == "response_gamma" for f in beside)
    named: list[Found] = []
    ranking: tuple[Found, ...] = ()
    known = session_spread(scores, spread)
    while len(named) < _MOST_NAMES:
        before = {member for f in named for member in (*f.members, *_LEFT_BY.get(f.effect.id, ()))}
        before |= {f.effect.id for f in beside}
        found = [*(f for f in judged(scores, known) if f.effect.id not in before), *beside]
        found.sort(key=lambda f: -f.nats)
        ranking = ranking or tuple(found)
        if not found or found[0].nats < NEEDED:
            break
        best, own = found[0], {found[0].effect.id}
        members = credible({f.effect.id: f.nats for f in found if f.nats > 0.0}, _MASS)
        members = members if best not in beside else {best.effect.id: 1.0}
        beside = [f for f in beside if f is not best]
        if (glare := reinterpret_as_glare(best, seen)) is not None:
            alike = [glare.effect.id, best.effect.id]
            alike += [name for name in asked if name == "response_gamma" and not is_response_told]
            each = members.pop(best.effect.id) / len(alike)
            members = dict.fromkeys(alike, each) | {m: p + each * (m in alike) for m, p in members.items()}
            best, own = glare, set(alike[:2])
        named.append(replace(best, members=members))
        known = {name: deviation for name, deviation in known.items() if name.split(".")[0] not in own}
    return Names(tuple(named), ranking, seen)


def session_spread(scores: Reduced, spread: Mapping[str, float]) -> dict[str, float]:
    """Returns {column: standard deviation of its coefficient between sessions of good cameras} for all effects'
    columns. spread: {"effect.parameter": the same in the parameter's unit}."""
    return {c.name: c.alike * spread[_key(c)] / c.step for c in scores.columns if c.effect is not None}


def score_room(
    room: Room, asked: Mapping[str, Effect], chosen: Mapping[str, tuple[float, ...]] | None = None,
    of: Callable[[Sequence[Column]], list[int]] | None = None,
) -> Seen:  # fmt: skip
    """Computes the expected light of a room and the scores of the effects' columns; returns a Seen. asked: the effects
    to judge. chosen: as in Seen; None searches for them. of(columns): returns the indices of columns to score; None
    scores those of Seen.scores."""
    measured = room.capture.measured.get("exposure", {})
    black = room.capture.rig.black_dn[0] if room.capture.rig.black_dn else 0.0
    light = room_light(room, black, (measured.get("vignetting_exponent") or (0.0,))[0])
    still = nuisances(room, light)
    chosen, promised = _chosen(room, light, still, asked) if chosen is None else (chosen, {})
    columns = [*still, *_of_effects(room, light, asked, chosen)]
    sums = normal(room, columns, blocks_of(room, light, columns), len(columns))
    return Seen(room, light, asked, reduced(sums, columns, (of or _looked_at)(columns)), chosen, promised, sums.trust)


def with_planned_pair(seen: Seen, turn_deg: tuple[float, float, float]) -> Reduced:
    """Returns the expected scores if the view of with_turned_view() were added to the room. Their covariance exceeds
    that of independent cells by the same factor as in the recorded room."""
    room = with_turned_view(seen.room, seen.light, turn_deg)
    light = room_light(room, seen.light.black_dn, seen.light.lens)
    promised = {effect: alternative for effect, (alternative, _) in seen.promised.items()}
    columns = [*nuisances(room, light), *_of_effects(room, light, seen.asked, promised)]
    sums = normal(room, columns, blocks_of(room, light, columns), 0, seen.trust)
    out, now = reduced(sums, columns, _looked_at(columns)), seen.scores
    ratio = np.sqrt(np.maximum(np.diag(now.covariance) / np.diag(now.information), 1.0))
    more = dict(zip((c.name for c in now.columns), ratio, strict=True))
    each = np.array([more.get(c.name, 1.0) for c in out.columns])
    return replace(out, covariance=out.covariance * np.outer(each, each))


def _of_effects(
    room: Room, light: RoomLight, asked: Mapping[str, Effect], chosen: Mapping[str, tuple[float, ...]]
) -> list[Column]:
    """Returns columns of effects whose spread among good units is known. With a good session of the same views,
    nuisance columns are added for lasting errors that both sessions share."""
    searched = [c for name, each in alternatives(room, light, asked).items() for c in each[chosen[name]]]
    own = [c for c in (*effects_of(room, light, asked), *pedestals(room, asked), *searched) if _key(c) in OF_A_UNIT]
    if room.judged == room.views:
        return own
    lasting = [c for c in own if c.effect is not None and c.effect.id not in ("black_level", "flicker_banding")]
    every = range(len(room.images))
    return own + [replace(c, name=f"unit's {c.name}", sd=OF_A_UNIT[_key(c)] / c.step, images=every, effect=None)
                  for c in lasting]  # fmt: skip


def _looked_at(columns: Sequence[Column]) -> list[int]:
    return [j for j, c in enumerate(columns) if c.effect is not None or c.name.startswith(_CAMERA)]


def _lasting(columns: Sequence[Column]) -> list[int]:
    return [j for j, c in enumerate(columns) if c.effect is not None and c.effect.id not in _OF_ONE_VIEW]


def _less_lasting(seen: Reduced, others: Sequence[Reduced]) -> Reduced:
    """Returns the scores of a room minus the camera's lasting errors. These errors are fitted to the scores of good
    sessions (`others`), then reduced to the share that sessions have in common."""
    lasting, value = _lasting(seen.columns), np.zeros(len(seen.columns))
    information = np.diag([seen.columns[j].sd ** -2.0 for j in lasting]) + sum(other.information for other in others)
    share = len(others) * SHARED / (1.0 + (len(others) - 1) * SHARED)
    value[lasting] = share * np.linalg.solve(information, sum(other.score for other in others))
    return replace(seen, score=seen.score - seen.information @ value)


def reinterpret_as_glare(found: Found, seen: Seen) -> Found | None:
    """Reinterprets black levels that differ between views as veiling glare: a share of each view's mean light. Returns
    the finding, None if glare does not fit. With a good session, glare must fit better than a common level. Without
    one, only differences from the first view count, because its level is part of the measured black level."""
    effect = seen.asked.get("veiling_glare")
    if effect is None or found.effect.id != "black_level":
        return None
    light = np.array([image[seen.room.images[k].usable].mean() for k, image in enumerate(seen.light.seen)])
    light = 0.5 * (light[::2] + light[1::2])
    lifted, deviation = np.array(list(found.parameters.values())).T
    is_whole = len(lifted) == len(light)
    more = light if is_whole else light[1:] - light[0]
    beside = ((lifted - lifted.mean()) ** 2).sum() if is_whole else _UNLIKE_GLARE * (lifted**2).sum()
    share = float(np.vdot(lifted, more)) / max(float(np.vdot(more, more)), 1e-9)
    if not 0.0 < share <= effect.parameters[0].high or ((lifted - share * more) ** 2).sum() > beside:
        return None  # two views alone have one difference, which some share always fits
    told = {
        "veiling_glare.fraction": (share, float(np.linalg.norm(deviation)) / max(float(np.linalg.norm(more)), 1e-9))
    }
    said = "Even light lifts each view by a share of its own: veiling glare, or a black level that drifts alike"
    return Found(effect, found.nats, told, finding=said)


def _key(column: Column) -> str:
    """Returns a column's key "effect.parameter" in a table of spreads."""
    assert column.effect is not None and column.parameter is not None
    return f"{column.effect.id}.{column.parameter.name}"


def _chosen(
    room: Room, light: RoomLight, still: Sequence[Column], asked: Mapping[str, Effect]
) -> tuple[Mapping[str, tuple[float, ...]], dict[str, tuple[tuple[float, ...], float]]]:
    """Returns `chosen` and `promised` of a Seen, for effects with alternatives, from the slow band alone. still:
    nuisance columns fitted too. Alternatives are compared by their likelihood against no flicker at all, not against
    the flicker of good units: weak flicker at a wrong period would pass for a black level."""
    searched = alternatives(room, light, asked)
    if not searched:
        return {}, {}
    columns = [*still, *(c for sets in searched.values() for each in sets.values() for c in each)]
    sums = normal(room, columns, blocks_of(room, light, columns, ("slow",)), len(still))
    seen, first = reduced(sums, columns, range(len(still), len(columns))), 0
    chosen: dict[str, tuple[float, ...]] = {}
    promised: dict[str, tuple[tuple[float, ...], float]] = {}
    for effect, sets in searched.items():
        nats, least = dict[tuple[float, ...], float](), dict[tuple[float, ...], float]()
        for alternative, each in sets.items():
            own = slice(first, first := first + len(each))
            of = Reduced(
                tuple(each), seen.score[own], *(m[own, own] for m in (seen.information, seen.covariance, seen.prior))
            )
            (shown,), (found,) = (
                judged(of, spread)
                for spread in (dict.fromkeys((c.name for c in each), 0.0), session_spread(of, OF_A_UNIT))
            )
            nats[alternative], (least[alternative],) = gaussian(shown.nats, FEW), found.least.values()
        best, by_least = max(nats, key=lambda each: nats[each]), sorted(nats, key=lambda each: least[each])
        likely = np.cumsum(np.exp([nats[each] - nats[best] for each in by_least]))
        sure = by_least[int(np.searchsorted(likely, _PROMISED * likely[-1]))]
        chosen[effect], promised[effect] = best, (sure, least[sure] / least[best])
    return chosen, promised
