# SPDX-License-Identifier: Apache-2.0
"""Stores how long the phases of commands took on this machine, beside the cache of renders, to estimate the rest of a
run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from activestereo.capture.capture import SIDES, Capture
from activestereo.common.input_files import read_json
from activestereo.common.output_files import write_text
from activestereo.common.progress_bar import UsualTime
from activestereo.compare.cache import default_cache_folder

_FILE = "phase_times.json"
_KEPT_RUNS = 5


def megapixels(capture: Capture) -> float:
    """Returns the megapixels of all infrared images of a capture, to which the work is proportional."""
    pixels = sum(capture.rig.camera(side).width * capture.rig.camera(side).height for side in SIDES)
    return 1e-6 * pixels * len(capture.frames)


class PhaseTimes:
    """Stores how many seconds each phase of a command took in its last runs, and the megapixels of these runs. A file
    that cannot be read or written is ignored."""

    def __init__(self, command: str, folder: str | Path | None = None) -> None:
        self._command, self._path = command, (Path(folder) if folder else default_cache_folder()) / _FILE

    def usual(self, first_guess: Mapping[str, UsualTime]) -> dict[str, UsualTime]:
        """Returns {phase: UsualTime}: the first guess with the stored runs added, in the order of first_guess."""
        own = self._stored().get(self._command)
        runs = own if isinstance(own, dict) else {}
        return {phase: replace(guess, runs=_runs(runs.get(phase))) for phase, guess in first_guess.items()}

    def keep(self, taken_s: Mapping[str, float], work_megapixels: float) -> None:
        """Stores the durations of a run, {phase: seconds}."""
        if work_megapixels <= 0.0:
            return
        stored = self._stored()
        own = stored.get(self._command)
        runs: dict[str, Any] = own if isinstance(own, dict) else {}
        for phase, seconds in taken_s.items():
            runs[phase] = [*_runs(runs.get(phase)), (round(work_megapixels, 6), round(seconds, 3))][-_KEPT_RUNS:]
        with suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._path, json.dumps(stored | {self._command: runs}, indent=1) + "\n")

    def _stored(self) -> dict[str, Any]:
        try:
            stored = read_json(self._path)
        except (OSError, ValueError):
            return {}
        return stored if isinstance(stored, dict) else {}


def _runs(stored: Any) -> tuple[tuple[float, float], ...]:
    """Returns the pairs (megapixels, seconds) of a stored list; skips invalid entries."""
    pairs = [run for run in stored if isinstance(run, list) and len(run) == 2] if isinstance(stored, list) else []
    numbers = [run for run in pairs if all(isinstance(n, int | float) and 0.0 <= n < 1e6 for n in run)]
    return tuple((float(work), float(seconds)) for work, seconds in numbers if work > 0.0)
