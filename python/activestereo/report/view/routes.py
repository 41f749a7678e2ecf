# SPDX-License-Identifier: Apache-2.0
"""The page's calls. Each takes a JSON object and returns one answer (packing.py)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from activestereo.effects import Effect
from activestereo.model import write_model
from activestereo.report.explorer import colour_stops
from activestereo.report.view.library import Library
from activestereo.report.view.packing import packed
from activestereo.report.view.save import free_name, saved_model
from activestereo.report.view.settings import Settings, settings_of
from activestereo.report.view.simulation import Pictures, Simulation, Superseded
from activestereo.report.view.sliders import camera_sliders, catalogue, present_effects, surface_sliders

# So many pages are told apart.
_MOST_PAGES = 64
_MAPS = ("gray", "RdBu_r", "viridis")


class Routes:
    """The calls on a library of sources. effects: {id: Effect} that may be added. save_as: path for models; an existing
    file is kept and the new one gets a number."""

    def __init__(self, library: Library, effects: Mapping[str, Effect], save_as: Path) -> None:
        self._library, self._effects, self._save_as = library, effects, save_as
        self._newest: dict[int, int] = {}  # the last serial number that each page has asked for

    def calls(self) -> dict[str, Callable[[dict[str, Any]], bytes]]:
        return {
            "list": self.list, "open": self.open, "measured": self.measured, "sliders": self.sliders,
            "surface": self.surface, "simulate": self.simulate, "save": self.save,
        }  # fmt: skip

    def list(self, given: dict[str, Any]) -> bytes:
        """The names of all that may be opened."""
        maps = {name: colour_stops(name) for name in _MAPS}
        return packed({"root": self._library.root.name, "entries": self._library.names, "maps": maps})

    def open(self, given: dict[str, Any]) -> bytes:
        """Opens one entry: its frames, and the page's data to draw it."""
        source = self._library.source(given.get("entry"))
        facts = {"title": source.title, "frames": source.frames(), **source.facts()}
        return packed(facts | {"is_simulated": source.simulation() is not None, "catalogue": catalogue(self._effects)})

    def measured(self, given: dict[str, Any]) -> bytes:
        """One frame as it was measured."""
        source = self._library.source(given.get("entry"))
        return _answer(source.measured(_frame(given)))

    def sliders(self, given: dict[str, Any]) -> bytes:
        """The camera's sliders for one frame, and the effects of the model."""
        source = self._library.source(given.get("entry"))
        _simulation(source)
        exposure = source.exposure(_frame(given))
        camera = [slider.as_json() for slider in camera_sliders(exposure)]
        return packed({"camera": camera, "effects": present_effects(exposure.model)})

    def surface(self, given: dict[str, Any]) -> bytes:
        """The name and the sliders of the material at pixel u, v of the left image; no name without a surface."""
        source = self._library.source(given.get("entry"))
        simulation = _simulation(source)
        found = simulation.surface(source.exposure(_frame(given)), self._settings(given, simulation), *_pixel(given))
        name, values = (None, None) if found is None else found
        return packed({"name": name, "sliders": [s.as_json() for s in surface_sliders(values)] if values else []})

    def save(self, given: dict[str, Any]) -> bytes:
        """Writes the sensor under the settings as a model. Returns its path and the command that simulates it."""
        source = self._library.source(given.get("entry"))
        simulation = _simulation(source)
        model, remark = saved_model(source.exposure(_frame(given)), self._settings(given, simulation))
        with free_name(self._save_as) as path:
            write_model(path, model)
        return packed({"path": str(path), "remark": remark})

    def simulate(self, given: dict[str, Any]) -> bytes:
        """One frame under the settings, as a draft or refined. page: a number of the page's own; serial: counts what it
        asks for. An answer with "superseded" has no images, because the page has asked for a newer frame."""
        source = self._library.source(given.get("entry"))
        simulation = _simulation(source)
        settings = self._settings(given, simulation)
        page, serial = (_whole(given, name) for name in ("page", "serial"))
        self._newest[page] = max(serial, self._newest.pop(page, serial))
        while len(self._newest) > _MOST_PAGES:
            self._newest.pop(next(iter(self._newest)))
        is_wanted = lambda: self._newest.get(page, serial) <= serial  # noqa: E731
        try:
            taken = simulation.picture(source.exposure(_frame(given)), settings, bool(given.get("is_draft")), is_wanted)
        except Superseded:
            return packed({"superseded": True})
        return _answer(taken)

    def _settings(self, given: dict[str, Any], simulation: Simulation) -> Settings:
        return settings_of(given.get("settings", {}), self._effects, simulation.material_names())


def _simulation(source: Any) -> Simulation:
    found = source.simulation()
    if found is None:
        raise ValueError(f"{source.title} has an empty scene: there is nothing to simulate")
    return found


def _frame(given: Mapping[str, Any]) -> int:
    return _whole(given, "frame")


def _pixel(given: Mapping[str, Any]) -> tuple[int, int]:
    return _whole(given, "u"), _whole(given, "v")


def _whole(given: Mapping[str, Any], name: str) -> int:
    value = given.get(name)
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{name} is {value!r}, expected a whole number")
    return value


def _answer(pictures: Pictures) -> bytes:
    facts = {
        "exposure_s": pictures.exposure_s,
        "gain": pictures.gain,
        "render_s": pictures.render_s,
    }
    return packed(facts, pictures.images())
