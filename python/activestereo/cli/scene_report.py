# SPDX-License-Identifier: Apache-2.0
"""Lines about a simulated scene: its infrared light, and the bodies that the picture does not show."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from activestereo.common.shown import printable
from activestereo.scene_io.staging import ROOM_LUX
from activestereo.scene_io.units import size_hint

if TYPE_CHECKING:
    import kuafu
    from activestereo.sensor.light_share import LightShare

# Of the infrared light at the dots, the projector's: below it depth is coarser. (In the example scene, whose table has
# 300 lux, it is a sixth, and a twenty-fifth of the light of all pixels.)
LEAST_SHARE = 0.05
_MOST_NAMED = 3


def light_line(share: LightShare | None, added: float | None) -> str:
    """The projector's share, how far the things are, and the room that was added where the scene has no light."""
    room = "" if added is None else f"a room of {ROOM_LUX:g} lux was added, for the scene has no light (--ambient); "
    if share is None:
        return f"light: {room}no infrared light comes from the picture's middle"
    other = f"; the brightest other is {share.brightest}, {_percent(share.brightest_share)}" if share.brightest else ""
    place = f"of the infrared light at the dots in the picture's middle, {share.distance_m:.2f} m away"
    projector = f"{_percent(share.dots)} {place}, is the projector's ({_percent(share.projector)} of all light there)"
    return f"light: {room}{projector}{other}"


def warn_of_light(share: LightShare | None) -> None:
    """Says on stderr that a projector's dots hardly stand out, and in which light."""
    if share is None or share.dots >= LEAST_SHARE or share.brightest is None:
        return
    light = f"{share.brightest} gives {_percent(share.brightest_share)} of the infrared light"
    _say(f"the dots hardly stand out: {light}, and the projector {_percent(share.dots)} of it at its dots")


def warn_of_unseen(unseen: Sequence[tuple[str, str]], summary: kuafu.SceneSummary) -> None:
    """Names bodies that the picture does not show, and why, on stderr."""
    if not unseen:
        return
    named = "; ".join(f"'{name}' is {why}" for name, why in unseen[:_MOST_NAMED])
    more = f"; and {len(unseen) - _MOST_NAMED} more" if len(unseen) > _MOST_NAMED else ""
    count = summary.instance_count
    what = "nothing can" if len(unseen) == count else f"{len(unseen)} of {count} bodies cannot"
    hint = size_hint(float(np.max(np.subtract(summary.bounds_max_m, summary.bounds_min_m))))
    _say(f"{what} be measured in this view: {named}{more}{f'. The scene is {hint}' if hint else ''}")


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.1 else f"{100.0 * share:.0f} %"


def _say(text: str) -> None:
    print(f"activestereo: {printable(text)}", file=sys.stderr)
