# SPDX-License-Identifier: Apache-2.0
"""Checked reading of a capture's JSON: every failure is a CaptureError that names the file, the key and the number."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from activestereo.pose import rigid_fault

LARGEST_INTEGER = 2**53


class CaptureError(ValueError):
    """A capture that cannot be used: the message names the file, the key and what is wrong."""


class JsonObject:
    """One object of the file: typed reads by key, remembering which keys were asked for."""

    def __init__(self, path: Path, name: str, values: dict[str, Any]) -> None:
        self.path, self.name = path, name
        self._values = values
        self._known: set[str] = set()
        self._children: list[JsonObject] = []

    @classmethod
    def read(cls, path: str | Path) -> JsonObject:
        try:
            values = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise CaptureError(
                f"{path}: cannot be read ({error.strerror}); a capture is a folder with a capture.json"
            ) from error
        except (ValueError, RecursionError) as error:
            raise CaptureError(f"{path}: is not JSON: {error}") from error
        if not isinstance(values, dict):
            raise CaptureError(f"{path}: is not a JSON object")
        return cls(Path(path), "", values)

    def key(self, key: str) -> str:
        return f"{self.name}.{key}" if self.name else key

    def rename(self, name: str) -> None:
        """A friendlier name for messages, once an entry's identity is known."""
        self.name = name

    def has(self, key: str) -> bool:
        """Whether the key is there and not null."""
        return self._values.get(key) is not None

    def keys(self) -> list[str]:
        """The names of the entries, in the file's order."""
        return list(self._values)

    def plain(self, key: str) -> object:
        """An entry as it stands."""
        return self._get(key)

    def texts(self, key: str) -> list[str]:
        """A list of text."""
        values = self._get(key)
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            self.fail(key, "is not a list of text")
        return values

    def table(self, key: str, columns: int) -> np.ndarray:
        """A list of rows of so many numbers each, as float64 [n][columns]."""
        rows = self._get(key)
        if not isinstance(rows, list) or not all(isinstance(row, list) and len(row) == columns for row in rows):
            self.fail(key, f"is not a list of rows of {columns} numbers")
        if not all(_is_finite_number(value) for row in rows for value in row):
            self.fail(key, "holds something that is not a finite number")
        return np.array(rows, dtype=np.float64).reshape(-1, columns)

    def fail(self, key: str, what: str) -> NoReturn:
        raise CaptureError(f"{self.path}: {self.key(key)}: {what}")

    def unknown_keys(self) -> list[str]:
        """Keys present in the file that nobody asked for, here and below, in the file's order."""
        own = [self.key(key) for key in self._values if key not in self._known]
        return own + [key for child in self._children for key in child.unknown_keys()]

    def _get(self, key: str, optional: bool = False) -> Any:
        self._known.add(key)
        value = self._values.get(key)
        if value is None and not optional:
            self.fail(key, "is missing" if key not in self._values else "is null")
        return value

    def object(self, key: str, optional: bool = False) -> Any:
        value = self._get(key, optional)
        if value is None:
            return None
        return self._child(key, self.key(key), value)

    def objects(self, key: str) -> list[JsonObject]:
        values = self._get(key)
        if not isinstance(values, list):
            self.fail(key, "is not a list")
        return [self._child(key, f"{self.key(key)}[{i}]", value) for i, value in enumerate(values)]

    def _child(self, key: str, name: str, value: Any) -> JsonObject:
        if not isinstance(value, dict):
            raise CaptureError(f"{self.path}: {name}: is not an object")
        child = JsonObject(self.path, name, value)
        self._children.append(child)
        return child

    def free_form(self, key: str) -> dict[str, Any]:
        """An optional object whose keys are nobody's business."""
        value = self._get(key, optional=True)
        if value is not None and not isinstance(value, dict):
            self.fail(key, "is not an object")
        return value or {}

    def text(self, key: str) -> str:
        value = self._get(key)
        if not isinstance(value, str):
            self.fail(key, f"is {value!r}, expected text")
        return value

    def number(
        self,
        key: str,
        optional: bool = False,
        minimum: float | None = None,
        above: float | None = None,
        maximum: float | None = None,
    ) -> Any:
        value = self._get(key, optional)
        if value is None:
            return None
        if not _is_finite_number(value):
            self.fail(key, f"is {value!r}, expected a finite number")
        if minimum is not None and value < minimum:
            self.fail(key, f"is {value}, expected at least {minimum}")
        if above is not None and value <= above:
            self.fail(key, f"is {value}, expected more than {above}")
        if maximum is not None and value > maximum:
            self.fail(key, f"is {value}, expected at most {maximum}")
        return float(value)

    def integer(self, key: str, optional: bool = False, minimum: int | None = None) -> Any:
        value = self._get(key, optional)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int):
            self.fail(key, f"is {value!r}, expected an integer")
        if abs(value) > LARGEST_INTEGER:
            self.fail(key, f"is {value}, expected at most 2^53 in size: JSON keeps no more digits (RFC 8259 section 6)")
        if minimum is not None and value < minimum:
            self.fail(key, f"is {value}, expected at least {minimum}")
        return value

    def numbers(self, key: str, shape: tuple[int, ...], optional: bool = False) -> Any:
        """Row-major list of numbers as a float64 array of `shape`."""
        values = self._get(key, optional)
        if values is None:
            return None
        count = math.prod(shape)
        if not isinstance(values, list) or len(values) != count:
            got = f"{len(values)} entries" if isinstance(values, list) else type(values).__name__
            self.fail(key, f"has {got}, expected {count} numbers")
        if not all(_is_finite_number(v) for v in values):
            self.fail(key, "holds something that is not a finite number")
        return np.array(values, dtype=np.float64).reshape(shape)

    def camera_matrix(self, key: str) -> np.ndarray:
        k = self.numbers(key, (3, 3))
        if k[0, 0] <= 0 or k[1, 1] <= 0 or np.any(k[2] != [0, 0, 1]) or k[1, 0] != 0:
            self.fail(key, "is not a camera matrix [fx s cx, 0 fy cy, 0 0 1] with positive focal lengths")
        return k

    def rigid_transform(self, key: str) -> np.ndarray:
        pose = self.numbers(key, (4, 4))
        fault = rigid_fault(pose)
        if fault is not None:
            self.fail(key, fault)
        return pose

    def file(self, key: str, optional: bool = False) -> Any:
        """A path in the file, relative to the file's folder; the file must exist."""
        if self._get(key, optional) is None:
            return None
        path = self.path.parent / self.text(key)
        if not path.is_file():
            self.fail(key, f"{path} does not exist")
        return path


def _is_finite_number(value: Any) -> bool:
    # Whole numbers have no limit in JSON; those beyond a float's range are not finite here. NaN fails the comparison.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
