# SPDX-License-Identifier: Apache-2.0
"""kuafu's scene: its records, their checks, their copies from and to the public structs, and a glTF material's
extras."""

from __future__ import annotations

from collections.abc import Callable

from emit_cpp import banner, checks
from table import Field, Struct, Tables
from words import c_literal

VECTORS = {
    ("float", 2): "glm::vec2",
    ("float", 3): "glm::vec3",
    ("float", 4): "glm::vec4",
    ("double", 2): "glm::dvec2",
    ("double", 3): "glm::dvec3",
}
# Ids count from 1 and 0 is none; in the records they are indices, and none is 0xffffffff.
MATRICES = {(3, 3): "glm::dmat3", (4, 4): "glm::dmat4"}


def _records(tables: Tables) -> list[Struct]:
    """Structs whose record is made here."""
    return [s for s in tables.of("kuafu") if s.scene]


def _copied(tables: Tables) -> list[Struct]:
    """Structs that are copied to a record, this one's or one written by hand."""
    return [s for s in tables.of("kuafu") if s.scene or s.record]


def _checked(tables: Tables) -> list[Struct]:
    """Structs whose record has fields to check."""
    return [s for s in _copied(tables) if checks(s, copied=True)]


def _record_of(struct: Struct) -> str:
    return struct.record or struct.scene


def _enum(field: Field) -> str:
    return field.name.title().replace("_", "")


def _record_type(field: Field) -> str:
    simple = {"text": "std::string", "flag": "bool", "choice": _enum(field), "id": "uint32_t", "index": "uint32_t",
              "ks_lens": "Distortion"}  # fmt: skip
    if field.type in simple:
        return simple[field.type]
    if field.shape:
        return MATRICES[field.shape]
    return VECTORS.get((field.type, int(field.count)), field.c_type)


def _record_default(field: Field) -> str:
    if field.type == "text":
        return ""
    if field.type == "flag":
        return " = true" if field.default else " = false"
    if field.type == "choice":
        return f" = {_enum(field)}::{field.default}"
    if field.type in ("id", "index"):
        return " = 0xffffffffu"
    if field.type == "ks_lens":
        return ""
    if field.shape:
        return "{1.0}"
    if field.count != 1:
        values = field.default if isinstance(field.default, list) else [field.default] * int(field.count)
        return "{" + ", ".join(c_literal(field.type, v) for v in values) + "}"
    return f" = {c_literal(field.type, field.default)}"


def _member(field: Field) -> list[str]:
    out = [f"  /// {line}" for line in ([field.doc] if field.doc else [])]
    if field.values:
        numbers = ", ".join(f"{name} = {field.first + i}" for i, name in enumerate(field.values))
        out.append(f"  enum class {_enum(field)} : uint32_t {{ {numbers} }};")
    suffix = f"[{field.count}]" if int(field.count) > 4 and not field.shape else ""
    default = "{}" if suffix else _record_default(field)
    return [*out, f"  {_record_type(field)} {field.name}{suffix}{default};"]


def fields_h(tables: Tables) -> str:
    """kuafu/src/scene/fields.h"""
    records = _records(tables)
    text = [*banner(*records, note="The scene's records: what the public structs say, in the renderer's "
                                   "types."), "#pragma once", "",
            "#include <cmath>", "#include <cstdint>", "#include <glm/glm.hpp>", "#include <string>", "",
            '#include "scene/distortion.h"', "", "namespace kuafu {", ""]  # fmt: skip
    for s in records:
        text.append(f"struct {s.scene} {{")
        for f in s.fields:
            if f.copy and f.member == f.name:
                text += _member(f)
        text += ["};", ""]
    text.append(
        "// Each field by itself: throws KS_ERROR_INVALID_ARGUMENT with the owner, the field, the value and what "
        "it must be."
    )
    text += [f"struct {s.record};" for s in _checked(tables) if s.record]
    text += [f"void check_fields(const {_record_of(s)}& s, const std::string& owner);" for s in _checked(tables)]
    ids = [f.name for f in tables.structs["kuafu_material_desc"].fields if f.type == "id"]
    text += ["", "/// Pointers to the fields of a material that name textures.", "template <class "
                                                                                 "M>", "auto texture_ids(M& m) {",
             f"  return std::array{{{', '.join('&m.' + name for name in ids)}}};", "}"]  # fmt: skip
    text[text.index("#include <cmath>")] = "#include <array>\n#include <cmath>"
    names = ", ".join(f"m.{f.name}" for f in tables.structs["kuafu_material_desc"].fields if f.copy)
    text += ["", "/// visit(field) for every field of a material, in the table's order.", "template <class M, "
                                                                                          "class Visit>",
             "void for_each_field(M& m, Visit&& visit) {",
             "  const auto all = [&](auto&... fields) { (visit(fields), ...); };", f"  all({names});", "}"]  # fmt: skip
    return "\n".join([*text, "", "}  // namespace kuafu", ""])


def fields_cpp(tables: Tables) -> str:
    """kuafu/src/scene/fields.cpp"""
    records = _checked(tables)
    text = [
        *banner(*records),
        '#include "scene/fields.h"',
        "",
        '#include "device/field_check.h"',
        '#include "scene/scene.h"',
        "",
        "namespace kuafu {",
    ]
    for s in records:
        lines = checks(s, copied=True)
        text += [
            "",
            f"void check_fields(const {_record_of(s)}& s, const std::string& owner) {{",
            *(f"  {line}" for line in lines),
            "}",
        ]
    return "\n".join([*text, "", "}  // namespace kuafu", ""])


def _to_record(field: Field) -> str:
    name, member = field.name, field.member
    if field.type == "text":
        return f'out.{member} = s.{name} == nullptr ? "" : s.{name};'
    if field.type == "flag":
        return f"out.{member} = s.{name} != 0;"
    if field.type == "choice":
        return f"out.{member} = static_cast<decltype(out.{member})>(s.{name});"
    if field.shape:
        return f"out.{member} = from_row_major<{field.shape[0]}>(s.{name});"
    if field.type == "id":
        return f"out.{member} = s.{name} - 1u;"
    if field.type == "ks_lens":
        return f"out.{member} = to_distortion(s.{name});"
    if field.count != 1:
        return f"for (int i = 0; i < {field.count}; ++i) out.{member}[i] = s.{name}[i];"
    return f"out.{member} = s.{name};"


def _to_desc(field: Field) -> str:
    name, member = field.name, field.member
    if field.type == "text":
        return f"out.{name} = s.{member}.c_str();"
    if field.type == "flag":
        return f"out.{name} = s.{member} ? 1 : 0;"
    if field.type == "choice":
        return f"out.{name} = static_cast<uint32_t>(s.{member});"
    if field.shape:
        return f"to_row_major<{field.shape[0]}>(s.{member}, out.{name});"
    if field.type == "id":
        return f"out.{name} = s.{member} + 1u;"
    if field.type == "ks_lens":
        return f"out.{name} = to_lens(s.{member});"
    if field.count != 1:
        return f"for (int i = 0; i < {field.count}; ++i) out.{name}[i] = s.{member}[i];"
    return f"out.{name} = s.{member};"


def _ways(struct: Struct) -> list[tuple[str, str, Callable[[Field], str]]]:
    """(from, to, line of a field) of the copies."""
    to_record = (struct.name, _record_of(struct), _to_record)
    return [to_record, (_record_of(struct), struct.name, _to_desc)] if struct.read_back else [to_record]


def copies_h(tables: Tables) -> str:
    """kuafu/src/api/fields.h"""
    copied, checked = _copied(tables), [s for s in tables.of("kuafu") if s.checked]
    text = [*banner(*copied, *checked, note="Copies between the public structs and the scene's records. Text "
                                            "that a struct points to is the record's."),
            "#pragma once", "", '#include "kuafu/kuafu.h"', '#include "scene/scene.h"', "", "namespace kuafu {",
            ""]  # fmt: skip
    text += [f"void copy_fields(const {source}& s, {target}& out);" for s in copied for source, target, _ in _ways(s)]
    text += [
        "",
        "// Each field by itself: throws KS_ERROR_INVALID_ARGUMENT with the owner, the field, the value and what "
        "it must be.",
    ]
    text += [f"void check_fields(const {s.name}& s, const std::string& owner);" for s in checked]
    return "\n".join([*text, "", "}  // namespace kuafu", ""])


def copies_cpp(tables: Tables) -> str:
    """kuafu/src/api/fields.cpp"""
    copied, checked = _copied(tables), [s for s in tables.of("kuafu") if s.checked]
    text = [
        *banner(*copied, *checked),
        '#include "api/fields.h"',
        "",
        '#include "api/lens.h"',
        '#include "device/field_check.h"',
        '#include "scene/matrix.h"',
        "",
        "namespace kuafu {",
    ]
    for s in copied:
        for source, target, line in _ways(s):
            text += [
                "",
                f"void copy_fields(const {source}& s, {target}& out) {{",
                *(f"  {line(f)}" for f in s.fields if f.copy and not f.reserved),
                "}",
            ]
    for s in checked:
        text += [
            "",
            f"void check_fields(const {s.name}& s, const std::string& owner) {{",
            *(f"  {line}" for line in checks(s)),
            "}",
        ]
    return "\n".join([*text, "", "}  // namespace kuafu", ""])


def extras_h(tables: Tables) -> str:
    """kuafu/import/material_extras.h"""
    struct = tables.structs["kuafu_material_desc"]
    fields = [f for f in struct.fields if f.extras]
    kinds = {
        "numbers": [f for f in fields if f.type == "float" and f.count == 1],
        "vectors": [f for f in fields if f.type == "float" and f.count == 3],
        "flags": [f for f in fields if f.type == "flag"],
        "textures": [f for f in fields if f.type == "id"],
    }
    text = [*banner(struct, note="Fields that a glTF material's extras may have, under their names."),
            "#pragma once", "", "#include <array>", "#include <utility>", "", '#include "scene/fields.h"', "",
            "namespace kuafu {"]  # fmt: skip
    for kind, members in kinds.items():
        pairs = ", ".join(f'std::pair{{"{f.name}", &m.{f.name}}}' for f in members)
        text += ["", f"inline auto extras_{kind}(MaterialFields& m) {{", f"  return std::array{{{pairs}}};", "}"]
    return "\n".join([*text, "", "}  // namespace kuafu", ""])


def extras_schema(tables: Tables) -> str:
    """kuafu/import/material_extras.inc: rows of gltf_schema.cpp's table"""
    struct = tables.structs["kuafu_material_desc"]
    text = banner(struct, note="What a glTF material's extras must be, for the table of gltf_schema.cpp.")
    for f in struct.fields:
        if not f.extras:
            continue
        at = f'{{"/materials", "/extras/{f.name}", Kind::'
        if f.type == "id":
            text += [at + "object},", f'{{"/materials", "/extras/{f.name}/index", Kind::index}},']
        else:
            text.append(at + ("number}," if f.count == 1 else f"numbers, {f.count}}},"))
    return "\n".join([*text, ""])


def python_fields_h(tables: Tables) -> str:
    """python/kuafu/fields.h"""
    records = [s for s in tables.of("kuafu") if s.python]
    text = [*banner(*records, note="The fields of the records as properties, under their C names."), "#pragma once", "",
            '#include "properties.h"', "", "namespace ks_python {"]  # fmt: skip
    for s in records:
        text += ["", f"inline void bind_fields(py::class_<{s.python}>& type) {{", f"  using S = {s.name};"]
        for f in s.fields:
            if f.python and f.type != "text":
                text.append(f"  {_property(s, f)}")
        text.append("}")
    return "\n".join([*text, "", "}  // namespace ks_python", ""])


def _property(struct: Struct, f: Field) -> str:
    doc = f.doc.replace("NAN", "None").replace('"', "'")
    if f.unit:
        doc += f" In {f.unit}."
    if f.nan:
        doc += f" None = {f.nan.replace('NAN', 'None')}."
    member = f'type, "{f.name}", &S::{f.name}'
    if f.type == "ks_lens":
        return f'lens(type, &S::{f.name}, "{doc}");'
    if f.values:
        names = ", ".join(f'"{v}"' for v in f.values)
        return f'named({member}, std::array<std::string_view, {len(f.values)}>{{{names}}}, {f.first}, "{doc}");'
    kind = (
        "maybe"
        if f.nan or f.none
        else "id"
        if f.type == "id"
        else "flag"
        if f.type == "flag"
        else "square"
        if f.shape
        else "vector"
        if f.count != 1
        else "scalar"
    )
    return f'{kind}({member}, "{doc}");'


