# SPDX-License-Identifier: Apache-2.0
"""Writes kuafu's records that shaders read: one text for GLSL and C++, and the copy of the fields that need no
computation."""

from __future__ import annotations

from emit_cpp import banner
from table import Field, Struct, TableError, Tables

WORDS = {"float": 1, "uint": 1, "vec2": 2, "vec3": 3, "vec4": 4, "LensRecord": 9}
# Type in a table: type in GLSL, and in C++ beside glm. Shaders have no doubles.
TYPES = {
    "float": "float", "double": "float", "uint32": "uint", "flag": "uint", "choice": "uint", "id": "uint",
    "index": "uint", "ks_lens": "LensRecord",
}  # fmt: skip


def records(tables: Tables) -> dict[str, str]:
    """Returns {path: text} of each record."""
    structs = [s for s in tables.of("kuafu") if s.shader]
    return {f"kuafu/shaders/shared/{_stem(s)}_fields.h": _record(s) for s in structs}


def _stem(struct: Struct) -> str:
    return struct.name.removeprefix("kuafu_").removesuffix("_desc")


def _type(field: Field) -> str:
    """Returns a field's type in GLSL: vec3, or float[8]. Raises TableError where shaders have none."""
    kind, count = TYPES.get(field.type, ""), int(field.count)
    if not kind or field.shape or (count != 1 and kind != "float"):
        raise TableError(f"{field.name}: shaders have no {field.type} of {field.count}: compute it, as [derived]")
    return kind if count == 1 else f"vec{count}" if count <= 4 else f"{kind}[{count}]"


def _split(full: str) -> tuple[str, int]:
    """Returns name and length of a type: ("float", 8) for float[8]. Raises TableError for an unknown type."""
    kind, _, rest = full.partition("[")
    if kind not in WORDS:
        raise TableError(f"[derived]: '{full}' is none of {' '.join(WORDS)}, or several of them, as in float[8]")
    return kind, int(rest.rstrip("]") or 1)


def _member(name: str, full: str, doc: str) -> str:
    kind, count = _split(full)
    array = f"[{count}]" if count > 1 else ""
    return f"  {kind} {name}{array};" + (f"  // {doc}" if doc else "")


def _copy(field: Field) -> str:
    kind, count = _split(_type(field))
    if count > 1:
        return f"  for (int i = 0; i < {count}; ++i) out.{field.name}[i] = float(s.{field.member}[i]);"
    if kind == "LensRecord":
        return f"  out.{field.name} = lens_record(s.{field.member});"
    return f"  out.{field.name} = {'uint32_t' if kind == 'uint' else kind}(s.{field.member});"


def _record(struct: Struct) -> str:
    fields = [f for f in struct.fields if f.shader]
    members = [(f.name, _type(f), "") for f in fields] + [(name, *entry) for name, entry in struct.derived.items()]
    words = sum(WORDS[kind] * count for kind, count in (_split(full) for _, full, _ in members))
    if words % 2:  # other records, which hold addresses, may contain this one
        members.append(("reserved", "uint", "A multiple of 8 bytes."))
    guard = f"KUAFU_{_stem(struct).upper()}_FIELDS_H"
    text = [*banner(struct, note="Read by GLSL and C++ (scalar layout). What a field means says the public header; "
                                 "values are those of the band being rendered."),
            f"#ifndef {guard}", f"#define {guard}", "", '#include "shared/arrays.h"',
            *(['#include "shared/lens_record.h"'] if any("LensRecord" in full for _, full, _ in members) else []),
            '#include "shared/ray_queue.h"',
            "", "#ifdef __cplusplus",
            "namespace kuafu {", "#endif", "", f"struct {struct.shader} {{"]  # fmt: skip
    text += [_member(*member) for member in members]
    text += ["};", f"KUAFU_ARRAY({struct.shader.removesuffix('Record')}Array, {struct.shader}, 4)", ""]
    for i, (name, doc) in enumerate(struct.steps.items()):
        text.append(f"KUAFU_CONST {_stem(struct)}_{name} = {i}u;  // {doc}")
    text += ["", "#ifdef __cplusplus", f"static_assert(sizeof({struct.shader}) == {4 * (words + words % 2)});", "",
             "/// The fields that shaders read as they are; the others are computed.", "template <class Fields>",
             f"void copy_fields(const Fields& s, {struct.shader}& out) {{"]  # fmt: skip
    text += [_copy(f) for f in fields]
    return "\n".join([*text, "}", "", "}  // namespace kuafu", "#endif", "#endif", ""])
