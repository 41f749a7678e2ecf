# SPDX-License-Identifier: Apache-2.0
"""Writes C++ of kuafu's scene: its records, their checks, their copies from and to the public structs, and a glTF
material's extras."""

from __future__ import annotations

from collections.abc import Callable

from emit_cpp import banner, check_functions, checks, cpp_file
from table import Field, Struct, Tables
from words import c_literal

VECTORS = {
    ("float", 2): "glm::vec2",
    ("float", 3): "glm::vec3",
    ("float", 4): "glm::vec4",
    ("double", 2): "glm::dvec2",
    ("double", 3): "glm::dvec3",
}
MATRICES = {(3, 3): "glm::dmat3", (4, 4): "glm::dmat4"}
THROWS = "throws KS_ERROR_INVALID_ARGUMENT with the owner, the field, the value and what it must be."
CHECKS = f"// Each field by itself: {THROWS}"


def _records(tables: Tables) -> list[Struct]:
    """Returns the structs whose record is generated here."""
    return [s for s in tables.of("kuafu") if s.scene]


def _copied(tables: Tables) -> list[Struct]:
    """Returns the structs that are copied to a record, generated or written by hand."""
    return [s for s in tables.of("kuafu") if s.scene or s.record]


def _checked(tables: Tables) -> list[Struct]:
    """Returns the structs whose record has fields to check."""
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
    """Returns the initialiser of a field in the record, in C++. Ids count from 1 and 0 is none; in the records they are
    indices, and none is 0xffffffff."""
    if field.type in ("text", "ks_lens"):
        return ""
    if field.shape:
        return "{1.0}"
    if field.count != 1:
        values = field.default if isinstance(field.default, list) else [field.default] * int(field.count)
        return "{" + ", ".join(c_literal(field.type, v) for v in values) + "}"
    special = {"flag": "true" if field.default else "false", "choice": f"{_enum(field)}::{field.default}",
               "id": "0xffffffffu", "index": "0xffffffffu"}  # fmt: skip
    return f" = {special.get(field.type) or c_literal(field.type, field.default)}"


def _member(field: Field) -> list[str]:
    out = [f"  /// {line}" for line in ([field.doc] if field.doc else [])]
    if field.values:
        numbers = ", ".join(f"{name} = {field.first + i}" for i, name in enumerate(field.values))
        out.append(f"  enum class {_enum(field)} : uint32_t {{ {numbers} }};")
    suffix = f"[{field.count}]" if int(field.count) > 4 and not field.shape else ""
    default = "{}" if suffix else _record_default(field)
    return [*out, f"  {_record_type(field)} {field.name}{suffix}{default};"]


def fields_h(tables: Tables) -> str:
    """Returns kuafu/src/scene/fields.h: the scene's records, and declarations of their checks."""
    records, material = _records(tables), tables.structs["kuafu_material_desc"]
    text = [""]
    for s in records:
        members = [line for f in s.fields if f.copy and f.member == f.name for line in _member(f)]
        text += [f"struct {s.scene} {{", *members, "};", ""]
    text += [CHECKS, *(f"struct {s.record};" for s in _checked(tables) if s.record)]
    text += [f"void check_fields(const {_record_of(s)}& s, const std::string& owner);" for s in _checked(tables)]
    ids = ", ".join(f"&m.{f.name}" for f in material.fields if f.type == "id")
    names = ", ".join(f"m.{f.name}" for f in material.fields if f.copy)
    text += ["", "/// Pointers to the fields of a material that name textures.", "template <class M>",
             "auto texture_ids(M& m) {", f"  return std::array{{{ids}}};", "}",
             "", "/// visit(field) for every field of a material, in the table's order.",
             "template <class M, class Visit>", "void for_each_field(M& m, Visit&& visit) {",
             "  const auto all = [&](auto&... fields) { (visit(fields), ...); };", f"  all({names});", "}"]  # fmt: skip
    head = banner(*records, note="The scene's records: what the public structs say, in the renderer's types.")
    includes = ["once", "", "<array>", "<cmath>", "<cstdint>", "<glm/glm.hpp>", "<string>", "", '"scene/distortion.h"']
    return cpp_file(head, includes, text)


def fields_cpp(tables: Tables) -> str:
    """Returns kuafu/src/scene/fields.cpp: the checks of the scene's records."""
    includes = ['"scene/fields.h"', "", '"device/field_check.h"', '"scene/scene.h"']
    return cpp_file(banner(*_checked(tables)), includes, check_functions(_checked(tables), copied=True))


def _to_record(field: Field) -> str:
    name, out = f"s.{field.name}", f"out.{field.member}"
    if field.shape:
        return f"{out} = from_row_major<{field.shape[0]}>({name});"
    if field.count != 1:
        return f"for (int i = 0; i < {field.count}; ++i) {out}[i] = {name}[i];"
    values = {"text": f'{name} == nullptr ? "" : {name}', "flag": f"{name} != 0",
              "choice": f"static_cast<decltype({out})>({name})", "id": f"{name} - 1u",
              "ks_lens": f"to_distortion({name})"}  # fmt: skip
    return f"{out} = {values.get(field.type, name)};"


def _to_desc(field: Field) -> str:
    member, out = f"s.{field.member}", f"out.{field.name}"
    if field.shape:
        return f"to_row_major<{field.shape[0]}>({member}, {out});"
    if field.count != 1:
        return f"for (int i = 0; i < {field.count}; ++i) {out}[i] = {member}[i];"
    values = {"text": f"{member}.c_str()", "flag": f"{member} ? 1 : 0", "choice": f"static_cast<uint32_t>({member})",
              "id": f"{member} + 1u", "ks_lens": f"to_lens({member})"}  # fmt: skip
    return f"{out} = {values.get(field.type, member)};"


def _ways(struct: Struct) -> list[tuple[str, str, Callable[[Field], str]]]:
    """Returns (source type, target type, function that copies a field) for each direction in which the struct is
    copied."""
    to_record = (struct.name, _record_of(struct), _to_record)
    return [to_record, (_record_of(struct), struct.name, _to_desc)] if struct.read_back else [to_record]


def copies_h(tables: Tables) -> str:
    """Returns kuafu/src/api/fields.h: declarations of the copies between the public structs and the scene's records."""
    copied, checked = _copied(tables), [s for s in tables.of("kuafu") if s.checked]
    note = "Copies between the public structs and the scene's records. Text that a struct points to is the record's."
    text = [f"void copy_fields(const {source}& s, {target}& out);" for s in copied for source, target, _ in _ways(s)]
    text += ["", CHECKS, *(f"void check_fields(const {s.name}& s, const std::string& owner);" for s in checked)]
    includes = ["once", "", '"kuafu/kuafu.h"', '"scene/scene.h"']
    return cpp_file(banner(*copied, *checked, note=note), includes, ["", *text])


def copies_cpp(tables: Tables) -> str:
    """Returns kuafu/src/api/fields.cpp: the copies between the public structs and the scene's records."""
    copied, checked = _copied(tables), [s for s in tables.of("kuafu") if s.checked]
    text = []
    for s in copied:
        for source, target, line in _ways(s):
            lines = [f"  {line(f)}" for f in s.fields if f.copy and not f.reserved]
            text += ["", f"void copy_fields(const {source}& s, {target}& out) {{", *lines, "}"]
    includes = ['"api/descriptors.h"', "", '"device/field_check.h"']
    return cpp_file(banner(*copied, *checked), includes, text + check_functions(checked))


def extras_h(tables: Tables) -> str:
    """Returns kuafu/import/material_extras.h: the fields that a glTF material's extras may have."""
    struct = tables.structs["kuafu_material_desc"]
    fields = [f for f in struct.fields if f.extras]
    kinds = {
        "numbers": [f for f in fields if f.type == "float" and f.count == 1],
        "vectors": [f for f in fields if f.type == "float" and f.count == 3],
        "flags": [f for f in fields if f.type == "flag"],
        "textures": [f for f in fields if f.type == "id"],
    }
    text = []
    for kind, members in kinds.items():
        pairs = ", ".join(f'std::pair{{"{f.name}", &m.{f.name}}}' for f in members)
        text += ["", f"inline auto extras_{kind}(MaterialFields& m) {{", f"  return std::array{{{pairs}}};", "}"]
    head = banner(struct, note="Fields that a glTF material's extras may have, under their names.")
    return cpp_file(head, ["once", "", "<array>", "<utility>", "", '"scene/fields.h"'], text)


def extras_schema(tables: Tables) -> str:
    """Returns kuafu/import/material_extras.inc: a row of gltf_schema.cpp's table."""
    struct = tables.structs["kuafu_material_desc"]
    kinds = {f.name: "texture" if f.type == "id" else "number" if f.count == 1 else f"number[{f.count}]"
             for f in struct.fields if f.extras}  # fmt: skip
    members = " ".join(f"{name}:{kind}" for name, kind in kinds.items())
    text = banner(struct, note="What a glTF material's extras must be, for the table of gltf_schema.cpp.")
    return "\n".join([*text, f'{{"/materials/*/extras", "{members} ..."}},', ""])


def python_fields_h(tables: Tables) -> str:
    """Returns python/kuafu/fields.h: the fields of the records as Python properties."""
    records = [s for s in tables.of("kuafu") if s.python]
    text = []
    for s in records:
        fields = [f"  {_property(s, f)}" for f in s.fields if f.python and f.type != "text"]
        head = f"inline void bind_fields(py::class_<{s.name if s.answer else s.python}>& type) {{"
        text += ["", head, f"  using S = {s.name};", *fields, "}"]
    note = "The fields of the records as properties, under their C names."
    return cpp_file(banner(*records, note=note), ["once", "", '"properties.h"'], text, "ks_python")


def _property(struct: Struct, f: Field) -> str:
    doc = f'doc("{struct.python}.{"lens_model" if f.type == "ks_lens" else f.name}")'
    member = f'type, "{f.name}", &S::{f.name}'
    if struct.answer:
        return f"answer({member}, {doc});"
    if f.type == "ks_lens":
        return f"lens(type, &S::{f.name}, {doc});"
    if f.values:
        names = ", ".join(f'"{v}"' for v in f.values)
        return f"named({member}, std::array<std::string_view, {len(f.values)}>{{{names}}}, {f.first}, {doc});"
    kinds = (("maybe", f.nan or f.none), ("id", f.type == "id"), ("flag", f.type == "flag"), ("square", f.shape),
             ("vector", f.count != 1))  # fmt: skip
    kind = next((name for name, holds in kinds if holds), "scalar")
    return f"{kind}({member}, {doc});"
