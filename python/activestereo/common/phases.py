# SPDX-License-Identifier: Apache-2.0
"""Reports the progress of work in phases, each of which counts for its usual share of the time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from activestereo.common.progress_bar import Progress, ProgressBar


class Phases:
    """Reports the progress of work in phases. Call the object with the fraction 0..1 of the current phase. progress: a
    ProgressBar, which also shows the phase's name, or a function of the whole's fraction 0..1. usual_s: {phase: usual
    seconds on two cores}, in order, from which the shares follow. taken_s: {ended phase: seconds}."""

    def __init__(
        self, progress: Progress | None, usual_s: Mapping[str, float], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._progress, self._clock, self._usual_s = progress, clock, dict(usual_s)
        self.taken_s: dict[str, float] = {}
        self._begun = clock()
        self._phase: str | None = None
        self._told = 0.0

    def begin(self, phase: str) -> None:
        """Ends the running phase and begins `phase`, a key of `usual_s`."""
        self.end()
        self._phase, self._begun = phase, self._clock()
        if isinstance(self._progress, ProgressBar):
            self._progress.phase = f"{phase} {list(self._usual_s).index(phase) + 1}/{len(self._usual_s)}"
        self(0.0)

    def end(self) -> None:
        """Ends the running phase and records its time."""
        if self._phase is not None:
            self.taken_s[self._phase] = self._clock() - self._begun
        self._phase = None

    def __call__(self, fraction: float) -> object:
        if self._progress is None or self._phase is None:
            return None
        names = list(self._usual_s)
        done_s = sum(self._usual_s[name] for name in names[: names.index(self._phase)])
        done_s += fraction * self._usual_s[self._phase]
        self._told = max(self._told, done_s / sum(self._usual_s.values()))  # a second pass of a phase begins at 0 again
        return self._progress(self._told)
