# SPDX-License-Identifier: Apache-2.0
"""Opens and reads users' files. Only regular files of a bounded size are read, because a pipe may block for ever and a
device never ends."""

from __future__ import annotations

import errno
import json
import os
import re
import stat
import sys
from collections import Counter
from pathlib import Path
from typing import Any, BinaryIO

from activestereo.common.shown import shown

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOST_BYTES = 1 << 33
_PART_BYTES = 1 << 24
MOST_TEXT_BYTES = 1 << 26
# No format of this project nests ten deep. Deeper trees may exhaust the stack of recursive code.
DEEPEST_JSON = 100
_MOST_TOML_BYTES = 1 << 20
_DEEPEST_TOML = 16


def open_file(path: str | Path, most_bytes: int = MOST_BYTES) -> BinaryIO:
    """Opens a file for binary reading. Raises OSError, with filename `path`, if it is no regular file or has more than
    `most_bytes`."""
    # Without O_NONBLOCK a pipe that nobody writes to would be waited for here.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        _check(os.fstat(descriptor), path, most_bytes)
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def checked_file(path: str | Path) -> Path:
    """Checks a file as open_file() does, without reading it, and returns its path for a library that opens the file
    itself. Raises OSError."""
    _check(os.stat(path), path, MOST_BYTES)
    return Path(path)


def read_bytes(path: str | Path, most_bytes: int = MOST_BYTES) -> bytes:
    """Reads a whole file. Raises OSError as open_file() does."""
    with open_file(path, most_bytes) as file:
        # Read in parts: one large read allocates memory before it knows the size, and the kernel's files report none.
        parts, size = [], 0
        while part := file.read(_PART_BYTES):
            parts.append(part)
            size += len(part)
            if size > most_bytes:
                raise _too_large(path, size, most_bytes)
    return b"".join(parts)


def read_text(path: str | Path, encoding: str = "utf-8", errors: str = "strict") -> str:
    """Reads a text file. Raises OSError as open_file() does, and ValueError with the path if its bytes are not in
    `encoding`."""
    try:
        return read_bytes(path, MOST_TEXT_BYTES).decode(encoding, errors)
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is no text in UTF-8: {error}") from error


def read_json(path: str | Path) -> Any:
    """Reads a JSON file. Raises OSError as open_file() does, and ValueError with the path for invalid or too deep
    JSON."""
    text = read_text(path)
    try:
        value = json.loads(text, object_pairs_hook=_once)
    except RecursionError:
        raise ValueError(f"{path}: its brackets are nested deeper than {DEEPEST_JSON}") from None
    except ValueError as error:
        raise ValueError(f"{path}: is not JSON: {error}") from error
    level = [value] if isinstance(value, (dict, list)) else []
    for _ in range(DEEPEST_JSON):
        entries = [outer.values() if isinstance(outer, dict) else outer for outer in level]
        level = [inner for outer in entries for inner in outer if isinstance(inner, (dict, list))]
        if not level:
            return value
    raise ValueError(f"{path}: its brackets are nested deeper than {DEEPEST_JSON}")


def read_json_object(path: str | Path) -> dict[str, Any]:
    """Reads a JSON file whose top level is an object. Raises as read_json() does, and ValueError with the path for any
    other value."""
    found = read_json(path)
    if not isinstance(found, dict):
        raise ValueError(f"{path}: is not a JSON object")
    return found


def read_toml(path: str | Path) -> dict[str, Any]:
    """Reads a TOML file as nested dicts. Raises OSError as open_file() does, and ValueError with the path for invalid
    or too deep TOML."""
    content = read_bytes(path, _MOST_TOML_BYTES)
    try:
        text = content.decode()
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is no TOML file: {error}") from error
    # tomllib's memory grows with the square of a dotted key's parts: 100 kB of them took all memory.
    longest = max((part.count(".") for part in re.split(r"[=,{}\[\]\n]", text)), default=0)
    if longest > _DEEPEST_TOML:
        raise ValueError(f"{path}: a key has {longest + 1} parts, at most {_DEEPEST_TOML + 1} are read")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"{path}: its brackets are nested too deep") from None
    except ValueError as error:
        raise ValueError(f"{path}: is no TOML file: {error}") from error


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Makes a JSON object. Raises ValueError for a repeated key, of which Python would keep the last."""
    entries = dict(pairs)
    if len(entries) < len(pairs):
        repeated = next(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
        raise ValueError(f"the key {shown(repeated)} is there twice: keep one of them")
    return entries


def _check(status: os.stat_result, path: str | Path, most_bytes: int) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "is a pipe or a device: copy it to a file first", str(path))
    if status.st_size > most_bytes:
        raise _too_large(path, status.st_size, most_bytes)


def _too_large(path: str | Path, size: int, most_bytes: int) -> OSError:
    text = f"has {size / 1e6:.0f} MB, at most {most_bytes / 1e6:.0f} MB are read"
    return OSError(errno.EFBIG, text, str(path))
