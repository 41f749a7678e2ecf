# SPDX-License-Identifier: Apache-2.0
"""Everything that is wrong with a capture, found in one pass; read_capture() ends at the first fault."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from activestereo.capture.capture import SIDES, Capture, capture_from
from activestereo.capture.capture_json import CaptureError, JsonObject
from activestereo.common.limits import ANY, NUMBER, Limits

_Out = TypeVar("_Out")


class _Collected(JsonObject):
    """A JsonObject that keeps its faults, and gives a neutral value in the place of a wrong one."""

    def __init__(self, path: Path, name: str, values: dict[str, Any]) -> None:
        super().__init__(path, name, values)
        self.faults: list[str] = []
        self._is_reading = False

    def refuse(self, error: CaptureError) -> None:
        self.faults.append(str(error))

    def _or(self, neutral: _Out, read: Callable[..., Any], *arguments: Any) -> Any:
        """read()'s value; on an error the neutral value and one fault, for the reads inside it, too."""
        if self._is_reading:
            return read(*arguments)
        self._is_reading = True
        try:
            return read(*arguments)
        except CaptureError as error:
            self.faults.append(str(error))
            return neutral
        finally:
            self._is_reading = False

    def _child(self, key: str, name: str, value: Any) -> JsonObject:
        child = super()._child(key, name, value)
        assert isinstance(child, _Collected)
        child.faults = self.faults
        return child

    def object(self, key: str, optional: bool = False) -> Any:
        return self._or(_Collected(self.path, self.key(key), {}), super().object, key, optional)

    def objects(self, key: str) -> list[JsonObject]:
        values = self._get(key, optional=True)
        if not isinstance(values, list):
            self.complain(key, "is missing" if values is None else "is not a list")
            return []
        names = (f"{self.key(key)}[{i}]" for i in range(len(values)))
        found = [self._or(None, self._child, key, name, value) for name, value in zip(names, values, strict=True)]
        return [child for child in found if child is not None]

    def text(self, key: str) -> str:
        return str(self._or("", super().text, key))

    def number(self, key: str, limits: Limits = ANY, optional: bool = False) -> Any:
        return self._or(0.0, super().number, key, limits, optional)

    def integer(self, key: str, limits: Limits = NUMBER, optional: bool = False) -> Any:
        return self._or(0, super().integer, key, limits, optional)

    def numbers(self, key: str, limits: Sequence[Limits], optional: bool = False) -> Any:
        return self._or(np.zeros(len(limits)), super().numbers, key, limits, optional)

    def camera_matrix(self, key: str) -> np.ndarray:
        return np.asarray(self._or(np.eye(3), super().camera_matrix, key))

    def lens(self, key: str) -> np.ndarray:
        return np.asarray(self._or(np.zeros(5), super().lens, key))

    def rigid_transform(self, key: str) -> np.ndarray:
        return np.asarray(self._or(np.eye(4), super().rigid_transform, key))

    def file(self, key: str, optional: bool = False) -> Any:
        return self._or(None, super().file, key, optional)


def capture_faults(path: str | Path) -> list[str]:
    """The faults of a capture's file and of each of its images, in the file's order; empty if there are none."""
    folder = Path(path).parent if Path(path).name == "capture.json" else Path(path)
    try:
        root = _Collected.read(folder / "capture.json")
        assert isinstance(root, _Collected)
    except CaptureError as error:
        return [str(error)]
    try:
        capture = capture_from(root)
    except CaptureError as error:  # another format or version: its keys have unknown meanings
        return list(dict.fromkeys([*root.faults, str(error)]))
    faults = root.faults + [f"{root.path}: unknown key {key} is ignored" for key in root.unknown_keys()]
    return list(dict.fromkeys(faults)) or _image_faults(capture)


def _image_faults(capture: Capture) -> list[str]:
    """Faults of images that cannot be decoded, for a capture with a valid file."""
    reads: list[Callable[[], object]] = [capture.rig.projector.pattern]
    for frame in capture.frames:
        if frame.has_infrared:
            reads += [lambda frame=frame, side=side: capture.ir(frame, side) for side in SIDES]  # type: ignore[misc]
        reads += [lambda frame=frame: capture.depth(frame), lambda frame=frame: capture.color(frame)]  # type: ignore[misc]
    found = []
    for read in reads:
        try:
            read()
        except CaptureError as error:
            found.append(str(error))
    return found
