# SPDX-License-Identifier: Apache-2.0
"""Writes the interface for languages that read no C headers: Python's ctypes and Rust, which keep the
names of C, and the structs of plug-ins for ctypes."""

from __future__ import annotations

import re
import textwrap

from emit_api_table import Function, declared_functions
from table import SCALARS, Field, Struct, Tables
from words import GENERATED

CTYPES = {"float": "c_float", "double": "c_double", "uint8_t": "c_uint8", "uint32_t": "c_uint32", "int32_t": "c_int32",
          "uint64_t": "c_uint64", "int64_t": "c_int64", "char": "c_char", "const char*": "c_char_p"}  # fmt: skip
RUST = {"float": "f32", "double": "f64", "uint8_t": "u8", "uint32_t": "u32", "int32_t": "i32", "uint64_t": "u64",
        "int64_t": "i64", "char": "c_char", "const char*": "*const c_char"}  # fmt: skip

RUST_WORDS = ("type", "match", "ref", "in")

PYTHON_HEAD = '''"""kuafu.h and simsense.h for ctypes: a caller of their functions, and their constants \
and structs. Copy this file."""

# fmt: off
import ctypes as c
import math
from collections.abc import Sequence
from typing import Any


class Error(RuntimeError):
    """A call failed; the text is the library's own."""


class Library:
    """libkuafu or libsimsense, whose functions are called by the names that they have in C."""

    def __init__(self, name: str) -> None:
        self.name, self.library = name, c.CDLL(f"lib{name}.so.1")
        self.last_error = getattr(self.library, f"{name}_last_error")
        self.last_error.restype = c.c_char_p

    def call(self, function: str, *arguments: Any) -> None:
        """Structs are given by address. Raises Error."""
        passed = [c.byref(a) if isinstance(a, c.Structure) else a for a in arguments]
        if getattr(self.library, function)(*passed) < 0:
            raise Error(self.last_error().decode())

    def make(self, function: str, *arguments: Any, kind: Any = c.c_void_p) -> Any:
        """The handle, or the number, that a function writes through its last argument."""
        out = kind()
        self.call(function, *arguments, c.byref(out))
        return out

    def release(self, **handles: Any) -> None:
        """Gives handles back, each by the name of its kind: device=..., scene=..."""
        for kind, handle in handles.items():
            getattr(self.library, f"{self.name}_{kind}_release")(handle)

    def struct(self, kind: Any, /, **values: Any) -> Any:
        """A struct with its defaults, but for the values that are given; arrays are given as sequences."""
        out = kind()
        self.call(f"{self.name}_struct_init", kind.type_id, out, c.sizeof(out))
        for name, value in values.items():
            held = getattr(out, name)
            setattr(out, name, type(held)(*value) if isinstance(held, c.Array) else value)
        return out

    def packed_image(self, code: int, item_bytes: int, shape: Sequence[int]) -> Any:
        """A ks_image_desc of an image whose elements lie one after the other."""
        strides = [item_bytes * math.prod(shape[axis + 1 :]) for axis in range(len(shape))]
        return self.struct(ks_image_desc, format=code, dim_count=len(shape), shape=shape, byte_stride=strides)


class ks_header(c.Structure):
    _fields_ = [("size_bytes", c.c_uint32), ("type", c.c_uint32)]

'''
RUST_HEAD = """//! The structs and constants of kuafu.h and simsense.h. Copy this file; `kuafu_struct_init` and \
`simsense_struct_init` fill in a struct.
#![allow(dead_code, non_camel_case_types)]
use std::os::raw::{c_char, c_void};

#[repr(C)]
#[derive(Clone, Copy)]
pub struct ks_header {
    pub size_bytes: u32,
    pub r#type: u32,
}

/// A struct with its defaults: `filled(kuafu_struct_init, KUAFU_TYPE_RENDER_DESC)`. The type is that of the struct T.
pub unsafe fn filled<T>(init: unsafe extern "C" fn(u32, *mut c_void, u32) -> i32, type_id: u32) -> T {
    let mut out = std::mem::MaybeUninit::<T>::zeroed();
    let status = init(type_id, out.as_mut_ptr() as *mut c_void, std::mem::size_of::<T>() as u32);
    assert!(status >= 0, "no struct has the type {type_id:#x}");
    out.assume_init()
}

/// Ends the program with the library's own text where a call has failed.
pub fn check(status: i32, last_error: unsafe extern "C" fn() -> *const c_char) {
    if status < 0 {
        eprintln!("{}", unsafe { std::ffi::CStr::from_ptr(last_error()) }.to_string_lossy());
        std::process::exit(1);
    }
}

/// An image whose elements lie one after the other.
pub unsafe fn packed_image(format: u32, item_bytes: i64, shape: &[usize]) -> ks_image_desc {
    let mut image: ks_image_desc = filled(simsense_struct_init, KS_TYPE_IMAGE_DESC);
    (image.format, image.dim_count) = (format, shape.len() as u32);
    let mut stride = item_bytes;
    for axis in (0..shape.len()).rev() {
        (image.shape[axis], image.byte_stride[axis]) = (shape[axis] as u64, stride);
        stride *= shape[axis] as i64;
    }
    image
}
"""


def _constants(headers: dict[str, str]) -> dict[str, str]:
    """Returns {name: number as text} of the constants that the generated headers define. headers: {path: text}."""
    text = "\n".join(headers.values())
    return dict(re.findall(r"^#define (\w+) (0x[0-9a-f]+|\d+)u?\b(?!\.)", text, re.MULTILINE))


def _count(field: Field, constants: dict[str, str]) -> int:
    return int(constants[field.count], 0) if isinstance(field.count, str) else field.count


def _in_order(tables: Tables) -> list[Struct]:
    """Returns the structs, each after those that stand inside it."""
    left, out = [s for s in tables.structs.values() if not s.plugin], []
    while left:
        names = {s.name for s in left}
        ready = [s for s in left if not names & {f.type for f in s.fields}]
        out += ready
        left = [s for s in left if s not in ready]
    return out


def _type(field: Field, scalars: dict[str, str], pointer: str, tables: Tables) -> str:
    if field.type in SCALARS:
        return scalars[field.c_type]
    return field.type if field.type in tables.structs else pointer


def python_structs(tables: Tables, headers: dict[str, str]) -> str:
    """Returns examples/clients/interface.py: a caller, constants and structs for ctypes. headers: {path: text}."""
    constants = _constants(headers)
    numbers = [f"{name} = {value}" for name, value in constants.items()]
    out = ["# " + GENERATED.format("*.toml"), PYTHON_HEAD, *numbers, ""]
    for struct in _in_order(tables):
        out += ["", f"class {struct.name}(c.Structure):"]
        out += [f"    type_id = {struct.type_name}"] if struct.type_id is not None else []
        fields = ['("header", ks_header)'] if struct.type_id is not None else []
        for field in struct.fields:
            kind = _type(field, {k: f"c.{v}" for k, v in CTYPES.items()}, "c.c_void_p", tables)
            count = _count(field, constants)
            fields.append(f'("{field.name}", {kind}{"" if count == 1 else f" * {count}"})')
        rows = textwrap.wrap(", ".join(text.replace(" ", "\0") for text in fields), 110)
        out += ["    _fields_ = [", *(f"        {row}".replace("\0", " ") for row in rows), "    ]", ""]
    return "\n".join(out)


def rust_structs(tables: Tables, headers: dict[str, str]) -> str:
    """Returns examples/clients/interface.rs: structs, constants and functions for Rust. headers: {path: text}."""
    constants = _constants(headers)
    out = ["// " + GENERATED.format("*.toml"), RUST_HEAD]
    for struct in _in_order(tables):
        out += ["#[repr(C)]", "#[derive(Clone, Copy)]", f"pub struct {struct.name} {{"]
        out += ["    pub header: ks_header,"] if struct.type_id is not None else []
        for field in struct.fields:
            kind = _type(field, RUST, "*mut c_void" if not field.is_pointer else "*const c_void", tables)
            count = _count(field, constants)
            out.append(f"    pub {_rust_name(field.name)}: {kind if count == 1 else f'[{kind}; {count}]'},")
        out += ["}", ""]
    for name, value in constants.items():
        out.append(f"pub const {name}: u32 = {value};")
    for library in ("kuafu", "simsense"):
        out += ["", f'#[link(name = "{library}")]', 'extern "C" {']
        out += [_rust_function(function, tables) for function in declared_functions(library).values()]
        out.append("}")
    return "\n".join([*out, ""])


def _rust_function(function: Function, tables: Tables) -> str:
    """Returns the declaration of a C function in Rust."""
    given = [] if function.parameters == "void" else function.parameters.split(", ")
    parameters = [_rust_parameter(text, tables) for text in given]
    result = "" if function.result == "void" else f" -> {_rust_type(function.result, tables)}"
    return f"    pub fn {function.name}({', '.join(parameters)}){result};"


def _rust_parameter(text: str, tables: Tables) -> str:
    kind, name = text.rsplit(" ", 1)
    return f"{_rust_name(name)}: {_rust_type(kind, tables)}"


def _rust_name(name: str) -> str:
    return f"r#{name}" if name in RUST_WORDS else name


def _rust_type(kind: str, tables: Tables) -> str:
    """Returns a C type in Rust: numbers and structs by their names, handles and all else as untyped pointers."""
    kind = kind.strip()
    if kind.endswith("*"):
        inner = kind.removesuffix("*").strip()
        pointer = "*const" if inner.startswith("const ") else "*mut"
        return f"{pointer} {_rust_type(inner.removeprefix('const '), tables)}"
    plain = RUST | {"void": "c_void", "ks_status": "i32"}
    return plain.get(kind, kind if kind in tables.structs else "*mut c_void")


# The one function type of ks/effect.h; the structs' tables do not describe it.
APPLY = """\
Apply = c.CFUNCTYPE(
    c.c_int32, c.POINTER(View), c.POINTER(c.c_double), c.c_uint32, c.POINTER(c.c_double), c.POINTER(c.c_double)
)
"""


def _class_name(struct: str) -> str:
    """Returns the Python class's name of a struct: RandomTerm for ks_effect_random_term, Effect for ks_effect."""
    return struct.removeprefix("ks_effect_" if struct != "ks_effect" else "ks_").title().replace("_", "")


def _plugin_type(field: Field, tables: Tables) -> str:
    target = field.type.removeprefix("const ").removesuffix("*").strip()
    if field.type == "ks_effect_apply_fn":
        return "Apply"
    if field.is_pointer:
        return f"c.POINTER({_class_name(target)})" if target in tables.structs else "c.c_void_p"
    kind = f"c.{CTYPES[field.c_type]}"
    return kind if field.count == 1 else f"{kind} * {field.count}"


def _plugin_class(struct: Struct, tables: Tables) -> list[str]:
    fields = [("header", "Header")] if struct.type_id is not None else []
    fields += [(f.name, _plugin_type(f, tables)) for f in struct.fields]
    head = [
        "",
        "",
        f"class {_class_name(struct.name)}(c.Structure):",
        f'    """{struct.name}"""',
        "",
        "    _fields_ = [",
    ]
    return [*head, *(f'        ("{name}", {kind}),' for name, kind in fields), "    ]"]


def plugin_records(tables: Tables) -> str:
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
        text += _plugin_class(s, tables)
    return "\n".join([*text, ""])
