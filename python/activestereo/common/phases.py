# SPDX-License-Identifier: Apache-2.0
"""Estimates the remaining time of work in phases, from the time that each phase took in earlier runs and the pace of
this run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from activestereo.common.progress_bar import Progress, ProgressBar, UsualTime

# A phase that exceeds its usual time is expected to need this share of its time so far in addition.
_OVERTIME = 0.1
# A phase faster than this share of its usual time was read from disk; it says nothing about the pace.
_KEPT = 0.2
# The usual pace weighs as much as this share of the whole work, done at that pace.
_TRUST = 0.05
# A phase that exceeds its usual time by a larger factor had other work, which later phases need not have.
_SLOWEST = 5.0


class Phases:
    """Reports the progress of work in phases. Call the object with the fraction 0..1 of the running phase. progress: a
    ProgressBar, which also shows the phase and the time left, or a function of the fraction of the whole. usual:
    {phase: its UsualTime}, in order. work: units of work, with which times grow. taken_s: {phase: seconds} of ended
    phases."""

    def __init__(
        self,
        progress: Progress | None,
        usual: Mapping[str, UsualTime],
        work: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._progress, self._clock, self._usual = progress, clock, dict(usual)
        self.work = work
        self.taken_s: dict[str, float] = {}
        self._start = self._begun = clock()
        self._phase: str | None = None
        self._told = self._fraction = 0.0

    def begin(self, phase: str) -> None:
        """Ends the running phase and begins `phase`, a key of `usual`."""
        self.end()
        self._phase, self._begun, self._fraction = phase, self._clock(), 0.0
        if isinstance(self._progress, ProgressBar):
            number = list(self._usual).index(phase) + 1
            self._progress.phase = f"{phase} {number}/{len(self._usual)}"
        self(0.0, begins=True)

    def end(self) -> None:
        """Ends the running phase and records its time."""
        if self._phase is not None:
            self.taken_s[self._phase] = self._clock() - self._begun
        self._phase = None

    def __call__(self, fraction: float, begins: bool = False) -> object:
        if self._progress is None or self._phase is None:
            return None
        self._fraction = max(self._fraction, fraction)  # a second pass, over other poses perhaps, begins at 0 again
        low_s, likely_s, high_s = self._left_s(self._fraction)
        done_s = self._clock() - self._start
        self._told = max(self._told, done_s / max(done_s + likely_s, 1e-9))
        if isinstance(self._progress, ProgressBar):
            self._progress.show(self._told, (low_s, high_s), begins)
            return None
        return self._progress(self._told)

    def _left_s(self, fraction: float) -> tuple[float, float, float]:
        """Estimates the (shortest, likely, longest) seconds left in the running phase and the later ones. fraction:
        0..1 of the running phase. As it grows, the phase's own pace counts more and its usual time less, because
        results from disk come at once."""
        assert self._phase is not None
        here, names = self._clock() - self._begun, list(self._usual)
        spans = {name: usual.span_s(self.work) for name, usual in self._usual.items()}
        behind = names[names.index(self._phase) + 1 :]
        # This run's time over the usual time, so far; a busy machine is slow in every phase.
        done = [(spans[name][1], seconds) for name, seconds in self.taken_s.items() if name in spans]
        done.append((spans[self._phase][1] * fraction, here))
        told = [(usual, seconds) for usual, seconds in done if seconds > _KEPT * usual > 0.0]
        trust_s = _TRUST * sum(likely for _, likely, _ in spans.values())
        pace = (trust_s + sum(seconds for _, seconds in told)) / (trust_s + sum(usual for usual, _ in told))
        pace = min(pace, _SLOWEST)
        out = []
        for usual, of in zip(spans[self._phase], range(3), strict=True):
            by_share = here * (1.0 - fraction) / fraction if fraction > 0.0 else pace * usual
            left = fraction * by_share + (1.0 - fraction) * max(pace * usual - here, _OVERTIME * here)
            out.append(left + pace * sum(spans[name][of] for name in behind))
        return out[0], out[1], out[2]
