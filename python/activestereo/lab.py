# SPDX-License-Identifier: Apache-2.0
"""The lab in one object, for a notebook: compare the simulator with a capture, find the missing effect, add it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from activestereo.compare.compare import Comparison, compare
from activestereo.compare.model_file import find, library, read_model, scene_of, write_model
from activestereo.diagnose import Diagnosis, diagnose
from activestereo.effects.core.model import Model
from activestereo.report.write_diagnosis import write_diagnosis

__all__ = ["Comparison", "Diagnosis", "Lab", "compare", "diagnose"]


class Lab:
    """A capture folder and a model of it (a Model, a model.json, or None for no effects).

    effects: files of your own effects. settings: renderer, samples_per_pixel, max_bounces, seed, cache, progress of
    compare().
    """

    def __init__(
        self,
        capture: str | Path,
        model: Model | str | Path | None = None,
        effects: Sequence[str | Path] = (),
        **settings: Any,
    ) -> None:
        self.capture = capture
        self.effects = library(*effects)
        self.model = model if isinstance(model, Model) else read_model(model, self.effects, scene_of(capture))
        self.comparison: Comparison | None = None
        self.diagnosis: Diagnosis | None = None
        self._settings = settings

    def compare(self) -> Comparison:
        """Compares the capture with the present model. Returns a Comparison."""
        self.comparison = compare(self.capture, model=self.model, **self._settings)
        return self.comparison

    def diagnose(self, workers: int | None = None) -> Diagnosis:
        """Finds the model's missing effects. Returns a Diagnosis; the model stays as it is until you add() an
        effect."""
        workers = workers or os.cpu_count() or 1
        self.diagnosis = diagnose(self.capture, self.model, self.effects, workers=workers, **self._settings)
        return self.diagnosis

    def add(self, effect_id: str, **parameters: float) -> Model:
        """Adds an effect and returns the model. Without parameters it takes the last diagnosis' values, else typical
        ones."""
        effect = find(self.effects, effect_id)
        if not parameters:
            entries: list[dict[str, Any]] = self.diagnosis.result["ranking"] if self.diagnosis else []
            found = next((e["parameters"] for e in entries if e["effect"] == effect_id), None)
            parameters = {name: v["value"] for name, v in found.items()} if found else effect.typical_values
        self.model = self.model.with_effect(effect, **parameters)
        return self.model

    def report(self, folder: str | Path) -> tuple[Path, Path]:
        """Writes compare.json, report.html, model.json and, after diagnose(), diagnose.json into a folder."""
        from activestereo.report.write import write_report  # matplotlib takes its time to load

        comparison = self.comparison or self.compare()
        if self.diagnosis is not None:
            write_diagnosis(self.diagnosis, folder)
        paths = write_report(comparison, folder)
        if not self._is_as_found():  # write_diagnosis() has written the complete one
            write_model(paths[0].parent / "model.json", self.model, scene_path=scene_of(self.capture))
        return paths

    def _is_as_found(self) -> bool:
        found = self.diagnosis
        return found is not None and found.sensor_model is not None and self.model is found.model
