# SPDX-License-Identifier: Apache-2.0
"""Formats a command's final output for a terminal: a sentence, figures, notes, and commands, ten lines of 80
columns."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

from activestereo.common.own_files import is_outside_allowed
from activestereo.common.shown import printable

COLUMNS = 80
WRITING, WRITING_S = "writing the report", 10.0  # the last phase's name, and how long it takes
_MOST_LINES = 10  # a command that is wrapped, because its paths are long, counts as one
_LONGEST_BAR = 24


@dataclass(frozen=True)
class Figure:
    """A line of the final screen: a name, a value and a bar. said: the value as text with its unit. size: the bar's
    length, relative to the other figures of the screen; None for no bar."""

    name: str
    said: str
    size: float | None = None


@dataclass(frozen=True)
class Step:
    """A command for the user to paste into a shell. words: its words, already quoted. label: the text before it."""

    words: tuple[str, ...]
    label: str

    @property
    def text(self) -> str:
        return " ".join(self.words)


def screen(
    sentence: str, figures: Sequence[Figure] = (), notes: Sequence[str] = (), steps: Sequence[Step] = (),
    see: str | Path | None = None, details: str = "", verbose: bool = False,
) -> str:  # fmt: skip
    """Returns the screen's text, without a last line feed.

    notes: sentences below the figures, most important first; those without room appear only if `verbose`. steps:
    made by command(). see: a file that shows more. details: tables that `verbose` adds at the end.
    """
    lines = wrapped(sentence)
    drawn = _bar_lines(figures)
    room, told = _MOST_LINES - len(lines) - len(drawn) - len(steps) - 1, []
    for said in ([f"  {note}"] if verbose else wrapped(note, "  ") for note in notes):
        if verbose or len(said) <= room:
            room -= len(said)
            told.append(said)
    lines += [*drawn, *(line for said in told for line in said)]
    lines += [line for step in steps for line in _command_lines(step)]
    more = "" if verbose or (len(told) == len(notes) and not details) else "more: --verbose"
    shown = f"see: {printable(see)}" if see else ""
    lines += [f"{shown} ({more})"] if shown and more else [line for line in (shown, more) if line]
    return "\n".join([*lines, *(["", wrapped_lines(details.splitlines())] if verbose and details else [])])


def command(*words: object, label: str = "next") -> Step:
    """Makes a Step of an activestereo command. words: unquoted, without "activestereo"."""
    given = ["activestereo", *(["--allow-outside"] if is_outside_allowed() else [])]
    for text in map(str, words):
        # Control characters become bash escapes, because they would end the line.
        escaped = printable(text.replace("\\", "\\\\")).replace("'", "\\'")
        given.append(shlex.quote(text) if text.isprintable() else f"$'{escaped}'")
    return Step(tuple(given), label)


def _bar_lines(figures: Sequence[Figure]) -> list[str]:
    name, said = (max(map(len, own), default=0) for own in ([f.name for f in figures], [f.said for f in figures]))
    longest = max((figure.size or 0.0 for figure in figures), default=0.0)
    room = min(_LONGEST_BAR, COLUMNS - name - said - 6)
    bars = ["█" * max(1, round(room * f.size / longest)) if f.size else "" for f in figures]
    return [
        f"  {printable(f.name):{name}}  {f.said:>{said}}  {bar}".rstrip() for f, bar in zip(figures, bars, strict=True)
    ]


def wrapped(text: str, indent: str = "") -> list[str]:
    """Wraps text to the terminal's width. Lines after the first are indented twice as far."""
    return wrap(
        printable(text), COLUMNS, initial_indent=indent, subsequent_indent=2 * indent, break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip


def wrapped_lines(lines: Sequence[str]) -> str:
    """Wraps each line of a text; continuation lines keep that line's indentation."""
    indented = [(line.lstrip(), " " * (len(line) - len(line.lstrip()))) for line in lines]
    return "\n".join(part for text, indent in indented for part in wrapped(text, indent) or [""])


def _command_lines(step: Step) -> list[str]:
    """Splits a long command into lines that a shell reads as one command."""
    parts: list[str] = []
    for word in step.words:  # an option and its value stay together
        if parts and parts[-1].startswith("-") and " " not in parts[-1]:
            parts[-1] += f" {word}"
        else:
            parts.append(word)
    start = f"{step.label}:"
    lines = [start]
    for part in parts:
        if len(lines[-1]) + len(part) > COLUMNS - 3 and lines != [start]:
            lines[-1] += " \\"
            lines.append("   ")
        lines[-1] += f" {part}"
    return lines
