# SPDX-License-Identifier: Apache-2.0
"""Defines the calls that the page makes. Each takes a JSON object and returns one binary answer: four bytes with the
length of a JSON text, that text, then the images' values.

The text's "arrays" are {name: [type, height, width, first byte after the text]}. The text ends at a multiple of eight
bytes.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.output_files import finite
from activestereo.effects import Effect
from activestereo.model import Quantity, SensorModel, write_model
from activestereo.model.model import NUISANCES
from activestereo.report.explorer import colour_maps
from activestereo.report.view import settings as positions
from activestereo.report.view.library import Library
from activestereo.report.view.settings import BY_HAND, Settings, settings_of
from activestereo.report.view.simulation import Exposure, Pictures, Simulation, Superseded

# The most pages whose latest request is remembered.
_MOST_PAGES = 64
_ALIGNMENT = 8
_MOST_NUMBERS = 10_000
_POWER = "projector_scale"


class Routes:
    """Answers the page's calls on a library of sources. effects: {id: Effect} that may be added. save_as: path for
    saved models; if it exists, the new file's name gets a number."""

    def __init__(self, library: Library, effects: Mapping[str, Effect], save_as: Path) -> None:
        self._library, self._effects, self._save_as = library, effects, save_as
        self._newest: dict[int, int] = {}  # {page: the serial number of its latest request}

    def calls(self) -> dict[str, Callable[[dict[str, Any]], bytes]]:
        return {
            "list": self.list, "open": self.open, "measured": self.measured, "sliders": self.sliders,
            "surface": self.surface, "simulate": self.simulate, "save": self.save,
        }  # fmt: skip

    def list(self, given: dict[str, Any]) -> bytes:
        """Answers with the names of all entries that can be opened."""
        return packed({"root": self._library.root.name, "entries": self._library.names, "maps": colour_maps()})

    def open(self, given: dict[str, Any]) -> bytes:
        """Opens one entry. Answers with its title, its frames, and the camera figures that the page draws with."""
        source = self._library.source(given.get("entry"))
        facts = {"title": source.title, "frames": source.frames(), **source.facts()}
        return packed(
            facts | {"is_simulated": source.simulation() is not None, "catalogue": positions.catalogue(self._effects)}
        )

    def measured(self, given: dict[str, Any]) -> bytes:
        """Answers with one measured frame."""
        source = self._library.source(given.get("entry"))
        return _answer(source.measured(_whole(given, "frame")))

    def sliders(self, given: dict[str, Any]) -> bytes:
        """Answers with the camera's sliders for one frame, and the parameters of the effects in the sensor's model."""
        _, exposure, _ = self._asked(given)
        camera = positions.camera_sliders(exposure.config)
        return packed({"camera": camera, "effects": positions.present_effects(exposure.model)})

    def surface(self, given: dict[str, Any]) -> bytes:
        """Answers with the name and sliders of the material at pixel u, v of the left image; the name is null without a
        surface."""
        simulation, exposure, settings = self._asked(given)
        found = simulation.surface(exposure, settings, _whole(given, "u"), _whole(given, "v"))
        name, values = (None, None) if found is None else found
        return packed({"name": name, "sliders": positions.surface_sliders(values) if values else []})

    def save(self, given: dict[str, Any]) -> bytes:
        """Writes a model.json of the sensor with the page's settings applied. Answers with its path and a
        remark on settings that it cannot hold."""
        _, exposure, settings = self._asked(given)
        model, remark = saved_model(exposure, settings)
        with free_name(self._save_as) as path:
            write_model(path, model)
        return packed({"path": str(path), "remark": remark})

    def simulate(self, given: dict[str, Any]) -> bytes:
        """Answers with one frame simulated under the settings, as a draft or refined. If the page has asked for a newer
        frame, the answer is {"superseded": true} without images.

        In `given`, "page" is a random number that identifies the page, and "serial" counts the page's requests.
        """
        page, serial = (_whole(given, name) for name in ("page", "serial"))
        self._newest[page] = max(serial, self._newest.pop(page, serial))
        while len(self._newest) > _MOST_PAGES:
            self._newest.pop(next(iter(self._newest)))
        is_wanted = lambda: self._newest.get(page, serial) <= serial  # noqa: E731
        simulation, exposure, settings = self._asked(given)
        try:
            taken = simulation.picture(exposure, settings, bool(given.get("is_draft")), is_wanted)
        except Superseded:
            return packed({"superseded": True})
        return _answer(taken)

    def _asked(self, given: dict[str, Any]) -> tuple[Simulation, Exposure, Settings]:
        """Returns the simulation, the exposure and the settings that a call names. Raises ValueError without a
        scene."""
        source = self._library.source(given.get("entry"))
        simulation = source.simulation()
        if simulation is None:
            raise ValueError(f"{source.title} has an empty scene: there is nothing to simulate")
        settings = settings_of(given.get("settings", {}), self._effects, simulation.material_names())
        return simulation, source.exposure(_whole(given, "frame")), settings


def _whole(given: Mapping[str, Any], name: str) -> int:
    value = given.get(name)
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{name} is {value!r}, expected a whole number")
    return value


def _answer(pictures: Pictures) -> bytes:
    facts, images = (
        {name: getattr(pictures, name) for name in names}
        for names in (("exposure_s", "gain", "render_s"), ("left", "right", "disparity"))
    )
    return packed(facts, images)


def packed(content: Mapping[str, Any], images: Mapping[str, NDArray[Any]] | None = None) -> bytes:
    """Packs an answer. content: for its JSON. images: {name: [height][width] of float32, uint8 or uint32}; NaN = no
    value."""
    arrays, parts, size = {}, [], 0
    for name, image in (images or {}).items():
        data = np.ascontiguousarray(image).astype(image.dtype.newbyteorder("<"), copy=False).tobytes()
        arrays[name] = [image.dtype.name, *image.shape, size]
        parts.append(data + b"\0" * (-len(data) % _ALIGNMENT))
        size += len(parts[-1])
    text = json.dumps(finite({**content, "arrays": arrays}), allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-(4 + len(text)) % _ALIGNMENT)
    return b"".join([struct.pack("<I", len(text)), text, *parts])


def saved_model(exposure: Exposure, settings: Settings) -> tuple[SensorModel, str]:
    """Returns (the sensor's model under the settings, a remark). The remark lists `simulate` options for settings that
    a model without rig or fitted projector cannot hold; it is empty if the model holds all."""
    config, model = settings.applied(deepcopy(exposure.config), exposure.model)
    remarks = []
    if model.rig is not None:
        rig = replace(model.rig, exposure_s=config.ir_camera_exposure, gain=config.ir_camera_gain)
        model = replace(model, rig=rig)
    else:
        remarks += [] if settings.exposure_s is None else [f"--ir-exposure {settings.exposure_s:g}"]
        remarks += [] if settings.gain is None else [f"in Python config.ir_camera_gain = {settings.gain:g}"]
    if settings.laser_power_mw is not None:
        known = model.nuisances.get(_POWER)
        if known is None:
            remarks.insert(0, f"--laser-power {settings.laser_power_mw:g}")
        else:
            share = settings.laser_power_mw / config.laser_power_nominal_mw
            scaled = Quantity(share * known.value, unit=NUISANCES[_POWER][0], source=BY_HAND)
            model = replace(model, nuisances={**model.nuisances, _POWER: scaled})
    return model, ", ".join(remarks)


@contextmanager
def free_name(path: Path) -> Iterator[Path]:
    """Yields `path`, or if it exists a numbered one: model.json, model-2.json. An empty file reserves the name at once;
    it is removed if the block fails."""
    for number in range(1, _MOST_NUMBERS):
        name = path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
        try:
            name.touch(exist_ok=False)
        except FileExistsError:
            continue
        try:
            yield name
        except BaseException:
            name.unlink()
            raise
        return
    raise ValueError(f"{path}: its {_MOST_NUMBERS - 1} numbered names are taken: give another name with --out")
