# SPDX-License-Identifier: Apache-2.0
"""Tables as Markdown and as aligned columns for a terminal."""

from collections.abc import Iterable, Sequence


def markdown(head: Sequence[object], rows: Iterable[Sequence[object]]) -> list[str]:
    """The table's lines."""
    titles, *lines = (f"| {' | '.join(map(str, cells))} |" for cells in (head, *rows))
    return [titles, f"|{'---|' * len(head)}", *lines]


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Lines whose cells stand below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)
