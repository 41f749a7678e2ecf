# SPDX-License-Identifier: Apache-2.0
"""Writes the public headers, and computes the layout of their structs."""

from __future__ import annotations

import math

from table import SCALARS, Field, Header, Struct, Tables
from words import GENERATED, c_comment, c_literal, sentence


def _constants(struct: Struct) -> list[str]:
    out = []
    if struct.type_id is not None:
        out.append(f"#define {struct.type_name} 0x{struct.type_id:02x}u")
    for f in struct.fields:
        if not f.values:
            continue
        out.append("")
        if f.doc:
            out.append(c_comment(f"{struct.name}.{f.name}: {f.doc}"))
        for (name, value), text in zip(f.constants.items(), f.values.values(), strict=True):
            out.append(c_comment(text))
            out.append(f"#define {name} 0x{value:02x}u" if f.type == "bits" else f"#define {name} {value}u")
    return out


def _declaration(field: Field) -> str:
    suffix = "" if field.count == 1 else f"[{field.count}]"
    space = "" if field.c_type.endswith("* ") else " "
    return f"{field.c_type}{space}{field.name}{suffix};"


def _members(struct: Struct) -> list[str]:
    out = ["  ks_header header;"] if struct.type_id is not None else []
    for f in struct.fields:
        if f.group:
            out += ["", f"  /* -- {f.group} -- */"]
        text = sentence(f)
        if text:
            out.append(c_comment(text, "  "))
        out.append(f"  {_declaration(f)}")
    return out


def _is_zero(value: object) -> bool:
    return value is None or (isinstance(value, (int, float)) and value == 0)


def assignments(struct: Struct, variable: str, embedded: frozenset[str] = frozenset()) -> list[str]:
    """Returns C statements that give a zeroed struct its defaults where these are not 0."""
    out = []
    for f in struct.fields:
        value = f.default
        if f.type == "choice":
            value = f.prefix + value.upper() if value != next(iter(f.values)) or f.first else None
        kind = f.type if f.type in SCALARS else "uint32"
        if f.type in embedded and f.name not in struct.init:
            out.append(f"{variable}.{f.name} = {f.type}_init();")
        elif f.name in struct.init:
            out.append(f"{variable}.{f.name} = {f.name};")
        elif isinstance(value, list):
            nonzero = [(i, v) for i, v in enumerate(value) if not _is_zero(v)]
            out += [f"{variable}.{f.name}[{i}] = {c_literal(kind, v)};" for i, v in nonzero]
        elif f.count != 1 and not _is_zero(value):
            out += [f"{variable}.{f.name}[{i}] = {c_literal(kind, value)};" for i in range(int(f.count))]
        elif not _is_zero(value):
            if f.type not in SCALARS and isinstance(value, str):
                out.append(f"{variable}.{f.name} = {value};")
            else:
                out.append(f"{variable}.{f.name} = {c_literal(kind, value)};")
    return out


def _init(struct: Struct, embedded: frozenset[str]) -> list[str]:
    if struct.type_id is None and not struct.init and not assignments(struct, "s"):
        return []
    arguments = ", ".join(_declaration(struct[name]).rstrip(";") for name in struct.init) or "void"
    head = f"static inline {struct.name} {struct.name}_init({arguments}) {{"
    out = [head, f"  {struct.name} s;", "  memset(&s, 0, sizeof s);"]
    if struct.type_id is not None:
        out.append(f"  s.header = ks_header_make({struct.type_name}, KS_CAST(uint32_t, sizeof s));")
    return [*out, *(f"  {line}" for line in assignments(struct, "s", embedded=embedded)), "  return s;", "}"]


def embedded_structs(tables: Tables) -> frozenset[str]:
    """Returns the names of structs with a header and defaults that stand inside other structs by value."""
    return frozenset(s.name for s in tables.structs.values() if s.embedded and s.type_id is not None)


def header(entry: Header, embedded: frozenset[str]) -> str:
    """Returns the text of a public header: constants, structs, initialisers."""
    sources = ", ".join(s.source for s in entry.structs)
    guard = entry.path.upper().replace("/", "_").replace(".", "_")
    text = [c_comment(GENERATED.format(sources)), c_comment(entry.doc), f"#ifndef {guard}", f"#define {guard}", ""]
    uses_math = any(_uses_math(f) for s in entry.structs for f in s.fields)
    system = (["math.h"] if uses_math else []) + ["stdint.h", "string.h"]
    own = sorted(set(entry.includes) | {"ks/header.h"})
    text += [f"#include <{name}>" for name in system] + [""] + [f'#include "{name}"' for name in own] + [""]
    text += ["#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    if entry.text:
        text += [entry.text, ""]
    for s in entry.structs:
        constants = _constants(s)
        text += [*constants, ""] if constants else []
    for s in entry.structs:
        if s.doc:
            text.append(c_comment(s.doc))
        text += [f"typedef struct {s.name} {{", *_members(s), f"}} {s.name};", *_init(s, embedded), ""]
    if entry.after:
        text += [entry.after, ""]
    return "\n".join([*text, "#ifdef __cplusplus", "}", "#endif", "", "#endif", ""])


def _uses_math(field: Field) -> bool:
    values = field.default if isinstance(field.default, list) else [field.default]
    return any(isinstance(v, float) and not math.isfinite(v) for v in values)


def field_bytes(field: Field, tables: Tables, counts: dict[str, int]) -> tuple[int, int]:
    """Returns (bytes of the whole field, its alignment) on 64-bit targets. counts: {constant: length of an array}."""
    if field.is_pointer or field.type.endswith("_fn"):
        size = align = 8
    elif field.type in SCALARS:
        size = align = SCALARS[field.type][1]
    elif field.type in tables.structs:
        size, align = layout(tables.structs[field.type], tables, counts)[-1][1], 8  # each has a field of 8 bytes
    else:
        size = align = 8  # a handle
    count = counts.get(field.count, field.count) if isinstance(field.count, str) else field.count
    return size * int(count), align


def layout(struct: Struct, tables: Tables, counts: dict[str, int]) -> list[tuple[str, int, int]]:
    """Returns (name, offset, bytes) of each field, and at the end ('', sizeof, 0). counts: {constant: length of an
    array}."""
    at, widest, out = (8, 4, []) if struct.type_id is not None else (0, 1, [])
    for f in struct.fields:
        size, align = field_bytes(f, tables, counts)
        at = (at + align - 1) // align * align
        out.append((f.name, at, size))
        at, widest = at + size, max(widest, align)
    return [*out, ("", (at + widest - 1) // widest * widest, 0)]
