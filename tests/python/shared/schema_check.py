# SPDX-License-Identifier: Apache-2.0
"""JSON files checked against the schemas that the product documents them by."""

from typing import Any

import jsonschema


def violations(value: Any, schema: dict[str, Any]) -> list[str]:
    """Texts of what is wrong with a value; empty where it is valid. A schema that is none raises SchemaError."""
    jsonschema.Draft202012Validator.check_schema(schema)
    return [f"{e.json_path}: {e.message}" for e in jsonschema.Draft202012Validator(schema).iter_errors(value)]
