# SPDX-License-Identifier: Apache-2.0
"""The methods that find poses, the settings for tuning them, and their results in a picture."""

from __future__ import annotations

from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_to_real.clouds import Cloud, cloud
from sim_to_real.icp import Icp
from sim_to_real.objects import BenchmarkObject, objects, surface
from sim_to_real.pose_error import pose_error
from sim_to_real.ppf import Ppf
from sim_to_real.template import Template
from sim_to_real.views import View

_MODEL_POINTS = 3000
METHODS: dict[str, Any] = {"ICP": Icp, "PPF": Ppf, "template": Template}


class Finder(Protocol):
    def find(self, cloud: Cloud, start: NDArray[np.float64]) -> NDArray[np.float64] | None: ...


@cache
def finder(object_index: int, method: str, setting: int) -> Finder:
    """A method that knows an object, with setting number `setting` of its SETTINGS."""
    kind = METHODS[method]
    own: Finder = kind(surface(objects()[object_index].mesh, _MODEL_POINTS), kind.SETTINGS[setting])
    return own


def errors_of_round(
    things: tuple[BenchmarkObject, ...],
    views: list[View],
    depths: NDArray[np.float32],
    k: NDArray[np.float64],
    candidates: list[tuple[str, int]],
) -> NDArray[np.float64]:
    """[candidates, views, 2], mm and degrees. candidates: (method, number of its setting)."""
    out = np.empty((len(candidates), len(views), 2))
    for column, (view, depth) in enumerate(zip(views, depths, strict=True)):
        seen = cloud(depth, k, view.camera_to_world, view.start[:3, 3])
        for row, (method, setting) in enumerate(candidates):
            found = finder(view.object_index, method, setting).find(seen, view.start)
            out[row, column] = pose_error(found, view.object_to_world, things[view.object_index])
    return out
