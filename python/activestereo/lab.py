# SPDX-License-Identifier: Apache-2.0
"""Provides the lab as one object for notebooks: compares the simulator with a capture, finds the missing effect, adds
it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from activestereo.compare.compare import Comparison, compare
from activestereo.diagnose import Diagnosis, diagnose
from activestereo.effects.core.model import Model
from activestereo.model import SensorModel, write_model
from activestereo.model.library import compared_under, find, library, read_models, scene_of, with_effects_of

__all__ = ["Comparison", "Diagnosis", "Lab", "compare", "diagnose"]
_SETTINGS = ("renderer", "samples_per_pixel", "max_bounces", "seed", "cache", "progress")


class Lab:
    """Holds a capture folder and the sensor model under test: a Model, the path of a model.json, or None for no
    effects. All that a model.json says beside its effects holds, too: rig, pattern, imager, materials.

    effects: files with the user's own effects. settings: keyword arguments of compare() and diagnose(): renderer,
    samples_per_pixel, max_bounces, seed, cache, progress. Raises TypeError for others.
    """

    def __init__(
        self,
        capture: str | Path,
        model: Model | str | Path | None = None,
        effects: Sequence[str | Path] = (),
        **settings: Any,
    ) -> None:
        if unknown := settings.keys() - _SETTINGS:
            raise TypeError(f"unknown settings: {', '.join(sorted(unknown))}; there are {', '.join(_SETTINGS)}")
        self.capture = capture
        self.effects = library(*effects)
        self._stated: SensorModel | None = None  # the file's sensor
        if model is None or isinstance(model, Model):
            self.model = model or Model()
        else:
            self._stated, self.model = read_models(model, self.effects, scene_of(capture))
        self.comparison: Comparison | None = None
        self.diagnosis: Diagnosis | None = None
        self._settings = settings

    def compare(self) -> Comparison:
        """Renders the capture with the present model, keeps the Comparison in `comparison` and returns it."""
        own: dict[str, Any] = {"model": self.model}
        under = own if self._stated is None else compared_under(self._whole(), self.capture)
        self.comparison = compare(self.capture, **under, **self._settings)
        return self.comparison

    def diagnose(self, workers: int | None = None) -> Diagnosis:
        """Finds the effects that the model lacks and returns the Diagnosis. The model does not change until add().
        workers: processes; None for one per core."""
        workers = workers or os.cpu_count() or 1
        model: Model | SensorModel = self.model if self._stated is None else self._whole()
        self.diagnosis = diagnose(self.capture, model, self.effects, workers=workers, **self._settings)
        return self.diagnosis

    def add(self, effect_id: str, **parameters: float) -> Model:
        """Adds an effect to the model and returns the new model. Without parameters the effect takes the last
        diagnosis' values, else its typical ones."""
        effect = find(self.effects, effect_id)
        if not parameters:
            entries: list[dict[str, Any]] = self.diagnosis.result["ranking"] if self.diagnosis else []
            found = next((e["parameters"] for e in entries if e["effect"] == effect_id), None)
            parameters = {name: v["value"] for name, v in found.items()} if found else effect.typical_values
        self.model = self.model.with_effect(effect, **parameters)
        return self.model

    def report(self, folder: str | Path) -> tuple[Path, Path]:
        """Writes compare.json, report.html and model.json into a folder, and diagnose.json after diagnose(). Returns
        write_report()'s paths."""
        from activestereo.report.write import write_diagnosis, write_report  # matplotlib takes its time to load

        comparison = self.comparison or self.compare()
        found = self.diagnosis
        if found is not None:
            write_diagnosis(found, folder)
        paths = write_report(comparison, folder)
        if found is None or found.sensor_model is None or self.model is not found.model:  # else it is written
            write_model(paths[0].parent / "model.json", self._whole())
        return paths

    def _whole(self) -> SensorModel:
        """Returns the present effects beside all else that the last diagnosis found, or the given file says."""
        found = None if self.diagnosis is None else self.diagnosis.sensor_model
        return with_effects_of(found or self._stated or SensorModel(), self.model, scene_of(self.capture))
