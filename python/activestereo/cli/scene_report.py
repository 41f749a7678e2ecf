# SPDX-License-Identifier: Apache-2.0
"""Lines about a simulated scene: its depth, its infrared light, and the bodies that the picture does not show."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from activestereo.common.shown import listed, printable
from activestereo.effects.core.scene_surfaces import material_of
from activestereo.report.screen import Figure
from activestereo.scene_io.scene_files import size_hint
from activestereo.scene_io.staging import ROOM_LUX

if TYPE_CHECKING:
    import kuafu
    from activestereo.common.accuracy import Accuracy
    from activestereo.model import SensorModel
    from activestereo.sensor.light_share import LightShare

# The projector's share of the infrared light at the dots below which depth is coarser. (The example scene, whose table
# has 300 lux, has a sixth; the share of all pixels' light is a twenty-fifth.)
LEAST_SHARE = 0.05
_MOST_NAMED = 3
_MOST_MATERIALS = 3


def depth_sentence(name: str, rows: Sequence[Accuracy]) -> str:
    """A sentence with the share of a picture that has depth, and its error."""
    whole = rows[-1]
    if not whole.pixels:
        return f"{name}: nothing is in the sensor's range."
    error = "" if not np.isfinite(whole.median_error_m) else f", median error {_millimetres(whole.median_error_m)}"
    return f"{name}: {_percent(whole.fill)} of the pixels have depth{error}; {_percent(whole.invented)} are invented."


def failing(rows: Sequence[Accuracy]) -> list[Figure]:
    """The materials with the most pixels that are empty or invented, the bars: their share of each."""
    fault = {
        row.name: 1.0 - row.fill + row.invented for row in rows[:-1] if row.pixels and np.isfinite(row.median_error_m)
    }
    worst = sorted((row for row in rows if row.name in fault), key=lambda row: -row.pixels * fault[row.name])[
        :_MOST_MATERIALS
    ]
    return [
        Figure(row.name[:18], f"{_percent(1.0 - row.fill)} empty, {_percent(row.invented)} invented, "
               f"{_millimetres(row.median_error_m)}", fault[row.name])
        for row in worst
    ]  # fmt: skip


def light_lines(share: LightShare | None, added: float | None) -> list[str]:
    """The projector's share, how far the things are, and the room that was added where the scene has no light."""
    room = [f"light added: a room of {ROOM_LUX:g} lux, for the scene has no light (--ambient)"] if added else []
    if share is None:
        return [*room, "light: no infrared light comes from the picture's middle"]
    other = f"; the brightest other is {share.brightest}, {_percent(share.brightest_share)}" if share.brightest else ""
    place = f"of the infrared light at the dots, {share.distance_m:.2f} m away in the middle"
    return [*room, f"light: {_percent(share.projector)} {place}, is the projector's{other}"]


def warn_of_light(share: LightShare | None) -> None:
    """Says on stderr that a projector's dots hardly stand out, and in which light."""
    if share is None or share.projector >= LEAST_SHARE or share.brightest is None:
        return
    light = f"{share.brightest} gives {_percent(share.brightest_share)} of their light"
    _say(f"the dots hardly stand out: {light}, the projector {_percent(share.projector)}")


def warn_of_materials(model: SensorModel, scene: kuafu.Scene) -> None:
    """Names materials on stderr whose values a model states and the scene lacks. Factors of a diagnosis are of its own
    capture's scene."""
    own = [scene.material_name(number) or "" for number in range(scene.summary.material_count)]
    stated = {name for name, fields in model.materials.items() if set(fields) - {"ir_albedo_factor"}}
    if absent := sorted(stated - set(own) - set(map(material_of, own))):
        _say(f"the model's {listed(absent)}: the scene has no such material (there are: {', '.join(own) or 'none'})")


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


def _millimetres(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm"


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.1 else f"{100.0 * share:.0f} %"


def _say(text: str) -> None:
    print(f"activestereo: {printable(text)}", file=sys.stderr)
