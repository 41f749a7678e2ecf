# SPDX-License-Identifier: Apache-2.0
"""Options of the engines: the bindings' lists of keyword arguments, and what a sensor's configuration and the command
line have."""

from __future__ import annotations

import dataclasses
import math
import textwrap

from emit_cpp import banner, cpp_file
from table import Field, Struct, Tables
from words import GENERATED, WIDTH, number, python_words, range_text


def named(struct: Struct) -> Struct:
    """The struct with what Python gives by keyword alone: no array, no pointer, no struct inside."""
    kinds = ("flag", "choice", "bits", "id", "index", "float", "double", "uint32", "int32", "uint64", "text")
    return dataclasses.replace(
        struct, fields=[f for f in struct.fields if f.python and f.count == 1 and f.type in kinds]
    )


def _fields_h(name: str, structs: dict[str, Struct], include: str) -> str:
    text = []
    for variable, s in structs.items():
        text += ["", f"inline const Field<{s.name}> {variable}_fields[] = {{"]
        for f in named(s).fields:
            if f.type == "text":
                continue
            kind = f.type if f.type in ("flag", "choice", "bits", "id", "index") else "number"
            names = "{" + ", ".join(f'"{v}"' for v in f.values) + "}"
            one = f', "{f.one}"' if f.one else ""
            for given in filter(None, (f.name, f.short)):
                text.append(f'    {{"{given}", &{s.name}::{f.name}, Field<{s.name}>::Kind::{kind}, {names}{one}}},')
        text.append("};")
    head = banner(*structs.values(), note=f"{name}: fields by name.")
    return cpp_file(head, ["once", "", '"bindings/named_fields.h"', f'"{include}"'], text, "ks_python")


def options_doc(struct: Struct, width: int) -> list[str]:
    """Lines of prose: what each keyword argument of the struct means, and each of its values."""
    lines: list[str] = []
    for f in named(struct).fields:
        text = " ".join(f"{f.name}{f' or {f.short}' if f.short else ''}: {python_words(f.doc)}".split())
        text += "".join(f" '{value}': {python_words(doc)}" for value, doc in f.values.items())
        lines += textwrap.wrap(text, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return lines


def simsense_fields_h(tables: Tables) -> str:
    """python/simsense/fields.h"""
    names = {"parameter": "simsense_parameters", "signal": "simsense_signal", "rig": "simsense_rig_desc"}
    return _fields_h("simsense's structs", {key: tables.structs[name] for key, name in names.items()}, "simsense_api.h")


def kuafu_options_h(tables: Tables) -> str:
    """python/kuafu/options.h"""
    names = {"renderer": "kuafu_renderer_desc", "render": "kuafu_render_desc"}
    structs = {key: tables.structs[name] for key, name in names.items()}
    return _fields_h("Options of a renderer and of a render", structs, "kuafu_api.h")


def literal(field: Field) -> str:
    """The default as Python has it."""
    value = field.default
    if field.type == "flag":
        return str(bool(value))
    if field.type in ("bits", "text", "id", "index"):
        return "()" if field.type == "bits" else "None"
    if isinstance(value, float) and not math.isfinite(value):
        return "None" if math.isnan(value) else f'float("{value}")'
    if field.type in ("float", "double"):
        return repr(float(value))
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _kind(field: Field) -> str:
    kinds = {"float": "float", "double": "float", "flag": "bool", "choice": "str", "text": "str", "bits": "tuple"}
    return kinds.get(field.type, "int")


def _annotation(field: Field) -> str:
    if field.type == "choice":
        return "Literal[" + ", ".join(f'"{v}"' for v in field.values) + "]"
    return {"bits": "tuple[str, ...]", "text": "str | None"}.get(field.type, _kind(field))


def _range(f: Field) -> tuple[float, float] | None:
    """The range of a number; an unsigned one is never negative."""
    if f.type in ("uint32", "uint64") and not f.range and not f.allowed:
        return (0, 2**32 - 1 if f.type == "uint32" else 2**64 - 1)
    return f.range


def _bound(value: float) -> str:
    return f'float("{value}")' if math.isinf(value) else number(value)


def _row(f: Field) -> list[str]:
    more = [f'unit="{f.unit}"'] if f.unit else []
    more += [f'possible="{range_text(f)}"'] if range_text(f) else []
    more += [f"range=({', '.join(_bound(v) for v in _range(f))})"] if _range(f) else []
    more += [f"allowed={f.allowed!r}"] if f.allowed else []
    more += ["or_zero=True"] if f.zero_means is not None else []
    more += _choices(f) if f.values else []
    more += [f'{key}="{value}"' for key, value in (("pair", f.pair), ("short", f.short), ("one", f.one)) if value]
    more += ["on_command_line=False"] if not f.option else []
    doc = python_words(f.doc)
    lines = [f'"{f.name}",', f"{_kind(f)},", f"{literal(f)},", *(f"{m}," for m in more)]
    lines += [f'doc="{doc}",  # noqa: E501' if len(doc) > 104 else f'doc="{doc}",']
    return ["    Parameter(", *(f"        {line}" for line in lines), "    ),"]


def _choices(f: Field) -> list[str]:
    """One line, or several of at most 120 columns."""
    names = ", ".join(f'"{v}"' for v in f.values)
    if len(names) <= 98:
        return [f"choices=({names})"]
    lines = textwrap.wrap(names + ",", WIDTH - 12)
    return ["choices=(\n" + "\n".join(f"            {line}" for line in lines) + "\n        )"]


def _option_table(what: str, structs: dict[str, Struct], owner: str, records: dict[str, Struct]) -> str:
    """A Python module: a tuple of Parameters for each struct, and a class with the types of all; tuples alone for
    records, which are given whole."""
    sources = ", ".join(s.source for s in (*structs.values(), *records.values()))
    text = [*textwrap.wrap("# " + GENERATED.format(sources), WIDTH, subsequent_indent="# "),
            f'"""{what}, for a sensor\'s configuration and the command line."""', "",
            "from typing import Literal", "", "from activestereo.common.parameter import Parameter"]  # fmt: skip
    shown = {key: [f for f in named(s).fields if f.config] for key, s in structs.items()}
    for key, fields in (shown | {key: named(s).fields for key, s in records.items()}).items():
        text += ["", f"{key} = (", *(line for f in fields for line in _row(f)), ")"]
    text += ["", "", f"class {owner}:", '    """Their types. A class that has them as attributes inherits this."""', ""]
    text += [f"    {f.name}: {_annotation(f)}" for fields in shown.values() for f in fields]
    return "\n".join([*text, ""])


def matcher_table(tables: Tables) -> str:
    """python/activestereo/common/matcher_table.py"""
    structs = {"MATCHER": tables.structs["simsense_parameters"], "RIG": tables.structs["simsense_rig_desc"]}
    return _option_table(
        "The stereo engine's options", structs, "MatcherFields", {"SIGNAL": tables.structs["simsense_signal"]}
    )


def render_table(tables: Tables) -> str:
    """python/activestereo/common/render_table.py"""
    structs = {"RENDERER": tables.structs["kuafu_renderer_desc"], "RENDER": tables.structs["kuafu_render_desc"]}
    optics = {"OPTICS": tables.structs["kuafu_optics_desc"]}
    return _option_table("The renderer's options", structs, "RenderFields", optics)
