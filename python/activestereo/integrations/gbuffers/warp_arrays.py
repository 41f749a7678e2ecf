# SPDX-License-Identifier: Apache-2.0
"""Converts Warp's arrays to those that GBufferStereo takes."""

from __future__ import annotations

from typing import Any

import warp as wp


def as_array(values: wp.array) -> Any:
    """Returns the memory of a Warp array without a copy: a NumPy array on a CPU, a torch tensor on CUDA."""
    return values.numpy() if values.device.is_cpu else wp.to_torch(values)
