# SPDX-License-Identifier: Apache-2.0
"""Formats tables as Markdown and as aligned columns for a terminal."""

from collections.abc import Iterable, Sequence


def markdown(head: Sequence[object], rows: Iterable[Sequence[object]]) -> list[str]:
    """Returns the lines of a Markdown table with these column titles and rows."""
    titles, *lines = (f"| {' | '.join(map(str, cells))} |" for cells in (head, *rows))
    return [titles, f"|{'---|' * len(head)}", *lines]


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Joins rows of cells to lines of text whose columns are aligned."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)
