# SPDX-License-Identifier: Apache-2.0
"""Resolves the files that a capture, a model or a recording's list names. They must lie in its own folder, because the
author of a shared folder should not choose other files to read. Links count by their targets."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_MAY_LEAVE = ContextVar("may_leave", default=False)


@contextmanager
def outside_allowed() -> Iterator[None]:
    """Allows named files to lie in any folder while the block runs, as the command line's --allow-outside."""
    token = _MAY_LEAVE.set(True)
    try:
        yield
    finally:
        _MAY_LEAVE.reset(token)


def is_outside_allowed() -> bool:
    return _MAY_LEAVE.get()


def own_file(folder: Path, name: str) -> Path:
    """Returns the path of the file `name` in a folder. Raises ValueError if it does not exist, or if it lies outside
    the folder without outside_allowed(). A file outside is then not touched."""
    path = folder / name
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, or a name that no file has
        raise ValueError(f"{str(path)!r} does not exist: {error}") from error
    if not inside and not is_outside_allowed():
        raise ValueError(
            f"{path} lies outside of {folder}: move it into the folder, or allow it where you trust who wrote this "
            "(activestereo --allow-outside COMMAND ..., in Python activestereo.common.own_files.outside_allowed())"
        )
    if not path.is_file():
        raise ValueError(f"{path} does not exist")
    return path
