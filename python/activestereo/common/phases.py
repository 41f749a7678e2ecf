# SPDX-License-Identifier: Apache-2.0
"""The phases of long work: which one runs, and how long the rest takes by the seconds that each took in earlier runs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from activestereo.common.progress_bar import Progress, ProgressBar

# A phase that takes longer than it used to is told to need this share of its time so far.
_OVERTIME = 0.1


class Phases:
    """Tells the progress of work in phases. Called with the fraction 0..1 of the phase that runs.

    progress: a ProgressBar, which names the phases, or a Progress, which is called with the fraction of the whole.
    usual_s: {phase: seconds per unit of work}, in the order in which they run. taken_s: {phase: seconds} of those that
    have ended.
    """

    def __init__(
        self,
        progress: Progress | None,
        usual_s: Mapping[str, float],
        work: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._progress, self._clock, self._usual_s = progress, clock, dict(usual_s)
        self.work = work
        self.taken_s: dict[str, float] = {}
        self._start = self._begun = clock()
        self._phase: str | None = None
        self._told = 0.0

    def begin(self, phase: str) -> None:
        """Ends the phase that runs and begins one of usual_s."""
        self.end()
        self._phase, self._begun = phase, self._clock()
        if isinstance(self._progress, ProgressBar):
            number = list(self._usual_s).index(phase) + 1
            self._progress.phase = f"{phase} {number}/{len(self._usual_s)}"
        self._tell(0.0, begins=True)

    def end(self) -> None:
        """Ends the phase that runs."""
        if self._phase is not None:
            self.taken_s[self._phase] = self._clock() - self._begun
        self._phase = None

    def __call__(self, fraction: float) -> object:
        return self._tell(fraction)

    def _tell(self, fraction: float, begins: bool = False) -> object:
        if self._progress is None or self._phase is None:
            return None
        left_s = self._left_s(fraction)
        done_s = self._clock() - self._start
        self._told = max(self._told, done_s / max(done_s + left_s, 1e-9))
        if isinstance(self._progress, ProgressBar):
            self._progress.show(self._told, left_s, begins)
            return None
        return self._progress(self._told)

    def _left_s(self, fraction: float) -> float:
        """Seconds that are left of the phase that runs and of those behind it. The more of the phase is done, the more
        its share says, and the less its usual time: what was kept on disk passes at once."""
        assert self._phase is not None
        here, usual = self._clock() - self._begun, self.work * self._usual_s[self._phase]
        by_share = here * (1.0 - fraction) / fraction if fraction > 0.0 else usual
        left = fraction * by_share + (1.0 - fraction) * max(usual - here, _OVERTIME * here)
        names = list(self._usual_s)
        behind = names[names.index(self._phase) + 1 :]
        return left + self.work * sum(self._usual_s[name] for name in behind)
