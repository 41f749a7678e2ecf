# SPDX-License-Identifier: Apache-2.0
"""Writes the reference page of every public struct."""

from __future__ import annotations

import math

from table import Field, Struct, Tables
from words import GENERATED, default_text, range_text


def _shape(field: Field) -> str:
    if field.shape:
        return "[" + "][".join(map(str, field.shape)) + "]"
    return "" if field.count == 1 else f"[{field.count}]"


def _plain(text: str) -> str:
    """Returns text in Markdown whose brackets and bars are plain characters."""
    return text.replace("[", "\\[").replace("|", "\\|")


def _default(field: Field) -> str:
    """Returns the default as the page shows it."""
    if field.type == "flag":
        return "yes" if field.default else "no"
    if field.type in ("text",) or field.is_pointer:
        return "NULL"
    return default_text(field) or ("NAN" if isinstance(field.default, float) and math.isnan(field.default) else "0")


def _row(field: Field) -> str:
    kind = " \\| ".join(f"`{v}`" for v in field.values) if field.values else f"`{field.type}{_shape(field)}`"
    where = ", ".join(name for name, there in (("extras", field.extras),) if there)
    text = _plain(field.doc) + (f" (NAN: {field.nan})" if field.nan else "") + (f" *{where}*" if where else "")
    cells = [f"`{field.name}`", kind, range_text(field), field.unit, _default(field), text]
    return f"| {' | '.join(cells)} |"


def _section(struct: Struct) -> list[str]:
    reach = [f"Reachable in: {struct.reach}.", ""] if struct.reach else []
    head = ["| field | type | range | unit | default | what it is |", "|--|--|--|--|--|--|"]
    rows = [_row(f) for f in struct.fields if not f.reserved]
    return [f"## {struct.name}", _plain(struct.doc), "", *reach, *head, *rows, ""]


def page(tables: Tables) -> str:
    """Returns capi/generation/reference.md: a table of fields per struct."""
    text = ["<!-- " + GENERATED.format("*.toml") + " -->", "# Public structs, field by field",
            "An id counts from 1, and 0 is none.",
            "Fields marked *extras* are read from a glTF material's extras under their names.", ""]  # fmt: skip
    for struct in tables.structs.values():
        text += _section(struct)
    return "\n".join(text)
