# SPDX-License-Identifier: Apache-2.0
"""Reads other programs' YAML as mappings of texts, and numbers out of them.

Values stay texts until a number is asked for, and tags build no objects. So `!!bool foo`, `!!opencv-matrix`, merge keys
and numbers in base 60 do no harm. Aliases share their targets, and nothing here walks deeper than a matrix. Reading
needs PyYAML: python3-yaml of Debian, or pip install pyyaml.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from activestereo.common.input_files import read_bytes
from activestereo.common.limits import DISTORTION, SIDE, Limits
from activestereo.common.shown import shown

_MOST_BYTES = 1 << 18  # a calibration has some thousands
_NOTHING = (None, "", "~", "null")
# OpenCV's FileStorage writes this first, which YAML has otherwise: %YAML 1.0.
_OPENCV_DIRECTIVE = re.compile(r"%YAML:[\d.]+")


@dataclass(frozen=True)
class Entry:
    """One mapping, with its name for errors."""

    name: str
    values: dict[str, Any]

    def fail(self, key: str, what: str) -> NoReturn:
        raise ValueError(f"{self.name}: {key}: {what}")

    def has(self, key: str) -> bool:
        value = self.values.get(key)
        return isinstance(value, dict | list) or value not in _NOTHING

    def named(self, *keys: str) -> tuple[str, Any]:
        """(key, value) of the first of some keys that is there."""
        for key in keys:
            if self.has(key):
                return key, self.values[key]
        self.fail(keys[0], "is missing")

    def entry(self, key: str) -> Entry | None:
        """The mapping inside; None if there is none."""
        value = self.values.get(key)
        return Entry(f"{self.name}: {key}", value) if isinstance(value, dict) else None

    def one_of(self, known: Sequence[str], key: str, default: str | None = None) -> str:
        """A text out of these; default: used if the key is missing."""
        value = self.named(key)[1] if default is None or self.has(key) else default
        if value not in known:
            self.fail(key, f"is {shown(value)}, expected {' or '.join(known)}")
        return str(value)

    def numbers(self, counts: Sequence[int], limits: Limits, *keys: str) -> NDArray[np.float64]:
        """Numbers, as many as one of `counts`, from a list, a list of rows, or a matrix' data."""
        key, value = self.named(*keys)
        if isinstance(value, dict):
            value = value.get("data")
        if not isinstance(value, list):
            self.fail(key, f"has no list, expected {' or '.join(map(str, counts))} numbers")
        most = max(counts)
        texts = _flat(value, most)
        if len(texts) not in counts:
            has = f"more than {most}" if len(texts) > most else str(len(texts))
            self.fail(key, f"has {has} entries, expected {' or '.join(map(str, counts))} numbers")
        given = [(_whole if limits.whole else _number)(text) for text in texts]
        for i, number in enumerate(given):
            fault = limits.fault(number)
            if fault is not None:
                self.fail(f"{key}[{i}]", fault)
        return np.array(given, dtype=np.float64)

    def side(self, *keys: str) -> int:
        """A width or a height, pixels."""
        key, value = self.named(*keys)
        fault = SIDE.fault(_whole(value))
        if fault is not None:
            self.fail(key, fault)
        return int(value)

    def lens(self, is_fisheye: bool, *keys: str) -> NDArray[np.float64]:
        """The four numbers of a fisheye lens, else the five or eight of OpenCV's k1 k2 p1 p2 k3 k4 k5 k6."""
        if is_fisheye:
            return self.numbers((4,), DISTORTION, *keys)
        given = self.numbers((0, 4, 5, 8, 12, 14), DISTORTION, *keys)
        if np.any(given[8:]):
            self.fail(keys[0], "has a thin prism or a tilted sensor (its ninth number and on), which is not read")
        return given[:8] if len(given) >= 8 else np.pad(given, (0, 5 - len(given)))


def read_entries(path: Path) -> list[Entry]:
    """The file's mappings, one per document. Raises ValueError with the file and the fault."""
    try:
        import yaml
    except ImportError as error:
        raise ValueError(
            f"{path}: YAML is read by the package PyYAML, which is missing: apt-get install python3-yaml, or pip "
            "install pyyaml"
        ) from error
    try:
        text = _OPENCV_DIRECTIVE.sub("", read_bytes(path, _MOST_BYTES).decode("utf-8-sig"), count=1)
        found = [document for document in yaml.load_all(text, yaml.BaseLoader) if document not in _NOTHING]
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is no text in UTF-8: {error}") from error
    except RecursionError:
        raise ValueError(f"{path}: is nested too deep") from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # a letter that there is not: "\\UFFFFFFFF"
        raise ValueError(f"{path}: is not YAML: {' '.join(str(error).split())}") from error
    if not found or not all(isinstance(document, dict) for document in found):
        raise ValueError(f"{path}: has no mapping: ROS' camera_info, Kalibr's camchain or OpenCV's matrices are read")
    several = len(found) > 1
    return [Entry(f"{path} ({i + 1})" if several else str(path), document) for i, document in enumerate(found)]


def _flat(rows: list[Any], most: int) -> list[Any]:
    """The entries of a list, or of the lists in it: at most one more than `most`."""
    out: list[Any] = []
    for row in rows[: most + 1]:
        out += row[: most + 1] if isinstance(row, list) else [row]
    return out[: most + 1]


def _number(text: Any) -> Any:
    """A text's number; any other value unchanged."""
    try:
        return float(text) if isinstance(text, str) else text
    except ValueError:
        return {".inf": np.inf, "-.inf": -np.inf, ".nan": np.nan}.get(text.lower(), text)


def _whole(text: Any) -> Any:
    return int(text) if isinstance(text, str) and text.isascii() and text.isdecimal() and len(text) < 10 else text
