# SPDX-License-Identifier: Apache-2.0
"""Copies of scene files in a form that kuafu reads: what is wrong with one is wrong with the caller's file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import kuafu


def load_copy(scene: kuafu.Scene, copy: Path, path: str | Path, time_s: float | None = None) -> None:
    """Adds the copy of the file at `path` to the scene, at that time of its animations, seconds. Raises what Scene.load
    raises, with the name of the caller's file in the place of the copy's."""
    import kuafu

    try:
        scene.load(copy, time_s=time_s)
    except kuafu.Error as error:
        renamed = type(error)(str(error).replace(str(copy), str(path)))
        vars(renamed).update(vars(error))  # its status
        raise renamed from error
