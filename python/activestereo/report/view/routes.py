# SPDX-License-Identifier: Apache-2.0
"""The page's calls. Each takes a JSON object and returns one answer (packing.py)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from activestereo.effects import Effect
from activestereo.report.explorer import colour_stops
from activestereo.report.view.library import Library
from activestereo.report.view.packing import packed
from activestereo.report.view.settings import settings_of
from activestereo.report.view.simulation import Pictures, Simulation, Superseded

_MAPS = ("gray", "RdBu_r", "viridis")


class Routes:
    """The calls on a library of sources. effects: {id: Effect} that may be added."""

    def __init__(self, library: Library, effects: Mapping[str, Effect]) -> None:
        self._library, self._effects = library, effects

    def calls(self) -> dict[str, Callable[[dict[str, Any]], bytes]]:
        return {"list": self.list, "open": self.open, "measured": self.measured, "simulate": self.simulate}

    def list(self, given: dict[str, Any]) -> bytes:
        """The names of all that may be opened."""
        maps = {name: colour_stops(name) for name in _MAPS}
        return packed({"root": self._library.root.name, "entries": self._library.names, "maps": maps})

    def open(self, given: dict[str, Any]) -> bytes:
        """One entry: its frames, and what the page needs to draw it."""
        source = self._library.source(given.get("entry"))
        facts = {"title": source.title, "frames": source.frames(), **source.facts()}
        return packed(facts | {"is_simulated": source.simulation() is not None})

    def measured(self, given: dict[str, Any]) -> bytes:
        """One frame as it was measured."""
        source = self._library.source(given.get("entry"))
        return _answer(source.measured(_frame(given)), 0)

    def simulate(self, given: dict[str, Any]) -> bytes:
        """One frame under the settings, as a draft or refined. An answer with "superseded" has no images: another one
        was asked for meanwhile."""
        source = self._library.source(given.get("entry"))
        simulation = _simulation(source)
        settings = settings_of(given.get("settings", {}), self._effects, simulation.material_names())
        try:
            taken = simulation.picture(source.shot(_frame(given)), settings, bool(given.get("is_draft")))
        except Superseded:
            return packed({"superseded": True})
        return _answer(taken, given.get("ticket"))


def _simulation(source: Any) -> Simulation:
    found = source.simulation()
    if found is None:
        raise ValueError(f"{source.title} has an empty scene: there is nothing to simulate")
    return found


def _frame(given: Mapping[str, Any]) -> int:
    frame = given.get("frame")
    if isinstance(frame, bool) or not isinstance(frame, int):
        raise ValueError(f"frame is {frame!r}, expected a whole number")
    return frame


def _answer(pictures: Pictures, ticket: Any) -> bytes:
    facts = {
        "exposure_s": pictures.exposure_s,
        "gain": pictures.gain,
        "render_s": pictures.render_s,
        "ticket": ticket if isinstance(ticket, int) else None,
    }
    return packed(facts, pictures.images())
