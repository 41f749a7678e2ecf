# SPDX-License-Identifier: Apache-2.0
"""Writes Python: type annotations, the stubs of both modules, and the engines' options: keyword arguments of the
bindings, and options of a sensor's configuration and of the command line."""

from __future__ import annotations

import ast
import dataclasses
import json
import math
import textwrap
from collections.abc import Sequence
from typing import Any

from emit_cpp import OFF, banner, cpp_file, reasons
from table import Field, Struct, Tables
from words import GENERATED, LICENCE, WIDTH, facts, python_words, range_text


def _kind(field: Field) -> str:
    kinds = {"float": "float", "double": "float", "flag": "bool", "choice": "str", "text": "str", "bits": "tuple"}
    return kinds.get(field.type, "int")


def scalar_type(field: Field) -> str:
    """Returns the annotation of one number of the field."""
    if field.type == "bits":
        return "Sequence[str]"
    if field.values:
        return "Literal[" + ", ".join(f'"{v}"' for v in field.values) + "]"
    kind = _kind(field)
    return f"{kind} | None" if field.nan or field.none or field.type in ("id", "text") else kind


def _annotation(field: Field) -> str:
    """Returns the annotation of a whole field as an attribute."""
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
        if f.type == "ks_lens":
            out += ['lens_model: Literal["brown_conrady", "kannala_brandt"]', f'"""{_prose(f)}"""',
                    "@property", f"def distortion(self) -> tuple[{', '.join(['float'] * 8)}]: ...",
                    "@distortion.setter", "def distortion(self, values: Sequence[float]) -> None: ..."]  # fmt: skip
            continue
        if struct.answer:
            out += ["@property", f"def {f.name}(self) -> {_annotation(f)}:", f'    """{_prose(f)}"""']
            continue
        out += [f"{f.name}: {_annotation(f)}", f'"""{_prose(f)}"""']
    return out


def _prose(field: Field) -> str:
    """Returns a field's description and facts in Python's words."""
    return python_words(" ".join(filter(None, [field.doc, f"[{facts(field)}]" if facts(field) else ""])))


def _stub_arguments(structs: list[Struct]) -> list[str]:
    """Returns stub lines: every field of the structs as a keyword argument; choices may be given by number, too."""
    fields = [f for s in structs for f in s.fields if f.python]
    return [f"{f.name}: {scalar_type(f)}{' | int' if f.type == 'choice' else ''} = ...," for f in fields]


def _stub_options(struct: Struct) -> list[str]:
    """Returns stub lines: every field that Python takes by keyword, with its default."""
    fields = named(struct).fields
    return [f"{name}: {scalar_type(f)} = {literal(f)}," for f in fields for name in (f.name, f.short) if name]


def stub(tables: Tables, library: str, template: str, shared: str) -> str:
    """Returns python/<library>/_<library>.pyi. template: the text of its .pyi.in. shared: the part that both libraries
    have."""
    known = {s.python: s for s in tables.of(library) if s.python}
    lists = {f"{name}.fields": _stub_fields(s) for name, s in known.items()}
    lists |= {f"{name}.doc": [s.doc] for name, s in known.items()}
    engine = [s for s in tables.of(library) if s.name in ("simsense_parameters", "simsense_signal")]
    lists["parameters"] = _stub_arguments(engine)
    lists["shared"] = shared.removeprefix(f"# {LICENCE}\n").rstrip().split("\n")
    options = {"rig": "simsense_rig_desc", "renderer": "kuafu_renderer_desc", "options": "kuafu_render_desc"}
    for key, name in options.items():
        lists[key] = _stub_options(tables.structs[name])
        lists[f"{key}.doc"] = options_doc(tables.structs[name], WIDTH - 8)
    sources = f"from python/{library}/_{library}.pyi.in, python/bindings/shared.pyi.in and"
    out = ["# " + GENERATED.format("*.toml").replace("from", sources)]
    for line in template.removeprefix(f"# {LICENCE}\n").split("\n"):
        for key, value in lists.items():
            if "{" + key + "}" in line:
                indent = line[: len(line) - len(line.lstrip())]
                line = line.replace("{" + key + "}", ("\n" + indent).join(value))
        out.append(line)
    return "\n".join(text.rstrip() for text in "\n".join(out).split("\n"))


def docs_h(library: str, text: str) -> str:
    """Returns python/<library>/docs.h: the docstrings of its stub by name, for the bindings. text: the stub."""
    found: dict[str, str | None] = {}
    for node in ast.parse(text).body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            found[node.name] = ast.get_docstring(node)
        members = node.body if isinstance(node, ast.ClassDef) else []
        for member, after in zip(members, [*members[1:], None], strict=False):
            if isinstance(member, ast.FunctionDef):
                found[f"{node.name}.{member.name}"] = ast.get_docstring(member)
            elif isinstance(member, ast.AnnAssign) and isinstance(after, ast.Expr):
                found[f"{node.name}.{ast.unparse(member.target)}"] = ast.literal_eval(after.value)
    rows = [f"    {{{json.dumps(name)}, {json.dumps(doc)}}}," for name, doc in found.items() if doc]
    body = ["", "inline constexpr std::pair<std::string_view, const char*> docs[] = {", *rows, "};", "",
            "/// Of a class, a function, or a class's member.", "consteval const char* doc(std::string_view name) {",
            "  for (const auto& [known, text] : docs)", "    if (known == name) return text;",
            '  throw "the stub has no such docstring";', "}"]  # fmt: skip
    head = [f"// Generated by capi/generation/generate.py from python/{library}/_{library}.pyi.", OFF]
    return cpp_file(head, ["once", "", "<string_view>", "<utility>"], body, "ks_python")


def named(struct: Struct) -> Struct:
    """Returns the struct with the fields that Python takes by keyword alone: no array, no pointer, no struct inside."""
    kinds = ("flag", "choice", "bits", "id", "index", "float", "double", "uint32", "int32", "uint64", "text")
    return dataclasses.replace(
        struct, fields=[f for f in struct.fields if f.python and f.count == 1 and f.type in kinds]
    )


def _fields_h(name: str, structs: dict[str, Struct], include: str, more: Sequence[str] = ()) -> str:
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
    return cpp_file(head, ["once", "", '"bindings/named_fields.h"', f'"{include}"'], [*text, *more], "ks_python")


def options_doc(struct: Struct, width: int) -> list[str]:
    """Returns lines of prose that explain each keyword argument of the struct and each of its values."""
    lines: list[str] = []
    for f in named(struct).fields:
        text = " ".join(f"{f.name}{f' or {f.short}' if f.short else ''}: {python_words(f.doc)}".split())
        text += "".join(f" '{value}': {python_words(doc)}" for value, doc in f.values.items())
        lines += textwrap.wrap(text, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return lines


def simsense_fields_h(tables: Tables) -> str:
    """Returns python/simsense/fields.h: simsense's fields by name, and the names of reasons by number."""
    names = {"parameter": "simsense_parameters", "signal": "simsense_signal", "rig": "simsense_rig_desc"}
    structs = {key: tables.structs[name] for key, name in names.items()}
    known = ", ".join(f'"{name}"' for name in reasons(tables))
    more = ["", f"inline constexpr const char* reason_names[] = {{{known}}};"]
    return _fields_h("simsense's structs", structs, "simsense_api.h", more)


def kuafu_options_h(tables: Tables) -> str:
    """Returns python/kuafu/options.h: the options of a renderer and of a render by name."""
    names = {"renderer": "kuafu_renderer_desc", "render": "kuafu_render_desc"}
    structs = {key: tables.structs[name] for key, name in names.items()}
    return _fields_h("Options of a renderer and of a render", structs, "kuafu_api.h")


def literal(field: Field) -> str:
    """Returns the default as a Python literal."""
    value = _default(field)
    if isinstance(value, str):
        return f'float("{value}")' if field.type in ("float", "double") else f'"{value}"'
    return "()" if value == [] else repr(value)


def _default(field: Field) -> Any:
    """Returns the default as a value for JSON: None for no default and NaN, "inf" for infinity."""
    value = field.default
    if field.type == "flag":
        return bool(value)
    if field.type in ("bits", "text", "id", "index"):
        return [] if field.type == "bits" else None
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return float(value) if field.type in ("float", "double") else value


def _option_type(field: Field) -> str:
    if field.type == "bits":
        return "tuple[str, ...]"
    return scalar_type(field) if field.type in ("choice", "text") else _kind(field)


def _range(f: Field) -> tuple[float, float] | None:
    """Returns the range of a number, or None; an unsigned number is never negative."""
    if f.type in ("uint32", "uint64") and not f.range and not f.allowed:
        return (0, 2**32 - 1 if f.type == "uint32" else 2**64 - 1)
    return f.range


def _row(f: Field) -> str:
    """Returns the field as a JSON object; null stands for an infinite end of its range."""
    row = {"name": f.name, "kind": _kind(f), "default": _default(f), "unit": f.unit, "possible": range_text(f)}
    row |= {"range": [None if math.isinf(v) else v for v in _range(f) or ()], "allowed": f.allowed}
    row |= {"or_zero": f.zero_means is not None, "choices": list(f.values), "pair": f.pair, "short": f.short}
    row |= {"one": f.one, "on_command_line": None if f.option else False, "is_noise": f.noise or None}
    row |= {"doc": python_words(f.doc)}
    return json.dumps({key: value for key, value in row.items() if key == "default" or value not in ("", (), [], None)
                       and (key != "or_zero" or value)}, ensure_ascii=False)  # fmt: skip


_TABLES = {
    "MATCHER": "simsense_parameters", "RIG": "simsense_rig_desc", "SIGNAL": "simsense_signal",
    "RENDERER": "kuafu_renderer_desc", "RENDER": "kuafu_render_desc", "OPTICS": "kuafu_optics_desc",
}  # fmt: skip
_RECORDS = ("SIGNAL", "OPTICS")  # users give such a record as a whole, not field by field


def _config(tables: Tables, key: str) -> list[Field]:
    return [f for f in named(tables.structs[_TABLES[key]]).fields if f.config or key in _RECORDS]


def parameters_json(tables: Tables) -> str:
    """Returns python/activestereo/common/parameters.json: kind, default, range and doc of the engines' options."""
    sources = ", ".join(tables.structs[name].source for name in _TABLES.values())
    parts = [f'"source": {json.dumps(GENERATED.format(sources))}']
    parts += [f'"{key}": [\n' + ",\n".join(_row(f) for f in _config(tables, key)) + "\n]" for key in _TABLES]
    return "{\n" + ",\n".join(parts) + "\n}\n"


def parameter_types(tables: Tables) -> str:
    """Returns python/activestereo/common/parameter_types.py: classes that annotate the engines' options."""
    sources = ", ".join(tables.structs[name].source for key, name in _TABLES.items() if key not in _RECORDS)
    text = [*textwrap.wrap("# " + GENERATED.format(sources), WIDTH, subsequent_indent="# "),
            '"""The types of the engines\' options; classes that have them as attributes inherit these."""', "",
            "from typing import Literal"]  # fmt: skip
    for owner, keys in (("MatcherFields", ("MATCHER", "RIG")), ("RenderFields", ("RENDERER", "RENDER"))):
        text += ["", "", f"class {owner}:"]
        text += [f"    {f.name}: {_option_type(f)}" for key in keys for f in _config(tables, key)]
    return "\n".join([*text, ""])
