# SPDX-License-Identifier: Apache-2.0
"""Text and tables as HTML, for pages and notebooks."""

import html
from collections.abc import Sequence


def text(value: object) -> str:
    return html.escape(str(value))


def table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = (), wide: bool = False) -> str:
    """Formats an HTML table. head: column titles as plain text. rows: cells, which are trusted HTML. numbers: indices
    of right-aligned columns. wide: adds the CSS class `wide`."""
    cls = [' class="n"' if i in numbers else "" for i in range(len(head))]
    lines = ["<tr>" + "".join(f"<th{c}>{text(h)}</th>" for c, h in zip(cls, head, strict=True)) + "</tr>"]
    lines += [
        "<tr>" + "".join(f"<td{c}>{cell}</td>" for c, cell in zip(cls, row, strict=True)) + "</tr>" for row in rows
    ]
    return f"<table{' class=wide' if wide else ''}>" + "\n".join(lines) + "</table>"
