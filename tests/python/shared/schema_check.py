# SPDX-License-Identifier: Apache-2.0
"""JSON files checked against the schemas that the product documents them by."""

import json
from pathlib import Path
from typing import Any

import jsonschema

import activestereo


def schema_of(name: str) -> dict[str, Any]:
    """The product's schema of a name, such as "capture"."""
    [path] = Path(activestereo.__file__).parent.glob(f"*/schema/{name}.schema.json")
    return dict(json.loads(path.read_text()))


def violations(value: Any, name: str) -> list[str]:
    """Faults of a value by the schema of a name, empty where it is valid; SchemaError for a wrong schema."""
    schema = schema_of(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    return [f"{e.json_path}: {e.message}" for e in jsonschema.Draft202012Validator(schema).iter_errors(value)]
