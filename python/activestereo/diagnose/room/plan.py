# SPDX-License-Identifier: Apache-2.0
"""Plans ten minutes of recordings for the effects that a room leaves open. They are further views of this room, ranked
by the evidence that they would bring, and commands for effects that no view of a room shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import erfc, sqrt

import numpy as np

from activestereo.diagnose.room.beside import LEAST_DROPS, LEAST_RESPONSE, beside_columns, falloff
from activestereo.diagnose.room.evidence import Reduced, judged
from activestereo.diagnose.room.names import Seen, session_spread, with_planned_pair
from activestereo.diagnose.room.sessions import OF_A_UNIT, SAME_PLACE

Sizes = Mapping[str, float]


@dataclass(frozen=True)
class Recording:
    """A recording: its instruction, its duration in minutes, and tells: {effect: {parameter: least size that it
    detects}}, with None in place of sizes that are not computed. ends: minutes from the start of the plan to its end;
    None if it does not fit in the plan."""

    text: str
    minutes: float
    tells: Mapping[str, Sizes | None]
    ends: float | None = None


# A plan's minutes; the least number of effects that a recording must be expected to tell beyond those before it.
MOST_MINUTES, _LEAST_GAIN = 10.0, 0.05


_THIS = "this recording"
_VIEWS = (
    ("one more view, turned by 15 degrees, exposure fixed", (0.0, 15.0, 0.0)),
    ("one more view, rolled by 90 degrees where the first one was taken", (0.0, 0.0, 90.0)),
)
_EXPOSED = "the first view from a tripod at another exposure, half or twice: state both by import --exposure"
_MUCH_LESS = 0.75
_NEEDS_NO_MORE = ("vignetting", "row_noise")  # any two views show them
_REFERENCE = "the same views when the unit is known to be good: give them to diagnose as --reference"

# Commands for effects that views of a room leave open, with minutes and the effects whose values they measure. The last
# one is for all others.
_COMMANDS: tuple[tuple[str, float, tuple[str, ...]], ...] = (
    ("ten minutes of a still scene from switching on: activestereo calibrate drift", 10.0,
     ("thermal_drift", "laser_power_drift", "chromatic_drift", "pattern_scale_drift", "baseline_drift")),
    ("twenty frames of a still scene: activestereo calibrate noise", 2.0, ("shot_noise", "read_noise")),
    ("a flat wall at two distances, twenty frames each: activestereo calibrate pattern", 3.0,
     ("dot_gain_spread", "dim_dots", "projector_vignetting")),
    ("fifteen pairs of a board, projector off: activestereo calibrate rig", 3.0,
     ("principal_point_offset", "radial_distortion", "tangential_distortion", "stereo_pitch", "stereo_roll")),
    ("a scene whose shape you measure, twenty frames of each view: activestereo diagnose renders it", 20.0, ()),
)  # fmt: skip


def plan_of(seen: Seen) -> list[Recording]:
    """Returns the planned recordings. The first is this recording with the sizes that it detects. Then come those that
    fit in MOST_MINUTES, most information per minute first, then the others. A view of this room is listed for effects
    that this recording misses at typical size, or that the view detects much smaller. Commands are for effects that no
    view detects at typical size. Every effect in seen.asked appears at least once."""
    this = detectable_sizes(seen)
    now = {effect for effect, told in this.items() if _is_usual(seen, effect, told)}
    offers = [(text, 1.0, _tells(seen, r, OF_A_UNIT)) for text, turn_deg in _VIEWS
              for r in [with_planned_pair(seen, turn_deg)]]  # fmt: skip
    good = with_planned_pair(seen, (0.0, 0.0, 0.0))
    offers.append((_REFERENCE, 2.0, _tells(seen, good, SAME_PLACE)))
    if "response_gamma" in seen.asked:
        offers.append((_EXPOSED, 1.0, {"response_gamma": LEAST_RESPONSE}))
    left, enough = [], set(now)
    for text, minutes, tells in offers:
        usual = {e for e, told in tells.items() if _is_usual(seen, e, told)}
        more = {e for e, told in tells.items() if e in this for name, size in told.items()
                if size < _MUCH_LESS * this[e].get(name, np.inf)}  # fmt: skip
        left.append(Recording(text, minutes, {e: tells[e] for e in tells if e in more | (usual - now)}))
        enough |= usual
    untold = {*seen.asked} - enough
    for text, minutes, measured in _COMMANDS:
        own = sorted(untold.intersection(measured) if measured else untold)
        left.append(Recording(text, minutes, dict.fromkeys(own)))
        untold.difference_update(own)
    known, plan, minutes = _chances(seen, this), [Recording(_THIS, 0.0, this, 0.0)], 0.0
    while left := [r for r in left if _gain(_chances(seen, r.tells), known) > _LEAST_GAIN]:
        best = max(left, key=lambda r: _gain(_chances(seen, r.tells), known) / r.minutes)
        left.remove(best)
        if minutes + best.minutes <= MOST_MINUTES:
            minutes += best.minutes
            known |= {e: max(c, known.get(e, 0.0)) for e, c in _chances(seen, best.tells).items()}
            best = replace(best, ends=minutes)
        plan.append(best)
    return sorted(plan, key=lambda r: r.ends is None)


def _chances(seen: Seen, tells: Mapping[str, Sizes | None]) -> dict[str, float]:
    """Returns {effect: probability that it is detected if present}. Sizes are normally distributed, with the typical
    size as standard deviation. A command detects every size."""
    typical = {(e.id, p.name): p.typical for e in seen.asked.values() for p in e.parameters}
    return {
        effect: max(erfc(size / (sqrt(2.0) * typical.get((effect, name), size))) for name, size in sizes.items())
        if sizes
        else 1.0
        for effect, sizes in tells.items()
    }


def _gain(chances: Mapping[str, float], known: Mapping[str, float]) -> float:
    """Returns the expected number of effects that a recording detects beyond the chances `known` before it."""
    return sum(max(chance - known.get(effect, 0.0), 0.0) for effect, chance in chances.items())


def detectable_sizes(seen: Seen) -> dict[str, Sizes]:
    """Returns {effect: {parameter: least size that this recording detects}}, effects without a column included."""
    unsure = {effect: factor for effect, (_, factor) in seen.promised.items()}
    beside = beside_columns(seen.room, seen.light.lens, seen.asked)
    if (lens := falloff(seen.room, seen.asked)) is not None:
        beside.append(lens)
    least = {found.effect.id: found.least for found in beside if found.least}
    if "focus_mismatch" in seen.asked:
        least["drops on a window"] = LEAST_DROPS
    return _tells(seen, seen.scores, OF_A_UNIT, unsure) | least


def _tells(
    seen: Seen, scores: Reduced, spread: Mapping[str, float], unsure: Mapping[str, float] | None = None
) -> dict[str, Sizes]:
    """Returns {effect: {parameter: least size at which it is named}}, without sizes beyond the parameters' ranges.
    spread: {"effect.parameter": standard deviation between sessions of good cameras}. unsure: {effect: factor on its
    least sizes}."""
    out: dict[str, Sizes] = {}
    names = {c.name for c in scores.columns}
    for found in judged(scores, session_spread(scores, spread)):
        least_of: dict[str, float] = {}
        for p in (p for p in found.effect.parameters if p.name in found.least):
            name, least = f"{found.effect.id}.{p.name}", found.least[p.name]
            least = seen.sizes()(name)(least)[0] if name in names else least
            least *= (unsure or {}).get(found.effect.id, 1.0)
            if least <= p.high:
                least_of[p.name] = least
        if least_of:
            out[found.effect.id] = least_of
    return out


def _is_usual(seen: Seen, effect: str, told: Sizes) -> bool:
    """Returns whether the sizes `told` are all at most typical, or the effect needs no other recording."""
    typical = {p.name: p.typical for p in seen.asked[effect].parameters} if effect in seen.asked else {}
    return effect in _NEEDS_NO_MORE or all(size <= typical.get(name, np.inf) for name, size in told.items())


def plan_text(plan: Sequence[Recording]) -> str:
    """Returns a plan as text: for each recording a line with its minutes and the plan's minutes until its end."""
    return "\n".join(
        (f"would take longer: {r.text} ({r.minutes:g} min)" if r.ends is None else
         f"{n}. {r.text} ({r.minutes:g} min, {r.ends:g} in all)") + f": {sizes(r) or 'no effect'}"
        for n, r in enumerate(plan)
    )  # fmt: skip


def sizes(recording: Recording) -> str:
    """Returns text that lists the effects that a recording detects, with their least sizes."""
    each = {e: " or ".join(f"{name} {size:.2g}" for name, size in (told or {}).items())
            for e, told in recording.tells.items()}  # fmt: skip
    return ", ".join(f"{effect} from {said}" if said else effect for effect, said in each.items())
