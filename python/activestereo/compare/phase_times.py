# SPDX-License-Identifier: Apache-2.0
"""How long the phases of commands took on this machine, kept beside the cache of renders: what is left of a run is
estimated by the runs before."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from statistics import median
from typing import Any

from activestereo.capture.capture import SIDES, Capture
from activestereo.common.input_files import read_json
from activestereo.common.output_files import write_text
from activestereo.compare.cache import default_cache_folder

_FILE = "phase_times.json"
_KEPT_RUNS = 5


def megapixels(capture: Capture) -> float:
    """The size of a capture's infrared images, which the work on it grows with."""
    pixels = sum(capture.rig.camera(side).width * capture.rig.camera(side).height for side in SIDES)
    return 1e-6 * pixels * len(capture.frames)


class PhaseTimes:
    """Seconds per megapixel of a command's phases in its last runs. A file that cannot be read or written says nothing,
    and stops nothing."""

    def __init__(self, command: str, folder: str | Path | None = None) -> None:
        self._command, self._path = command, (Path(folder) if folder else default_cache_folder()) / _FILE

    def usual_s(self, first_guess_s: Mapping[str, float]) -> dict[str, float]:
        """{phase: the median of its last runs}, in the order of first_guess_s, whose values it has where there was no
        run."""
        own = self._stored().get(self._command)
        runs = own if isinstance(own, dict) else {}
        return {phase: _median(runs.get(phase), guess) for phase, guess in first_guess_s.items()}

    def keep(self, taken_s: Mapping[str, float], work_megapixels: float) -> None:
        """Adds a run."""
        if work_megapixels <= 0.0:
            return
        stored = self._stored()
        own = stored.get(self._command)
        runs: dict[str, Any] = own if isinstance(own, dict) else {}
        for phase, seconds in taken_s.items():
            before = runs.get(phase)
            kept = before if isinstance(before, list) else []
            runs[phase] = [*kept, round(seconds / work_megapixels, 4)][-_KEPT_RUNS:]
        with suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._path, json.dumps(stored | {self._command: runs}, indent=1) + "\n")

    def _stored(self) -> dict[str, Any]:
        try:
            stored = read_json(self._path)
        except (OSError, ValueError):
            return {}
        return stored if isinstance(stored, dict) else {}


def _median(seconds: Any, guess: float) -> float:
    """The median of what is a list of times, else the guess."""
    runs = seconds if isinstance(seconds, list) else []
    times = [float(x) for x in runs if isinstance(x, int | float) and 0.0 <= x < 1e6]
    return median(times) if times else guess
