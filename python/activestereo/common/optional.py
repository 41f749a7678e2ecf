# SPDX-License-Identifier: Apache-2.0
"""Imports modules of optional packages."""

from importlib import import_module
from typing import Any


def imported(name: str, missing: str, error: type[Exception] = ImportError) -> Any:
    """Imports and returns a module. Raises `error` with the text `missing` if its package is not installed."""
    try:
        return import_module(name)
    except ImportError as cause:
        raise error(missing) from cause
