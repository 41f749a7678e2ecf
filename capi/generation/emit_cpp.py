# SPDX-License-Identifier: Apache-2.0
"""Writes C++ of the engines: checks of the fields, and copies of the fields that the stages read."""

from __future__ import annotations

import math
import re

from table import Field, Struct, Tables
from words import GENERATED, c_literal

OFF = "// clang-format off"


def banner(*structs: Struct, note: str = "") -> list[str]:
    """Returns the first lines of a generated C++ file."""
    return ["// " + GENERATED.format(", ".join(s.source for s in structs)), *([f"// {note}"] if note else []), OFF]


def cpp_file(head: list[str], includes: list[str], body: list[str], namespace: str = "kuafu") -> str:
    """Returns a C++ file. head: its banner. includes: names, with "" between blocks and "once" for a header. body:
    lines in the namespace."""
    lines = ["#pragma once" if name == "once" else f"#include {name}" if name else "" for name in includes]
    return "\n".join([*head, *lines, "", f"namespace {namespace} {{", *body, "", f"}}  // namespace {namespace}", ""])


def check_functions(structs: list[Struct], copied: bool = False) -> list[str]:
    """Returns definitions of check_fields, each after an empty line. copied: they check the records, not the public
    structs."""
    out = []
    for s in structs:
        name = (s.record or s.scene) if copied else s.name
        lines = [f"  {line}" for line in checks(s, copied)]
        out += ["", f"void check_fields(const {name}& s, const std::string& owner) {{", *lines, "}"]
    return out


def _bound(field: Field, value: float) -> str:
    """Returns a bound in the field's own precision: 0.1 as a float is not 0.1 as a double."""
    return c_literal("float" if field.type == "float" else "double", value)


def _check(field: Field, value: str) -> list[str]:
    """Returns C++ statements that check one value of the field. value: an expression."""
    name = f'{{owner, "{field.name}", "{field.unit}"}}'
    real = field.type in ("float", "double")
    out = []
    if field.type == "choice":
        names = ", ".join(f'"{v}"' for v in field.values)
        out.append(
            f"ks::check_choice({name}, {value}, {field.first}, std::array<const char*, "
            f"{len(field.values)}>{{{names}}});"
        )
    elif field.allowed:
        allowed = sorted({*field.allowed, *([0] if field.zero_means is not None else [])})
        out.append(
            f"ks::check_allowed({name}, {value}, std::array<uint32_t, "
            f"{len(allowed)}>{{{', '.join(f'{v}u' for v in allowed)}}});"
        )
    elif field.above is not None:
        out.append(f"ks::check_above({name}, {value}, {_bound(field, field.above)});")
    elif field.range is not None:
        low, high = field.range
        if field.range[0] > 0 and field.zero_means is not None:
            out.append(
                f"if ({value} != 0) ks::check_range({name}, {value}, {_bound(field, low)}, {_bound(field, high)});"
            )
        elif real or low != 0 or not math.isinf(high):
            out.append(f"ks::check_range({name}, {value}, {_bound(field, low)}, {_bound(field, high)});")
    if field.nan and real:
        out = [f"if (!std::isnan({value})) {line}" for line in out]
    return out


def checks(struct: Struct, copied: bool = False) -> list[str]:
    """Returns C++ statements that check every field that the table bounds. copied: they check the record, where fields
    may have other places and choices are enums."""
    out: list[str] = []
    for f in struct.fields:
        if not f.check or (copied and not f.copy):
            continue
        value = f"s.{f.member}" if copied else f"s.{f.name}"
        if f.type == "ks_lens":
            out.append(f'ks::check_lens(owner + "{f.name}.", {value}.model, {value}.k);')
        elif f.count == 1:
            out += _check(f, f"uint32_t({value})" if copied and f.values else value)
        else:
            out += [f"for (int i = 0; i < {f.count}; ++i) {line}" for line in _check(f, f"{value}[i]")]
    return out


def simsense_fields_h(tables: Tables) -> str:
    """Returns simsense/src/parameters/fields.h: declares the fields' checks, the copy for the matcher and whether an
    imager has noise."""
    both = [tables.structs["simsense_parameters"], tables.structs["simsense_signal"]]
    note = "Checks of every field by itself; what two fields mean together is checked where it matters."
    body = [
        "",
        "/// Throws KS_ERROR_INVALID_ARGUMENT with the name, the value and the range of the first field that "
        "cannot be.",
        *(f"void check_fields(const {s.name}& s, const std::string& owner);" for s in both),
        "/// The matcher's part, which keeps its names.",
        "MatchFields match_fields(const simsense_parameters& s);",
        "/// Whether any noise term of the imager is above 0.",
        "bool has_noise(const simsense_signal& s);",
    ]
    includes = ["once", "", "<string>", "", '"parameters/match_fields.h"', '"simsense/simsense.h"']
    return cpp_file(banner(*both, note=note), includes, body, "simsense")


# The first id of the specialisation constants that all shaders of the matcher share. Single shaders use lower ids.
FIRST_MATCH_CONSTANT = 64


def simsense_match_fields_h(tables: Tables) -> str:
    """Returns simsense/src/parameters/match_fields.h: the matcher's parameters, and its shaders' specialisation
    constants."""
    struct = tables.structs["simsense_parameters"]
    fields = [f for f in struct.fields if f.match]
    constants = [f for f in fields if f.kernel]
    body = [
        "", "struct MatchFields {",
        *(f"  {f.c_type} {f.name} = {c_literal(f.type, f.default)};" for f in fields),
        "  bool operator==(const MatchFields&) const = default;", "};", "",
        "/// The specialisation constants of shared/match_constants.glsl, from the first id on.",
        f"inline constexpr uint32_t first_match_constant = {FIRST_MATCH_CONSTANT};",
        f"inline std::array<uint32_t, {len(constants)}> match_constants(const MatchFields& m) {{",
        "  return {" + ", ".join(_word(f) for f in constants) + "};", "}",
    ]  # fmt: skip
    head = banner(struct, note="Parameters that reach the matcher as they are.")
    return cpp_file(head, ["once", "", "<array>", "<cstdint>"], body, "simsense")


def _word(field: Field) -> str:
    """Returns C++ that gives a field of `m` as the 32 bits of a specialisation constant."""
    return f"m.{field.name}" if field.type == "uint32" else f"static_cast<uint32_t>(m.{field.name})"


def simsense_match_constants_glsl(tables: Tables) -> str:
    """Returns simsense/shaders/shared/match_constants.glsl: the parameters that the matcher's shaders have as
    constants."""
    struct = tables.structs["simsense_parameters"]
    words = {"uint32": ("uint", "u"), "int32": ("int", "")}
    text = [banner(struct, note="Parameters of the matcher that its shaders have as constants.")[i] for i in (0, 1)]
    text += ["#ifndef SIMSENSE_MATCH_CONSTANTS_GLSL", "#define SIMSENSE_MATCH_CONSTANTS_GLSL"]
    for i, f in enumerate(f for f in struct.fields if f.kernel):
        kind, suffix = words[f.type]
        unit = f"  // {f.unit}" if f.unit else ""
        text.append(
            f"layout(constant_id = {FIRST_MATCH_CONSTANT + i}) const {kind} {f.name} = {f.default}{suffix};{unit}"
        )
    return "\n".join([*text, "#endif", ""])


def reasons(tables: Tables) -> dict[str, int]:
    """Returns the reasons of a missing depth: {name: number}, by number."""
    texts = "".join(header.text for header in tables.headers)
    found = re.findall(r"#define SIMSENSE_REASON_(\w+) (\d+)u", texts)
    return dict(sorted(((name.lower(), int(number)) for name, number in found), key=lambda reason: reason[1]))


def simsense_choices_h(tables: Tables) -> str:
    """Returns simsense/shaders/shared/public_choices.h: the matcher's choices and the reasons of a missing depth, by
    number, for GLSL and C++. MATCH_REASONS lists the reasons for an enum."""
    struct = tables.structs["simsense_parameters"]
    numbers = [entry for f in struct.fields for entry in f.constants.items()]
    lines = [f"#define {name.removeprefix('SIMSENSE_')} {number}u" for name, number in numbers]
    known = reasons(tables)
    lines += [f"#define REASON_{name.upper()} {number}u" for name, number in known.items()]
    lines += [f"#define MATCH_REASONS {', '.join(f'{name} = {number}' for name, number in known.items())}"]
    guard = "SIMSENSE_PUBLIC_CHOICES_H"
    return "\n".join([banner(struct)[0], f"#ifndef {guard}", f"#define {guard}", *lines, "#endif", ""])


def simsense_fields_cpp(tables: Tables) -> str:
    """Returns simsense/src/parameters/fields.cpp: what fields.h declares."""
    both = [tables.structs["simsense_parameters"], tables.structs["simsense_signal"]]
    body = [*check_functions(both), "", "MatchFields match_fields(const simsense_parameters& s) {", "  MatchFields m;"]
    body += [f"  m.{f.name} = s.{f.name};" for f in both[0].fields if f.match]
    includes = ['"parameters/fields.h"', "", "<array>", "<cmath>", "", '"device/field_check.h"']
    noise = " || ".join(f"s.{f.name} > 0" for f in both[1].fields if f.noise)
    body += ["  return m;", "}", "", f"bool has_noise(const simsense_signal& s) {{ return {noise}; }}"]
    return cpp_file(banner(*both), includes, body, "simsense")
