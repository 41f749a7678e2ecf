# SPDX-License-Identifier: Apache-2.0
"""The checks that keep the C ABI: how each struct lies, what a missing field means, the exported initialiser, and the
test of every offset."""

from __future__ import annotations

from emit_c import assignments, embedded_structs, layout
from emit_cpp import banner
from table import Struct, TableError, Tables
from words import GENERATED, c_comment

COUNTS = {"KS_MAX_DIMS": 5}
PUBLIC = {"ks": "ks", "kuafu": "kuafu", "simsense": "simsense"}


def check_no_padding(tables: Tables) -> None:
    """A field appended into padding would leave sizeof, and with it the version check, as it was. Raises TableError."""
    for s in tables.structs.values():
        *fields, (_, size, _) = layout(s, tables, COUNTS)
        name, at, length = fields[-1]
        if at + length != size:
            raise TableError(
                f"{s.source}: the struct ends in {size - at - length} bytes of padding after {name}: add a "
                f"reserved field"
            )


def _reserved(struct: Struct, tables: Tables) -> list[str]:
    """{offset, bytes} of everything that must be zero, in C++."""
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


def _info(struct: Struct, tables: Tables) -> list[str]:
    name = struct.name
    ends = [f"      KS_FIELD_END({name}, {f.name})," for f in struct.fields]
    reserved = _reserved(struct, tables)
    neutral = assignments(struct, "s", "neutral", embedded_structs(tables))
    return [
        "template <>", f"struct StructInfo<{name}> {{",
        "  static constexpr uint32_t ends[] = {", *ends, "  };",
        f"  static constexpr std::array<ReservedBytes, {len(reserved)}> reserved = "
        f"{{{{{', '.join(reserved)}}}}};" if reserved
        else "  static constexpr std::array<ReservedBytes, 0> reserved = {};",
        f"  static {name} neutral() {{", f"    {name} s{{}};",
        f"    s.header = ks_header_make({struct.type_name}, sizeof s);",
        *(f"    {line}" for line in neutral), "    return s;", "  }", "};", "",
    ]  # fmt: skip


def struct_table(tables: Tables, library: str) -> str:
    """How the structs lie and what their missing fields mean, for ks::read_struct."""
    structs = [s for s in tables.of(library) if s.type_id is not None and not s.plugin]
    public = (
        ["ks/buffer.h", "ks/device.h", "ks/image.h", "ks/sync.h"] if library == "ks" else [f"{library}/{library}.h"]
    )
    text = [*banner(*structs, note="How the public structs lie, and what a field means that a caller's struct "
                                   "does not have yet."),
            "// NOLINTBEGIN(bugprone-sizeof-expression): where a field is a pointer, its own size is meant",
            "#pragma once", "",
            "#include <array>", "#include <cmath>", "#include <cstddef>", "", '#include "device/struct_info.h"',
            *(f'#include "{name}"' for name in public), "", "namespace ks {", ""]  # fmt: skip
    for s in structs:
        text += _info(s, tables)
    return "\n".join([*text, "}  // namespace ks", "", "// NOLINTEND(bugprone-sizeof-expression)", ""])


def struct_init(tables: Tables, library: str) -> str:
    """The exported initialiser of every struct of a library and of ks."""
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
    text += [
        "    }",
        '    ks::fail(KS_ERROR_INVALID_ARGUMENT, "struct type 0x%x is not known to this library", type);',
        "  });",
        "}",
        "",
    ]
    return "\n".join(text)


def _argument(struct: Struct, name: str, tables: Tables) -> str:
    field = struct[name]
    if field.type in tables.structs and tables.structs[field.type].type_id is not None:
        return f"{field.type}_init()"
    if field.type == "choice":
        return field.prefix + str(field.default).upper()
    return "0" if field.c_type.startswith("uint") else f"{field.type}{{}}"


def layout_test(tables: Tables) -> str:
    """tests/capi/abi_layout_tables.c: size and offset of every field, for 64-bit targets."""
    text = [c_comment(GENERATED.format("all files of that folder")), c_comment("Sizes and offsets of every field "
                                                                               "of the public structs, on 64-bit "
                                                                               "targets. A failure is a negative "
                                                                               "array size."),
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
        text += [
            "",
            f"SIZE({s.name}, {size});",
            *(f"AT({s.name}, {name}, {at}, {length});" for name, at, length in fields),
        ]
    return "\n".join([*text, ""])


def baseline(tables: Tables) -> str:
    """One line for each field: what callers that were compiled today hold on to."""
    lines = []
    for s in tables.structs.values():
        *fields, (_, size, _) = layout(s, tables, COUNTS)
        lines += [
            f"{s.name} {'embedded' if s.embedded else 'size'} {size}",
            *(f"{s.name}.{name} {at} {length}" for name, at, length in fields),
        ]
    return "\n".join([*lines, ""])


def _was_reserved(name: str, place: list[str], today: dict[str, list[str]]) -> bool:
    """Whether a reserved field has become one of the same size, whose neutral value is then checked."""
    struct, field = name.split(".")
    return field.startswith("reserved") and any(
        now == place for other, now in today.items() if other.startswith(f"{struct}.")
    )


def check_baseline(tables: Tables, text: str) -> list[str]:
    """The rules that today's tables break against a baseline: moved fields, embedded structs that grew, appended fields
    whose neutral value is not 0."""
    today = dict(line.rsplit(" ", 2)[0:1] + [line.rsplit(" ", 2)[1:]] for line in baseline(tables).splitlines())
    then = dict(line.rsplit(" ", 2)[0:1] + [line.rsplit(" ", 2)[1:]] for line in text.splitlines())
    broken = [
        f"{name} was at {old} and is {today.get(name, 'gone')}"
        for name, old in then.items()
        if "." in name and today.get(name) != old and not _was_reserved(name, old, today)
    ]
    for name, (kind, size) in then.items():
        if "." not in name and kind == "embedded" and today.get(name, ("", ""))[1] != size:
            broken.append(f"{name} stands inside other structs and must stay {size} bytes long")
    for s in tables.structs.values():
        if s.name in then:
            broken += [
                f"{s.name}.{f.name} is younger than the baseline: its neutral value must be 0"
                for f in s.fields
                if f"{s.name}.{f.name}" not in then
                and f.neutral not in (0, 0.0, None)
                and f.neutral != next(iter(f.values), 0)
            ]
    return broken
