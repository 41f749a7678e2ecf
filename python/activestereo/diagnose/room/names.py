# SPDX-License-Identifier: Apache-2.0
"""Names the effects that a measured room shows. The likeliest is named if it exceeds the differences between sessions
of one good unit, then the next one beside it that is no twin of the first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.light import LINEAR
from activestereo.common.computed_once import computed_once
from activestereo.diagnose.room.cells_out import blocks_of, imagined, normal
from activestereo.diagnose.room.columns import LOOKED, Column, alternatives, effects_of, nuisances, pedestals, size_of
from activestereo.diagnose.room.drops import BLURRED_LOG, blurred_places
from activestereo.diagnose.room.evidence import ONE_SIDED, Found, Reduced, gaussian, judged, reduced, student
from activestereo.diagnose.room.imagined import ImaginedRoom
from activestereo.diagnose.room.light import RoomLight, room_light
from activestereo.diagnose.room.rows import row_variance
from activestereo.diagnose.room.same_place import room_beside
from activestereo.diagnose.room.sessions import BETWEEN, FEW, OF_A_UNIT, SAME_PLACE, SHARED
from activestereo.diagnose.selection import credible
from activestereo.effects import Effect, Model

# Nats that an effect needs to be named.
NEEDED = 4.5
_MOST_NAMES, _MASS, _PROMISED = 3, 0.95, 5.0 / 6.0
_ROW_FLOOR_DN2, _LEAST_ROWS_DN2, _MOST_NATS = 0.002, 0.01, 30.0
# Columns judged along with the effects: properties of the camera that `calibrate world` measured.
_CAMERA = ("black", "falloff", "right row")
# Effects of single views or scenes, not of a unit; deviation of a pair's row offset between sessions.
_OF_ONE_VIEW, _ROWS_PX = ("flicker_banding", "black_level", "veiling_glare"), 0.035
# Share of an image that is blurred in good sessions; a dot's own blur.
_BLURRED_SHARE, _DOT_PX = 0.003, 1.4
# Black levels are no glare if the views' light leaves more than this share of their squares.
_UNLIKE_GLARE = 0.2
# A response whose form the columns do not have leaves a rest in the dark.
_LEFT_BY = {"response_gamma": ("black_level",)}
# The response that two exposures of one place tell.
LEAST_RESPONSE: dict[str, Mapping[str, float]] = {
    "response_gamma": {"log_exponent": LINEAR * (float(np.sqrt(2.0 * gaussian(NEEDED, FEW))) + ONE_SIDED)}
}


@dataclass(frozen=True)
class Named:
    """An effect that the room is found to have. members: {effect: probability} of all effects that this recording
    cannot tell apart, itself included."""

    found: Found
    members: Mapping[str, float]


@dataclass(frozen=True)
class Names:
    """The result of names_of(). named: the effects found, in the order of finding. ranking: all effects, likeliest
    first, as judged before the first was found. seen: the analysis of the room without reference sessions."""

    named: tuple[Named, ...]
    ranking: tuple[Found, ...]
    seen: Seen


@dataclass(frozen=True)
class Seen:
    """Holds one analysis of a room. asked: the effects to judge. scores: of the effects' columns and of the camera's
    own (black level, falloff, row offset). chosen: {effect: the likeliest of its alternatives}, of those that are
    searched for. promised: {effect: (an alternative that shows less than five of six likely ones, the factor on its
    least size)}. trust: {band: factor on cell weights}, as in cells_out.Normal."""

    room: Room
    light: RoomLight
    asked: tuple[Effect, ...]
    scores: Reduced
    chosen: Mapping[str, tuple[float, ...]]
    promised: Mapping[str, tuple[tuple[float, ...], float]]
    trust: Mapping[str, float]

    @computed_once
    def sizes(self) -> Callable[[str], Callable[[float], tuple[float, float]]]:
        """Returns a function of a column's name: its size_of(), made once."""
        columns = {c.name: c for c in self.scores.columns}
        return cache(lambda name: size_of(self.room, self.light, columns[name]))


def names_of(room: Room, given: Model, effects: Sequence[Effect], reference: Sequence[Room] = ()) -> Names:
    """Finds the effects that a room shows beyond a given model. reference: rooms recorded with the same camera when it
    was good. A reference of the same views is fitted together with the room. References of other views give the
    camera's lasting errors, which are subtracted."""
    asked = tuple(e for e in effects if e.id not in {g.id for g, _ in given.effects})
    seen = score_room(room, asked)
    scores, spread, rows = seen.scores, OF_A_UNIT, _rows(room, asked)
    rows += _drops(room, seen.light.lens, asked)
    both = next(filter(None, (room_beside(room, other) for other in reference)), None)
    if both is not None:
        scores, spread = score_room(both, asked).scores, SAME_PLACE
    elif reference:
        others = [score_room(other, asked, seen.chosen).scores for other in reference]
        scores, spread = _beside(scores, others), BETWEEN
    response = _response(room, asked)
    rows += response
    if reference:
        rows += _pitch(room, reference, asked)
    named: list[Named] = []
    ranking: tuple[Found, ...] = ()
    known = session_spread(scores, spread)
    while len(named) < _MOST_NAMES:
        before = {member for n in named for member in (*n.members, *_LEFT_BY.get(n.found.effect.id, ()))}
        before |= {f.effect.id for f in rows}
        found = [*(f for f in judged(scores, known, LOOKED, NEEDED) if f.effect.id not in before), *rows]
        found.sort(key=lambda f: -f.nats)
        ranking = ranking or tuple(found)
        if not found or found[0].nats < NEEDED:
            break
        best = found[0]
        members = credible({f.effect.id: f.nats for f in found if f.nats > 0.0}, _MASS)
        members = members if best not in rows else {best.effect.id: 1.0}
        rows = [f for f in rows if f is not best]
        own = {c.name for c in scores.columns if c.effect is best.effect}
        glare = reinterpret_as_glare(best, seen)
        if glare is not None:
            alike = [glare.effect.id, best.effect.id]
            if both is None and not response:  # a bent response lifts views alike; it is not told
                alike += [e.id for e in asked if e.id == "response_gamma"]
            each = members.pop(best.effect.id) / len(alike)
            members = dict.fromkeys(alike, each) | {m: p + each * (m in alike) for m, p in members.items()}
            best = glare
            own |= {c.name for c in scores.columns if c.effect is best.effect}
        named.append(Named(best, members))
        known = {name: deviation for name, deviation in known.items() if name not in own}
    return Names(tuple(named), ranking, seen)


def session_spread(scores: Reduced, spread: Mapping[str, float]) -> dict[str, float]:
    """Returns {column: standard deviation of its coefficient between sessions of good cameras} for all effect columns.
    spread: the same in the parameters' units, by "effect.parameter"."""
    return {c.name: c.alike * spread[_key(c)] / c.step for c in scores.columns if c.effect is not None}


def score_room(room: Room, asked: Sequence[Effect], chosen: Mapping[str, tuple[float, ...]] | None = None) -> Seen:
    """Computes the expected light of a room and the scores of the effects' columns. asked: the effects to judge.
    chosen: as in Seen; None = they are searched for."""
    measured = room.capture.measured.get("exposure", {})
    black = room.capture.rig.black_dn[0] if room.capture.rig.black_dn else 0.0
    light = room_light(room, black, (measured.get("vignetting_exponent") or (0.0,))[0])
    still = nuisances(room, light)
    chosen, promised = _chosen(room, light, still, asked) if chosen is None else (chosen, {})
    columns = [*still, *_of_effects(room, light, asked, chosen)]
    sums = normal(room, columns, blocks_of(room, light, columns), range(len(columns)))
    return Seen(room, light, tuple(asked), reduced(sums, columns, _looked_at(columns)), chosen, promised, sums.trust)


def with_planned_pair(seen: Seen, turn_deg: tuple[float, float, float]) -> Reduced:
    """Returns the scores that a room would have with an ImaginedRoom's further view. Their covariance is inflated
    over independent cells by the same factor as in the recorded room."""
    room = ImaginedRoom(seen.room, seen.light, turn_deg)
    light = room_light(room, seen.light.black_dn, seen.light.lens)
    promised = {effect: alternative for effect, (alternative, _) in seen.promised.items()}
    columns = [*nuisances(room, light), *_of_effects(room, light, seen.asked, promised)]
    sums = imagined(room, columns, blocks_of(room, light, columns), seen.trust)
    out, now = reduced(sums, columns, _looked_at(columns)), seen.scores
    ratio = np.sqrt(np.maximum(np.diag(now.covariance) / np.diag(now.information), 1.0))
    more = dict(zip((c.name for c in now.columns), ratio, strict=True))
    each = np.array([more.get(c.name, 1.0) for c in out.columns])
    return replace(out, covariance=out.covariance * np.outer(each, each))


def _of_effects(
    room: Room, light: RoomLight, asked: Sequence[Effect], chosen: Mapping[str, tuple[float, ...]]
) -> list[Column]:
    """Returns columns of effects with a known spread. Beside a good session, a second set of nuisances is added for the
    unit's own lasting errors in both sessions."""
    searched = [c for name, each in alternatives(room, light, asked).items() for c in each[chosen[name]]]
    own = [c for c in (*effects_of(room, light, asked), *pedestals(room, asked), *searched) if _key(c) in OF_A_UNIT]
    if room.judged == room.views:
        return own
    lasting = [c for c in own if c.effect is not None and c.effect.id not in ("black_level", "flicker_banding")]
    return own + [Column(f"unit's {c.name}", c.change, OF_A_UNIT[_key(c)] / c.step, bands=c.bands, flow=c.flow)
                  for c in lasting]  # fmt: skip


def _looked_at(columns: Sequence[Column]) -> list[int]:
    return [j for j, c in enumerate(columns) if c.effect is not None or c.name.startswith(_CAMERA)]


def _beside(seen: Reduced, others: Sequence[Reduced]) -> Reduced:
    """Subtracts the camera's lasting errors from the scores of a room. These errors are fitted to the scores of good
    sessions (`others`), then shrunk by the share that sessions have in common."""
    lasting = [c.name for c in seen.columns if c.effect is not None and c.effect.id not in _OF_ONE_VIEW]
    H, s = np.zeros((len(lasting),) * 2), np.zeros(len(lasting))
    for other in others:
        names = [c.name for c in other.columns]
        at = np.array([names.index(name) for name in lasting])
        rest = np.setdiff1d(np.arange(len(names)), at)
        inner = other.information[np.ix_(rest, rest)] + np.linalg.inv(other.prior[np.ix_(rest, rest)])
        A = np.linalg.solve(inner, other.information[np.ix_(rest, at)]).T
        H += other.information[np.ix_(at, at)] - A @ other.information[np.ix_(rest, at)]
        s += other.score[at] - A @ other.score[rest]
    prior = np.diag([next(c.sd for c in seen.columns if c.name == name) ** -2.0 for name in lasting])
    share = len(others) * SHARED / (1.0 + (len(others) - 1) * SHARED)
    value = dict(zip(lasting, share * np.linalg.solve(H + prior, s), strict=True))
    return replace(seen, score=seen.score - seen.information @ np.array([value.get(c.name, 0.0) for c in seen.columns]))


def _pitch(room: Room, reference: Sequence[Room], effects: Sequence[Effect]) -> list[Found]:
    """Compares the row offset between the two cameras with that of the good sessions, in the rigs that `calibrate
    world` measured. Returns its evidence as [Found], [] if the effect is not asked for."""
    effect = next((e for e in effects if e.id == "stereo_pitch"), None)
    if effect is None:
        return []
    off = [_row_offset(other) for other in reference]
    f = room.capture.rig.left.K[0, 0]
    return [_measured(effect, (_row_offset(room) - float(np.mean(off))) / f, _ROWS_PX / f)]


def _response(room: Room, effects: Sequence[Effect]) -> list[Found]:
    """Returns [Found] of a response that two exposures of one place tell, [] without them or if it is not asked for."""
    effect = next((e for e in effects if e.id == "response_gamma"), None)
    value = room.capture.measured.get("exposure", {}).get("response_log_exponent")
    if effect is None or value is None:
        return []
    said = "Two exposures of one place differ by another factor than their times: the response is no line"
    return [_measured(effect, value, LINEAR, said)]


def _measured(effect: Effect, value: float, deviation: float, said: str = "") -> Found:
    """Returns the evidence that the first parameter of an effect is not 0. value: measured by `calibrate world`.
    deviation: of good units. said: the finding."""
    p = effect.parameters[0]
    whole = deviation**2 + (2.0 * p.typical) ** 2
    nats = 0.5 * value**2 * (deviation**-2 - 1.0 / whole) - 0.5 * np.log(whole / deviation**2)
    return Found(effect, student(float(nats), FEW), {f"{effect.id}.{p.name}": (value, deviation)}, finding=said)


def _row_offset(room: Room) -> float:
    return float(room.capture.rig.right.K[1, 2] - room.capture.rig.left.K[1, 2])


def reinterpret_as_glare(found: Found, seen: Seen) -> Found | None:
    """Reinterprets black levels that differ between views as veiling glare: a share of each view's mean light. Returns
    the finding, None if glare does not fit. With a good session, glare must fit better than a common level. Without
    one, only differences to the first view count: its level is in the measured black level."""
    effect = next((e for e in seen.asked if e.id == "veiling_glare"), None)
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
    """Returns a column's key in a table of spreads."""
    assert column.effect is not None and column.parameter is not None
    return f"{column.effect.id}.{column.parameter.name}"


def _chosen(
    room: Room, light: RoomLight, still: Sequence[Column], effects: Sequence[Effect]
) -> tuple[Mapping[str, tuple[float, ...]], dict[str, tuple[tuple[float, ...], float]]]:
    """Returns ({effect: its likeliest alternative by the low-pass band}, Seen.promised). still: nuisance columns fitted
    along. Good units flicker, too: likely is what explains the images better than no flicker does, for a weak one at
    the wrong period would pass for a black level."""
    searched = alternatives(room, light, effects)
    if not searched:
        return {}, {}
    columns = [*still, *(c for sets in searched.values() for each in sets.values() for c in each)]
    sums = normal(room, columns, blocks_of(room, light, columns, ("slow",)), range(len(still)))
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
                judged(of, spread, LOOKED, NEEDED)
                for spread in (dict.fromkeys((c.name for c in each), 0.0), session_spread(of, OF_A_UNIT))
            )
            nats[alternative], (least[alternative],) = gaussian(shown.nats, FEW), found.least.values()
        best, by_least = max(nats, key=lambda each: nats[each]), sorted(nats, key=lambda each: least[each])
        likely = np.cumsum(np.exp([nats[each] - nats[best] for each in by_least]))
        sure = by_least[int(np.searchsorted(likely, _PROMISED * likely[-1]))]
        chosen[effect], promised[effect] = best, (sure, least[sure] / least[best])
    return chosen, promised


def _drops(room: Room, exponent: float, effects: Sequence[Effect]) -> list[Found]:
    """Returns [Found] for drops or dirt on a camera's window, [] if the evidence is too small. The parameter is the
    blur averaged over the image, px."""
    effect = next((e for e in effects if e.id == "focus_mismatch"), None)
    worst = max(blurred_places(room, exponent), key=lambda b: b.share, default=None)
    if effect is None or worst is None:
        return []
    nats = student(min(0.5 * (worst.share / _BLURRED_SHARE) ** 2, _MOST_NATS), FEW)
    if nats < NEEDED:
        return []
    here = _DOT_PX * float(np.sqrt(np.expm1(worst.log_ratio)))
    mean = (1.0 if worst.side == "right" else -1.0) * worst.share * here
    place = f"The {worst.side} camera is blurred in places, {100 * worst.share:.0f} % of its image, by {here:.1f} px"
    said = f"{place}: drops or dirt on its window"
    return [Found(effect, nats, {"focus_mismatch.sigma_px": (mean, 0.3 * abs(mean))}, finding=said)]


def _rows(room: Room, effects: Sequence[Effect]) -> list[Found]:
    """Returns [Found] for row noise (an offset that all pixels of a row share), [] if it is not asked for."""
    effect = next((e for e in effects if e.id == "row_noise"), None)
    if effect is None:
        return []
    value, deviation = row_variance(room)
    sure = max(deviation, _ROW_FLOOR_DN2)
    nats = min(0.5 * (value / sure) ** 2, _MOST_NATS) if value > _LEAST_ROWS_DN2 else -1.0
    sigma = float(np.sqrt(max(value, 0.0)))
    found = {"row_noise.sigma_dn": (sigma, 0.5 * deviation / max(sigma, 1e-2))}
    least = np.sqrt(max(_LEAST_ROWS_DN2, (np.sqrt(2.0 * NEEDED) + ONE_SIDED) * sure))
    return [Found(effect, nats, found, {"sigma_dn": float(least)})]


def beside_columns(room: Room, effects: Sequence[Effect]) -> dict[str, Mapping[str, float]]:
    """Returns {finding: {parameter: smallest size detected}} for the findings beside the columns: row noise, lens
    falloff, a response by two exposures, and drops on a window (share of the image, and blur)."""
    out = {found.effect.id: found.least for found in _rows(room, effects)}
    ids = {e.id for e in effects}
    if _response(room, effects):
        out |= LEAST_RESPONSE
    falloff = room.capture.measured.get("exposure", {}).get("vignetting_exponent")
    if falloff is not None and "vignetting" in ids:
        out["vignetting"] = {"exponent": float((np.sqrt(2.0 * NEEDED) + ONE_SIDED) * falloff[1])}
    if "focus_mismatch" in ids:
        share = _BLURRED_SHARE * float(np.sqrt(2.0 * gaussian(NEEDED, FEW)))
        out["drops on a window"] = {"share": share, "sigma_px": _DOT_PX * float(np.sqrt(np.expm1(BLURRED_LOG)))}
    return out
