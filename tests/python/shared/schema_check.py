# SPDX-License-Identifier: Apache-2.0
"""The part of JSON Schema (draft 2020-12) that the lab's schemas use; a keyword that is not known here is an error, not
a pass."""

_TYPES = {
    "object": dict, "array": list, "string": str, "boolean": bool, "null": type(None), "integer": int,
    "number": (int, float),
}  # fmt: skip
_ANNOTATIONS = {"$schema", "$defs", "title", "description"}
_KNOWN = _ANNOTATIONS | {
    "$ref", "type", "enum", "anyOf", "required", "properties", "additionalProperties", "items", "minItems", "maxItems",
    "minimum", "maximum",
}  # fmt: skip


def violations(value, schema, root=None, place="$"):
    """Texts of what is wrong with a value; empty where it is valid."""
    root = schema if root is None else root
    if unknown := set(schema) - _KNOWN:
        raise ValueError(f"schema keyword not supported: {sorted(unknown)}")
    if "$ref" in schema:
        return violations(value, root["$defs"][schema["$ref"].removeprefix("#/$defs/")], root, place)
    if "anyOf" in schema:
        return (
            []
            if any(not violations(value, s, root, place) for s in schema["anyOf"])
            else [f"{place}: fits none of anyOf"]
        )
    if "enum" in schema:
        return [] if value in schema["enum"] else [f"{place}: {value!r} is not one of {schema['enum']}"]
    wanted = schema.get("type", list(_TYPES))
    if not any(_is(value, name) for name in ([wanted] if isinstance(wanted, str) else wanted)):
        return [f"{place}: {value!r} is not {wanted}"]
    if isinstance(value, dict):
        return _object(value, schema, root, place)
    if isinstance(value, list):
        return _array(value, schema, root, place)
    return _range(value, schema, place)


def _is(value, name):
    return isinstance(value, _TYPES[name]) and not (isinstance(value, bool) and name in ("integer", "number"))


def _object(value, schema, root, place):
    known, rest = schema.get("properties", {}), schema.get("additionalProperties", True)
    found = [f"{place}: lacks {key}" for key in schema.get("required", []) if key not in value]
    for key, entry in value.items():
        if key in known:
            found += violations(entry, known[key], root, f"{place}.{key}")
        elif isinstance(rest, dict):
            found += violations(entry, rest, root, f"{place}.{key}")
        elif not rest:
            found.append(f"{place}: {key} is not in the schema")
    return found


def _array(value, schema, root, place):
    found = (
        []
        if schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value))
        else [f"{place}: has {len(value)} items"]
    )
    return found + [
        v for i, item in enumerate(value) for v in violations(item, schema.get("items", {}), root, f"{place}[{i}]")
    ]


def _range(value, schema, place):
    low, high = schema.get("minimum", value), schema.get("maximum", value)
    return (
        []
        if isinstance(value, str) or value is None or low <= value <= high
        else [f"{place}: {value} is outside {low}..{high}"]
    )
