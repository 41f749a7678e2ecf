# SPDX-License-Identifier: Apache-2.0
"""Writes the structs of plug-ins for Python's ctypes."""

from __future__ import annotations

from emit_ffi import CTYPES
from table import Field, Struct, Tables
from words import GENERATED

# The one function type of ks/effect.h; the structs' tables do not describe it.
APPLY = """\
Apply = c.CFUNCTYPE(
    c.c_int32, c.POINTER(View), c.POINTER(c.c_double), c.c_uint32, c.POINTER(c.c_double), c.POINTER(c.c_double)
)
"""


def _name(struct: str) -> str:
    """Returns the Python class's name of a struct: RandomTerm for ks_effect_random_term, Effect for ks_effect."""
    return struct.removeprefix("ks_effect_" if struct != "ks_effect" else "ks_").title().replace("_", "")


def _ctype(field: Field, tables: Tables) -> str:
    target = field.type.removeprefix("const ").removesuffix("*").strip()
    if field.type == "ks_effect_apply_fn":
        return "Apply"
    if field.is_pointer:
        return f"c.POINTER({_name(target)})" if target in tables.structs else "c.c_void_p"
    kind = f"c.{CTYPES[field.c_type]}"
    return kind if field.count == 1 else f"{kind} * {field.count}"


def _class(struct: Struct, tables: Tables) -> list[str]:
    fields = [("header", "Header")] if struct.type_id is not None else []
    fields += [(f.name, _ctype(f, tables)) for f in struct.fields]
    head = ["", "", f"class {_name(struct.name)}(c.Structure):", f'    """{struct.name}"""', "", "    _fields_ = ["]
    return [*head, *(f'        ("{name}", {kind}),' for name, kind in fields), "    ]"]


def records(tables: Tables) -> str:
    """Returns python/activestereo/effects/core/plugin_records.py: constants and structs of ks/effect.h."""
    structs = [s for s in tables.structs.values() if s.plugin]
    doc = "The structs of ks/effect.h: numbers of their types, names of their choices, and how they lie."
    text = ["# " + GENERATED.format("ks_effect*.toml"), f'"""{doc}"""', "", "import ctypes as c", ""]
    text += [f"{s.type_name.removeprefix('KS_')} = 0x{s.type_id:02x}" for s in structs if s.type_id is not None]
    for f in (f for s in structs for f in s.fields if f.values):
        names = ", ".join(f'"{name}"' for name in f.values)
        text.append(f"{f.name.upper()} = ({names})")
    text += ["", "", "class Header(c.Structure):", '    """ks_header"""', "",
             '    _fields_ = [("size_bytes", c.c_uint32), ("type", c.c_uint32)]']  # fmt: skip
    for s in structs:
        text += ["", "", APPLY.rstrip()] if any(f.type == "ks_effect_apply_fn" for f in s.fields) else []
        text += _class(s, tables)
    return "\n".join([*text, ""])
