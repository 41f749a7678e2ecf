# SPDX-License-Identifier: Apache-2.0
"""Values at some of an image's pixels, remembered by which pixels they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def once_of_picked(known: list[tuple[np.ndarray, Any]], pick: np.ndarray, make: Callable[[], Any]) -> Any:
    """make(), computed the first time that these pixels are asked for. known: what was made so far, is extended."""
    for before, value in known:
        if before is pick or np.array_equal(before, pick):
            return value
    known.append((pick, make()))
    return known[-1][1]
