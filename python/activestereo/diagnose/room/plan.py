# SPDX-License-Identifier: Apache-2.0
"""Plans recordings for the effects that a room leaves open: further views of this room, judged by the evidence that
they would bring, and commands for effects that no view of a room shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from activestereo.diagnose.room.evidence import Reduced, judged
from activestereo.diagnose.room.imagined import Take
from activestereo.diagnose.room.names import (
    LEAST_RESPONSE,
    LOOKED,
    NEEDED,
    Seen,
    beside_columns,
    session_spread,
    with_planned_pair,
)
from activestereo.diagnose.room.sessions import OF_A_UNIT, SAME_PLACE

Sizes = Mapping[str, float]


@dataclass(frozen=True)
class Recording:
    """A recording: the instruction, its minutes, and {effect: {parameter: the least size that it detects}}; None if
    that is not computed."""

    text: str
    minutes: float
    tells: Mapping[str, Sizes | None]


_THIS = "this recording"
_VIEWS = (
    ("one more view, turned by 15 degrees, exposure fixed", Take(turn_deg=(0.0, 15.0, 0.0))),
    ("one more view, rolled by 90 degrees where the first one was taken", Take(turn_deg=(0.0, 0.0, 90.0))),
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
    ("a scene of known shape, twenty frames of each view: activestereo diagnose renders it", 10.0, ()),
)  # fmt: skip


def plan_of(seen: Seen) -> list[Recording]:
    """Plans recordings. The first one is this recording with the sizes that it detects; then come views of this room,
    most effects per minute first, then commands. A view is listed for effects that this recording misses at typical
    size, or that it detects at a much smaller size. Commands are for effects that no view detects at typical size.
    Every effect asked about appears once or more."""
    this = detectable_sizes(seen)
    now = {effect for effect, told in this.items() if _is_usual(seen, effect, told)}
    offers = [(text, 1.0, _tells(seen, r, session_spread(r, OF_A_UNIT))) for text, take in _VIEWS
              for r in [with_planned_pair(seen, take)]]  # fmt: skip
    good = with_planned_pair(seen, Take(is_good=True))
    offers.append((_REFERENCE, 2.0, _tells(seen, good, session_spread(good, SAME_PLACE))))
    if "response_gamma" in {e.id for e in seen.asked}:
        offers.append((_EXPOSED, 1.0, LEAST_RESPONSE))
    plan, enough = [], set(now)
    for text, minutes, tells in offers:
        usual = {e for e, told in tells.items() if _is_usual(seen, e, told)}
        more = {e for e, told in tells.items() if e in this for name, size in told.items()
                if size < _MUCH_LESS * this[e].get(name, np.inf)}  # fmt: skip
        plan.append(Recording(text, minutes, {e: tells[e] for e in tells if e in more | (usual - now)}))
        enough |= usual
    plan = sorted((r for r in plan if r.tells), key=lambda r: -len(r.tells) / r.minutes)
    left = {e.id for e in seen.asked} - enough
    commands: list[Recording] = []
    for text, minutes, measured in _COMMANDS:
        if own := sorted(left.intersection(measured) if measured else left):
            commands.append(Recording(text, minutes, dict.fromkeys(own)))
            left.difference_update(own)
    return [Recording(_THIS, 0.0, this), *plan, *commands]


def detectable_sizes(seen: Seen) -> dict[str, Sizes]:
    """Returns {effect: {parameter: least size that this recording detects}}, effects without a column included."""
    return _tells(seen, seen.scores, session_spread(seen.scores, OF_A_UNIT)) | dict(
        beside_columns(seen.room, seen.asked)
    )


def _tells(seen: Seen, scores: Reduced, known: Mapping[str, float]) -> dict[str, Sizes]:
    """Returns {effect: {parameter: least size at which it is named}} for sizes within the parameters' ranges."""
    out: dict[str, Sizes] = {}
    names = {c.name for c in scores.columns}
    for found in judged(scores, known, LOOKED, NEEDED):
        least_of: dict[str, float] = {}
        for p in (p for p in found.effect.parameters if p.name in found.least):
            name, least = f"{found.effect.id}.{p.name}", found.least[p.name]
            least = seen.sizes()(name)(least)[0] if name in names else least
            if least <= p.high:
                least_of[p.name] = least
        if least_of:
            out[found.effect.id] = least_of
    return out


def _is_usual(seen: Seen, effect: str, told: Sizes) -> bool:
    """Returns whether all sizes are at most typical, or the effect needs no other recording."""
    typical = {p.name: p.typical for e in seen.asked if e.id == effect for p in e.parameters}
    return effect in _NEEDS_NO_MORE or all(size <= typical.get(name, np.inf) for name, size in told.items())


def plan_text(plan: Sequence[Recording]) -> str:
    """Returns a plan as text, one line for each recording."""
    return "\n".join(f"{n}. {r.text} ({r.minutes:g} min): {sizes(r) or 'no effect'}" for n, r in enumerate(plan))


def sizes(recording: Recording) -> str:
    """Returns the effects that a recording detects with their least sizes, as text."""
    each = {e: " or ".join(f"{name} {size:.2g}" for name, size in (told or {}).items())
            for e, told in recording.tells.items()}  # fmt: skip
    return ", ".join(f"{effect} from {said}" if said else effect for effect, said in each.items())
