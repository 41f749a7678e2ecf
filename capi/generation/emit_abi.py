# SPDX-License-Identifier: Apache-2.0
"""Writes the parts that keep the C ABI: the bytes that must be zero, the exported initialiser, and the test of every
offset."""

from __future__ import annotations

from emit_c import layout
from emit_cpp import banner
from table import Struct, TableError, Tables
from words import GENERATED, c_comment

COUNTS = {"KS_MAX_DIMS": 5}


def check_no_padding(tables: Tables) -> None:
    """Checks that no struct ends in padding. A field appended into padding would leave sizeof, and with it the version
    check, as it was. Raises TableError."""
    for s in tables.structs.values():
        *fields, (_, size, _) = layout(s, tables, COUNTS)
        name, at, length = fields[-1]
        if at + length != size:
            padding = f"{size - at - length} bytes of padding after {name}"
            raise TableError(f"{s.source}: the struct ends in {padding}: add a reserved field")


def _reserved(struct: Struct, tables: Tables) -> list[str]:
    """Returns {offset, bytes} of every part of the struct that must be zero, in C++."""
    out = []
    for f in struct.fields:
        if f.reserved:
            out.append(f"{{offsetof({struct.name}, {f.name}), sizeof({struct.name}::{f.name})}}")
        inner = tables.structs.get(f.type)
        if inner is not None and inner.type_id is None:
            out += [
                f"{{offsetof({struct.name}, {f.name}) + offsetof({inner.name}, {g.name}), "
                f"sizeof({inner.name}::{g.name})}}"
                for g in inner.fields
                if g.reserved
            ]
    return out


def struct_table(tables: Tables, library: str) -> str:
    """Returns C++ that lists the bytes of a library's structs that must be zero, for ks::read_struct."""
    structs = [s for s in tables.of(library) if s.type_id is not None and not s.plugin]
    public = (
        ["ks/buffer.h", "ks/device.h", "ks/image.h", "ks/sync.h"] if library == "ks" else [f"{library}/{library}.h"]
    )
    text = [*banner(*structs, note="Bytes of the public structs that must be zero."),
            "// NOLINTBEGIN(bugprone-sizeof-expression): where a field is a pointer, its own size is meant",
            "#pragma once", "", "#include <array>", "#include <cstddef>", "", '#include "device/struct_read.h"',
            *(f'#include "{name}"' for name in public), "", "namespace ks {", ""]  # fmt: skip
    for s in structs:
        reserved = _reserved(s, tables)
        value = f"{{{{{', '.join(reserved)}}}}}" if reserved else "{}"
        member = f"  static constexpr std::array<ReservedBytes, {len(reserved)}> reserved = {value};"
        text += ["template <>", f"struct StructInfo<{s.name}> {{", member, "};", ""]
    return "\n".join([*text, "}  // namespace ks", "", "// NOLINTEND(bugprone-sizeof-expression)", ""])


def struct_init(tables: Tables, library: str) -> str:
    """Returns C++ of the exported initialiser for every struct of a library and of ks."""
    structs = [s for owner in ("ks", library) for s in tables.of(owner) if s.type_id is not None and not s.plugin]
    text = [*banner(*structs), '#include "device/struct_read.h"', f'#include "{library}/{library}.h"', "",
            "namespace {", "", "template <class T>",
            "void give(void* out, uint32_t size_bytes, const T& value) { ks::init_struct(out, size_bytes, "
            "&value, sizeof value); }", "",
            "}  // namespace", "", f"ks_status {library}_struct_init(uint32_t type, void* out, uint32_t size_bytes) {{",
            "  return ks::guard([&] {", "    switch (type) {"]  # fmt: skip
    for s in structs:
        arguments = ", ".join(_argument(s, name, tables) for name in s.init)
        text.append(f"      case {s.type_name}: return give(out, size_bytes, {s.name}_init({arguments}));")
    unknown = '    ks::fail(KS_ERROR_INVALID_ARGUMENT, "struct type 0x%x is not known to this library", type);'
    return "\n".join([*text, "    }", unknown, "  });", "}", ""])


def _argument(struct: Struct, name: str, tables: Tables) -> str:
    field = struct[name]
    if field.type in tables.structs and tables.structs[field.type].type_id is not None:
        return f"{field.type}_init()"
    if field.type == "choice":
        return field.prefix + str(field.default).upper()
    return "0" if field.c_type.startswith("uint") else f"{field.type}{{}}"


def layout_test(tables: Tables) -> str:
    """Returns tests/capi/abi_layout_tables.c, which checks size and offset of every field on 64-bit targets."""
    doc = "Sizes and offsets of every field of the public structs, on 64-bit targets. "
    text = [c_comment(GENERATED.format("all files of that folder")),
            c_comment(doc + "A failure is a negative array size."),
            "#include <stddef.h>", "", '#include "ks/effect.h"', '#include "kuafu/kuafu.h"',
            '#include "simsense/simsense.h"', "",
            "#define JOIN_EXPANDED(a, b) a##b", "#define JOIN(a, b) JOIN_EXPANDED(a, b)",
            "#define HOLDS(condition) typedef char JOIN(layout_line_, __LINE__)[(condition) ? 1 : -1] "
            "__attribute__((unused))",
            "#define SIZE(type, bytes) HOLDS(sizeof(type) == (bytes))",
            "#define AT(type, field, bytes, length) HOLDS(offsetof(type, field) == (bytes) && "
            "sizeof(((type*)0)->field) == (length))"]  # fmt: skip
    for s in tables.structs.values():
        *fields, (_, size, _) = layout(s, tables, COUNTS)
        text += ["", f"SIZE({s.name}, {size});"]
        text += [f"AT({s.name}, {name}, {at}, {length});" for name, at, length in fields]
    return "\n".join([*text, ""])
