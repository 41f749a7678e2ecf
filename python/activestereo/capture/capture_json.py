# SPDX-License-Identifier: Apache-2.0
"""Reads and checks a capture's JSON. Every failure is a CaptureError that names the file, the key and the value."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from activestereo.common.input_files import read_json_object
from activestereo.common.lens import LENGTHS
from activestereo.common.limits import ANY, DISTORTION, LENGTH, NUMBER, PIXEL, Limits, camera_matrix_fault
from activestereo.common.own_files import own_file
from activestereo.common.pose import rigid_fault
from activestereo.common.shown import shown

# Row by row; further conditions have messages of their own.
_CAMERA_MATRIX = (PIXEL,) * 9
_TRANSFORM = ((ANY,) * 3 + (LENGTH,)) * 3 + (ANY,) * 4


class CaptureError(ValueError):
    """Raised if a capture is unusable. The message names the file, the key and the fault."""


class JsonObject:
    """A JSON object of a file, with reads by key that check the type. It remembers which keys were read. name: the
    object's path inside the file, for messages."""

    def __init__(self, path: Path, name: str, values: dict[str, Any]) -> None:
        self.path, self.name, self._values = path, name, values
        self._known: set[str] = set()
        self._children: list[JsonObject] = []

    @classmethod
    def read(cls, path: str | Path, remedy: str = "") -> JsonObject:
        """Reads a file whose top level is a JSON object. Raises CaptureError otherwise. remedy: the end of the message
        where the file cannot be read."""
        try:
            return cls(Path(path), "", read_json_object(path))
        except OSError as error:
            raise CaptureError(f"{path}: cannot be read ({error.strerror}){remedy}") from error
        except ValueError as error:
            raise CaptureError(f"{error}{remedy}") from error

    def check_format(self, name: str, remedy: str) -> None:
        """Raises CaptureError unless `format` is this name."""
        found = self.text("format") if self.has("format") else None
        if found != name:
            self.fail("format", f"is {'missing' if found is None else shown(found)}, expected '{name}'{remedy}")

    def key(self, key: str) -> str:
        return f"{self.name}.{key}" if self.name else key

    def has(self, key: str) -> bool:
        """Returns whether the key is there and not null."""
        return self._values.get(key) is not None

    def keys(self) -> list[str]:
        """Lists the object's keys in the file's order."""
        return list(self._values)

    def texts(self, key: str) -> list[str]:
        """Reads a list of texts."""
        values = self.plain(key)
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            self.fail(key, "is not a list of text")
        return values

    def table(self, key: str, columns: int) -> np.ndarray:
        """Reads a list of rows, each with `columns` numbers, as float64 [n, columns]."""
        rows = self.plain(key)
        if not isinstance(rows, list) or not all(isinstance(row, list) and len(row) == columns for row in rows):
            self.fail(key, f"is not a list of rows of {columns} numbers")
        for i, row in enumerate(rows):
            for value in row:
                self._within(f"{key}[{i}]", value, ANY)
        return np.array(rows, dtype=np.float64).reshape(-1, columns)

    def fail(self, key: str, what: str) -> NoReturn:
        raise CaptureError(f"{self.path}: {self.key(key)}: {what}")

    def unknown_keys(self) -> list[str]:
        """Lists the keys that nobody has read, in this object and those below it, in the file's order."""
        own = [self.key(key) for key in self._values if key not in self._known]
        return own + [key for child in self._children for key in child.unknown_keys()]

    def plain(self, key: str, optional: bool = False) -> Any:
        """Returns a value without checks of its type; None only if it is optional."""
        self._known.add(key)
        value = self._values.get(key)
        if value is None and not optional:
            self.fail(key, "is missing" if key not in self._values else "is null")
        return value

    def object(self, key: str, optional: bool = False) -> Any:
        value = self.plain(key, optional)
        return None if value is None else self._child(self.key(key), value)

    def objects(self, key: str) -> list[JsonObject]:
        values = self.plain(key, optional=True)
        if not isinstance(values, list):
            self.fail(key, "is missing" if values is None else "is not a list")
        return [self._child(f"{self.key(key)}[{i}]", value) for i, value in enumerate(values)]

    def _child(self, name: str, value: Any) -> JsonObject:
        if not isinstance(value, dict):
            raise CaptureError(f"{self.path}: {name}: is not an object")
        self._children.append(JsonObject(self.path, name, value))
        return self._children[-1]

    def free_form(self, key: str) -> dict[str, Any]:
        """Reads an optional object with arbitrary keys; {} if it is missing."""
        value = self.plain(key, optional=True)
        if value is not None and not isinstance(value, dict):
            self.fail(key, "is not an object")
        return value or {}

    def text(self, key: str) -> str:
        value = self.plain(key)
        if not isinstance(value, str):
            self.fail(key, f"is {shown(value)}, expected text")
        try:
            value.encode()
        except UnicodeEncodeError:
            self.fail(key, f"is {shown(value)}, which is no Unicode text")
        return value

    def number(self, key: str, limits: Limits = ANY, optional: bool = False) -> Any:
        value = self.plain(key, optional)
        return None if value is None else float(self._within(key, value, limits))

    def integer(self, key: str, limits: Limits = NUMBER, optional: bool = False) -> Any:
        value = self.plain(key, optional)
        return None if value is None else self._within(key, value, limits)

    def numbers(self, key: str, limits: Sequence[Limits], optional: bool = False) -> Any:
        """Reads a list of numbers, one within each of `limits`, as float64; a matrix may be a list of rows."""
        values = self.plain(key, optional)
        if values is None:
            return None
        if isinstance(values, list) and values and all(isinstance(row, list) for row in values):
            values = [value for row in values for value in row]
        if not isinstance(values, list) or len(values) != len(limits):
            got = f"{len(values)} entries" if isinstance(values, list) else type(values).__name__
            self.fail(key, f"has {got}, expected {len(limits)} numbers")
        for i, (value, own) in enumerate(zip(values, limits, strict=True)):
            self._within(f"{key}[{i}]", value, own)
        return np.array(values, dtype=np.float64)

    def camera_matrix(self, key: str) -> np.ndarray:
        k = self.numbers(key, _CAMERA_MATRIX).reshape(3, 3)
        if (fault := camera_matrix_fault(k)) is not None:
            self.fail(key, fault)
        return k

    def lens(self, key: str) -> np.ndarray:
        """Reads five, eight or four distortion coefficients, see activestereo/common/lens.py."""
        values = self.plain(key)
        count = len(values) if isinstance(values, list) else 5
        if count not in LENGTHS:
            self.fail(key, f"has {count} entries, expected 5 numbers, 8 of a rational lens or 4 of a fisheye lens")
        return self.numbers(key, [DISTORTION] * count)

    def rigid_transform(self, key: str) -> np.ndarray:
        pose = self.numbers(key, _TRANSFORM).reshape(4, 4)
        if (fault := rigid_fault(pose)) is not None:
            self.fail(key, fault)
        pose[3] = (0.0, 0.0, 0.0, 1.0)  # the renderer allows no rounding there
        return pose

    def _within(self, key: str, value: Any, limits: Limits) -> Any:
        if (fault := limits.fault(value)) is not None:
            self.fail(key, fault)
        return value

    def file(self, key: str, optional: bool = False) -> Any:
        """Reads a file name relative to this file's folder and returns its path. The file must exist there (see
        own_files)."""
        if self.plain(key, optional) is None:
            return None
        try:
            return own_file(self.path.parent, self.text(key))
        except ValueError as error:
            self.fail(key, str(error))
