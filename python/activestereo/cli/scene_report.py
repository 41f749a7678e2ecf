# SPDX-License-Identifier: Apache-2.0
"""Writes lines about a simulated scene: its depth, its infrared light, and bodies that the sensor cannot measure."""

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

# Depth is coarser if the projector's share of the infrared light at the dots is below this. (In the example scene of
# 300 lux it is a sixth; the projector's share of all pixels' light is a twenty-fifth.)
LEAST_SHARE = 0.05
_MOST_NAMED = 3
_MOST_MATERIALS = 3


def depth_sentence(name: str, rows: Sequence[Accuracy]) -> str:
    """Returns a sentence with the share of pixels that have depth, their median error, and the share of invented depth.
    rows: accuracy of each material, the whole picture last."""
    whole = rows[-1]
    if not whole.pixels:
        return f"{name}: nothing is in the sensor's range."
    error = "" if not np.isfinite(whole.median_error_m) else f", median error {_millimetres(whole.median_error_m)}"
    return f"{name}: {_percent(whole.fill)} of the pixels have depth{error}; {_percent(whole.invented)} are invented."


def failing(rows: Sequence[Accuracy]) -> list[Figure]:
    """Returns a bar for each of the materials with most wrong pixels; its length is the share that is empty or
    invented. rows: as in depth_sentence()."""
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


def light_lines(share: LightShare | None, added: float | None, chosen: str) -> list[str]:
    """Returns lines on the view and the light. added: radiance of the light added to a dark scene, or None. chosen:
    words on the view that was chosen, empty where the scene or the user states one."""
    view = [f"view: the scene has no camera: {chosen} (--camera-to-world)"] if chosen else []
    room = [f"light added: a room of {ROOM_LUX:g} lux, for the scene has no light (--ambient)"] if added else []
    if share is None:
        return [*view, *room, "light: no infrared light comes from the picture's middle"]
    other = f", {share.brightest} {_percent(share.brightest_share)}" if share.brightest else ""
    dots = f"infrared at the dots ({share.distance_m:.2f} m): projector {_percent(share.projector)}"
    return [f"{dots}{other}", *view, *room]


def warn_of_light(share: LightShare | None) -> None:
    """Warns on stderr if the projector's dots hardly stand out, and names the brightest other light."""
    if share is None or share.projector >= LEAST_SHARE or share.brightest is None:
        return
    light = f"{share.brightest} gives {_percent(share.brightest_share)} of their light"
    _say(f"the dots hardly stand out: {light}, the projector {_percent(share.projector)}")


def warn_of_materials(model: SensorModel, scene: kuafu.Scene) -> None:
    """Warns on stderr of materials that the model has values for and the scene lacks. Albedo factors do not count: a
    diagnosis fits them to the scene of its own capture."""
    own = [scene.material_name(number) or "" for number in range(scene.summary.material_count)]
    stated = {name for name, fields in model.materials.items() if set(fields) - {"ir_albedo_factor"}}
    if absent := sorted(stated - set(own) - set(map(material_of, own))):
        _say(f"the model's {listed(absent)}: the scene has no such material (there are: {', '.join(own) or 'none'})")


def warn_of_unseen(unseen: Sequence[tuple[str, str]], summary: kuafu.SceneSummary) -> None:
    """Warns on stderr of bodies that the sensor cannot measure. unseen: (name, reason) of each. summary: the scene's
    count of bodies and its bounds, for a hint at wrong units."""
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
