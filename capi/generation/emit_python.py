# SPDX-License-Identifier: Apache-2.0
"""Writes Python: type annotations, and the stubs of both modules."""

from __future__ import annotations

import ast
import json
import math

import emit_options
from emit_cpp import OFF, cpp_file
from table import Field, Struct, Tables
from words import GENERATED, LICENCE, WIDTH, default_text, facts, python_words


def scalar_type(field: Field) -> str:
    """Returns the annotation of one number of the field."""
    if field.type == "bits":
        return "Sequence[str]"
    if field.values:
        return "Literal[" + ", ".join(f'"{v}"' for v in field.values) + "]"
    kind = {"float": "float", "double": "float", "flag": "bool", "text": "str"}.get(field.type, "int")
    if field.type == "text":
        return "str | None"
    return f"{kind} | None" if field.nan or field.none or field.type == "id" else kind


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
    fields = emit_options.named(struct).fields
    return [
        f"{name}: {scalar_type(f)} = {emit_options.literal(f)}," for f in fields for name in (f.name, f.short) if name
    ]


def stub(tables: Tables, library: str, template: str, shared: str) -> str:
    """Returns python/<library>/_<library>.pyi. template: the text of its .pyi.in. shared: the part that both libraries
    have."""
    named = {s.python: s for s in tables.of(library) if s.python}
    lists = {f"{name}.fields": _stub_fields(s) for name, s in named.items()}
    lists |= {f"{name}.doc": [s.doc] for name, s in named.items()}
    engine = [s for s in tables.of(library) if s.name in ("simsense_parameters", "simsense_signal")]
    lists["parameters"] = _stub_arguments(engine)
    lists["shared"] = shared.removeprefix(f"# {LICENCE}\n").rstrip().split("\n")
    options = {"rig": "simsense_rig_desc", "renderer": "kuafu_renderer_desc", "options": "kuafu_render_desc"}
    for key, name in options.items():
        lists[key] = _stub_options(tables.structs[name])
        lists[f"{key}.doc"] = emit_options.options_doc(tables.structs[name], WIDTH - 8)
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


def page_default(field: Field) -> str:
    """Returns the default as the reference page shows it."""
    if field.type == "flag":
        return "yes" if field.default else "no"
    if field.type in ("text",) or field.is_pointer:
        return "NULL"
    return default_text(field) or ("NAN" if isinstance(field.default, float) and math.isnan(field.default) else "0")
