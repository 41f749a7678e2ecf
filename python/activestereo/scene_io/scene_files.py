# SPDX-License-Identifier: Apache-2.0
"""Scene files of every kind: kuafu reads them itself, or usd-core, where it is installed, converts them first."""

from __future__ import annotations

import os
from os import PathLike
from typing import TYPE_CHECKING

from activestereo.scene_io.gltf_document import scale
from activestereo.scene_io.usd import is_usd, load_usd

if TYPE_CHECKING:
    import kuafu


def load_scene_file(
    scene: kuafu.Scene, path: str | PathLike[str], time_s: float | None = None, unit_m: float = 1.0
) -> tuple[float, float, float] | None:
    """Adds a scene file to the scene, at that time of its animations, seconds. unit_m: metres of what the file takes
    for a metre, such as 0.001 for a file in millimetres.

    Returns the radiance of a USD stage's dome light, W/(sr m^2), or None where there is none: it is the caller's to
    set. Raises UsdError, a ValueError of one line that names the file and what to do, and what Scene.load raises.
    """
    if is_usd(path):
        return load_usd(scene, path, time_s, unit_m).ambient
    scene.load(path, scale(unit_m), time_s=time_s)
    return None


def keep_transparent() -> None:
    """Lets materials of opacity 0 stay unseen, in every file that this process and those that it starts load."""
    os.environ["KUAFU_LOAD_TRANSPARENT"] = "1"
