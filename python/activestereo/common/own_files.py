# SPDX-License-Identifier: Apache-2.0
"""Resolves the files that a capture, a model or a list of recordings names. They must lie below its folder, because
whoever wrote a shared folder must not choose other files to read. Links count as their targets."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_MAY_LEAVE = ContextVar("may_leave", default=False)


@contextmanager
def outside_allowed() -> Iterator[None]:
    """Allows named files to lie in any folder while the block runs. The command line's --allow-outside uses it."""
    token = _MAY_LEAVE.set(True)
    try:
        yield
    finally:
        _MAY_LEAVE.reset(token)


def is_outside_allowed() -> bool:
    return _MAY_LEAVE.get()


def own_file(folder: Path, name: str) -> Path:
    """Returns the path of the file `name`, relative to a folder. Raises ValueError if it does not exist. Outside of an
    outside_allowed() block, also raises ValueError, without opening the file, if it does not lie below the folder."""
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
    if not os.path.isfile(path):  # Path's own method raises OSError for a name that is too long
        raise ValueError(f"{path} does not exist")
    return path
