"""Python: the bindings' lists of fields, the stubs, and the matcher's parameters for sensor and command line."""

from __future__ import annotations

import math

from emit_cpp import banner
from table import Field, Struct, Tables
from words import GENERATED, default_text, facts, range_text


def simsense_fields_h(tables: Tables) -> str:
    """python/simsense/fields.h: fields and choices by name."""
    both = {"parameter": tables.structs["simsense_parameters"], "signal": tables.structs["simsense_signal"]}
    text = [*banner(*both.values(), note="simsense_parameters and simsense_signal by field name."), "#pragma once", "",
            "#include <variant>", "#include <vector>", "", '#include "simsense_api.h"', "", "namespace ks_python {", "",
            "template <class Struct>", "struct Field {", "  const char* name;",
            "  std::variant<float Struct::*, uint32_t Struct::*, int32_t Struct::*, uint64_t Struct::*> member;",
            "  std::vector<const char*> choices;  // names of 0, 1, ...; empty: a number", "};"]  # fmt: skip
    for name, s in both.items():
        text += ["", f"inline const Field<{s.name}> {name}_fields[] = {{"]
        for f in s.fields:
            if f.python:
                choices = ", ".join(f'"{v}"' for v in f.values)
                text.append(f'    {{"{f.name}", &{s.name}::{f.name}, {{{choices}}}}},')
        text.append("};")
    return "\n".join([*text, "", "}  // namespace ks_python", ""])


def literal(field: Field) -> str:
    """The default as Python has it."""
    value = field.default
    if field.type == "flag":
        return str(bool(value))
    if isinstance(value, float) and not math.isfinite(value):
        return "None" if math.isnan(value) else f'float("{value}")'
    if field.type in ("float", "double"):
        return repr(float(value))
    return repr(value)


def scalar_type(field: Field) -> str:
    """The annotation of one number of the field."""
    if field.values:
        return "Literal[" + ", ".join(f'"{v}"' for v in field.values) + "]"
    kind = {"float": "float", "double": "float", "flag": "bool", "text": "str"}.get(field.type, "int")
    return f"{kind} | None" if field.nan or field.none else kind


def matcher_table(tables: Tables) -> str:
    """python/activestereo/matcher_table.py"""
    struct = tables.structs["simsense_parameters"]
    text = ["# " + GENERATED.format(struct.source), '"""The stereo engine\'s parameters: what a sensor\'s configuration and the command line have of them."""', "",
            "from activestereo.parameter import Parameter", "", "MATCHER = ("]  # fmt: skip
    for f in struct.fields:
        if not f.config:
            continue
        kind = {"float": "float", "flag": "bool", "choice": "str"}.get(f.type, "int")
        more = [f'unit="{f.unit}"'] if f.unit else []
        more += [f'possible="{range_text(f)}"'] if range_text(f) else []
        more += [f"choices={tuple(f.values)!r}"] if f.values else []
        more += [f'pair="{f.pair}"'] if f.pair else []
        doc = f.doc.replace('"', "'")
        text += ["    Parameter(", f'        "{f.name}",', f"        {kind},", f"        {literal(f)},",
                 *(f"        {m}," for m in more), f'        doc="{doc}",  # noqa: E501' if len(doc) > 104 else f'        doc="{doc}",', "    ),"]  # fmt: skip
    text += [")", "", "", "class MatcherFields:", '    """Their types. A class that has them as attributes inherits this."""', ""]
    text += [f"    {f.name}: {'str' if f.values else scalar_type(f)}" for f in struct.fields if f.config]
    return "\n".join([*text, ""])


def _annotation(field: Field) -> str:
    """The type of a whole field as an attribute."""
    one = scalar_type(field)
    if field.shape:
        return "NDArray[np.float64]"
    if field.count == 1:
        return one
    return f"tuple[{', '.join([one] * int(field.count))}]"


def _stub_fields(struct: Struct) -> list[str]:
    out = []
    for f in struct.fields:
        if not f.python or f.type == "text":
            continue
        if f.lengths:  # given shorter than it is read
            out += ["@property", f"def {f.name}(self) -> {_annotation(f)}: ...", f"@{f.name}.setter",
                    f"def {f.name}(self, values: Sequence[float]) -> None: ..."]  # fmt: skip
            continue
        out += [f"{f.name}: {_annotation(f)}", f'"""{_prose(f)}"""']
    return out


def _prose(field: Field) -> str:
    """What a field is, in Python's words."""
    text = " ".join(filter(None, [field.doc, f"[{facts(field)}]" if facts(field) else ""]))
    for c, python in (("KUAFU_NONE", "None"), ("KUAFU_ALL_ENVIRONMENTS", "None"), ("NAN", "None"), ("INFINITY", "inf")):
        text = text.replace(c, python)
    return text.replace('"', "'")


def _stub_arguments(structs: list[Struct]) -> list[str]:
    """Every field as a keyword argument."""
    out = []
    for f in (f for s in structs for f in s.fields if f.python):
        out.append(f"{f.name}: {scalar_type(f)} | int = ...," if f.values else f"{f.name}: {scalar_type(f)} = ...,")
    return out


def stub(tables: Tables, library: str, template: str, shared: str) -> str:
    """python/<library>/_<library>.pyi, from its template, what both libraries share, and the tables."""
    named = {s.python: s for s in tables.of(library) if s.python}
    lists = {f"{name}.fields": _stub_fields(s) for name, s in named.items()} | {f"{name}.doc": [s.doc] for name, s in named.items()}
    engine = [s for s in tables.of(library) if s.name in ("simsense_parameters", "simsense_signal")]
    lists |= {"parameters": _stub_arguments(engine), "shared": shared.rstrip().split("\n")}
    out = ["# " + GENERATED.format("*.toml").replace("from", f"from python/{library}/_{library}.pyi.in, python/bindings/shared.pyi.in and")]
    for line in template.split("\n"):
        for key, value in lists.items():
            if "{" + key + "}" in line:
                indent = line[: len(line) - len(line.lstrip())]
                line = line.replace("{" + key + "}", ("\n" + indent).join(value))
        out.append(line)
    return "\n".join(text.rstrip() for text in "\n".join(out).split("\n"))


def page_default(field: Field) -> str:
    """The default for the reference page."""
    if field.type == "flag":
        return "yes" if field.default else "no"
    if field.type in ("text",) or field.is_pointer:
        return "NULL"
    return default_text(field) or ("NAN" if isinstance(field.default, float) and math.isnan(field.default) else "0")
