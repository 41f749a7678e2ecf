# SPDX-License-Identifier: Apache-2.0
"""Scene files whose unit is not the metre."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def scale(unit_m: float) -> NDArray[np.float64]:
    """4x4 from a file's unit to metres."""
    return np.diag([unit_m, unit_m, unit_m, 1.0])


def size_hint(size_m: float) -> str:
    """The unit that a scene of an unlikely size may have been written in, or nothing."""
    if size_m > 50.0:
        return f"{size_m:.4g} m large: its file may be in millimetres, which --unit 0.001 says"
    if size_m < 2e-3:
        return f"{1e3 * size_m:.2g} mm large: its file may be in kilometres, which --unit 1000 says"
    return ""
