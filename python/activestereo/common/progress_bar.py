# SPDX-License-Identifier: Apache-2.0
"""Shows the progress of long work as a bar on stderr, with the time left. The bar redraws itself on a terminal;
elsewhere it prints a line now and then."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO, TypeVar

from activestereo.common.shown import printable

_REDRAW_S = 0.1
_LINE_S = 15.0
_WIDTH = 28

# Called with the fraction done, 0..1; work that can be cancelled ends when it returns True.
Progress = Callable[[float], object]
_Progress = TypeVar("_Progress", Progress, None, Progress | None)


def silent(fraction: float) -> None:
    """A Progress that tells nothing."""


def part_of(progress: _Progress, start: float, end: float) -> _Progress:
    """Returns a progress function for one part of the work. It maps the part's fraction 0..1 to start..end of the whole
    and calls `progress`. Returns None if progress is None."""
    if progress is None:
        return None
    whole = progress
    return lambda fraction: whole(start + (end - start) * fraction)


class ProgressBar:
    """A progress bar, called with fractions 0..1. Leaving its context ends the bar's line. It never cancels the work;
    Ctrl-C does. phase: name of the current part of the work, shown beside the bar."""

    def __init__(self, label: str, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._label = printable(label)
        self._stream = stream or sys.stderr
        self._clock = clock
        self._terminal = self._stream.isatty()
        self._start = self._drawn = clock()
        self.phase = self._drawn_phase = ""

    def __enter__(self) -> ProgressBar:
        self._start = self._drawn = self._clock()
        return self

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
            self.phase = ""
            self._say(1.0, f"done in {duration(self._clock() - self._start)}")
        if self._terminal:
            self._stream.write("\n")
            self._stream.flush()

    def __call__(self, fraction: float) -> None:
        """Draws the bar if the last drawing is old or shows another phase."""
        now = self._clock()
        if self.phase == self._drawn_phase and now - self._drawn < (_REDRAW_S if self._terminal else _LINE_S):
            return
        self._drawn, self._drawn_phase = now, self.phase
        elapsed_s = now - self._start
        self._say(fraction, f"{duration(elapsed_s * (1.0 - fraction) / fraction)} left" if fraction > 0.01 else "...")

    def tell(self, text: str) -> None:
        """Writes a line that stays above the bar."""
        self._stream.write(f"\r\x1b[2K{text}\n" if self._terminal else f"{self._label}: {text}\n")
        self._stream.flush()

    def _say(self, fraction: float, note: str) -> None:
        phase = f"{self.phase}, " if self.phase else ""
        if self._terminal:
            full = round(_WIDTH * fraction)
            bar = "█" * full + "░" * (_WIDTH - full)
            self._stream.write(f"\r\x1b[2K{self._label}  {bar} {100.0 * fraction:3.0f} %  {phase}{note}")
        else:
            self._stream.write(f"{self._label}: {phase}{100.0 * fraction:.0f} %, {note}\n")
        self._stream.flush()


def duration(seconds: float) -> str:
    """Formats a duration as '0.4 s', '12 s', '3 min 05 s' or '1 h 02 min'."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    seconds = round(seconds)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60:02d} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60:02d} min"
