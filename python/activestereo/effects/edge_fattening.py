# SPDX-License-Identifier: Apache-2.0
"""Simulates near objects that grow in the disparity image."""

import numpy as np
from scipy.ndimage import maximum_filter

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.view import View


@effect(
    "edge_fattening",
    stage=Stage.DISPARITY,
    family="matcher",
    finding="Near things grow at their edges in the device's depth",
    source="Scharstein and Szeliski 2002, A taxonomy: foreground fattening by half a window",
    parameters=[Parameter("radius_px", "px", neutral=0.0, low=0.0, high=8.0, typical=1.0)],
    image_only="the matcher's window fattens edges itself; simsense has no field for a device's additional fattening",
)
def edge_fattening(disparity: np.ndarray, view: View, radius_px: float) -> np.ndarray:
    """Next to a depth edge the far side takes the near side's disparity, over radius_px; pixels without a match stay
    so."""
    whole = int(radius_px)
    share = radius_px - whole
    grown = [disparity if r == 0 else maximum_filter(disparity, size=2 * r + 1) for r in (whole, whole + (share > 0))]
    return np.where(disparity > 0, (1.0 - share) * grown[0] + share * grown[1], 0.0)
