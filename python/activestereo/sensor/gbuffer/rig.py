# SPDX-License-Identifier: Apache-2.0
"""Places of the projector and the right camera beside the left one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.pose import PoseLike, camera_to_camera

# A view may stand so far beside the row, or be turned so far, and still be warped along rows.
_ASIDE_M, _TURNED_RAD = 5e-3, 0.02


def require_row(here: PoseLike, there: PoseLike, what: str) -> None:
    """Raises ValueError if a camera's rows are not aligned with those of the camera `here`."""
    place = np.linalg.inv(camera_to_camera(here, there))
    turned = float(np.arccos(np.clip((np.trace(place[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))
    x, y, z = place[:3, 3].tolist()
    if turned > _TURNED_RAD or max(abs(y), abs(z)) > _ASIDE_M:
        text = f"{what} stands at {np.round([x, y, z], 4).tolist()} m, turned by {turned:.3f} rad, from the left camera"
        raise ValueError(f"{text}: G-buffers are warped along rows, which it has to share")


def inverse_depth(depth: NDArray[Any]) -> NDArray[np.float64]:
    """1 / depth, 0 for no surface. Raises ValueError for invalid depth."""
    if not ((depth >= 0.0) | np.isposinf(depth)).all():
        raise ValueError(f"a depth is {float(np.nanmin(depth)):g} m or no number, expected depths of 0 or more")
    with np.errstate(divide="ignore", over="ignore"):
        inverse = 1.0 / np.asarray(depth, np.float64)
    return np.where(np.isinf(inverse), 0.0, inverse)
