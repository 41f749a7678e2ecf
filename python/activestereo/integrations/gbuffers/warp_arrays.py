# SPDX-License-Identifier: Apache-2.0
"""Arrays of Warp as GBufferStereo takes them."""

from __future__ import annotations

from typing import Any

import warp as wp


def as_array(values: wp.array) -> Any:
    """A view without a copy: NumPy's on a processor, torch's on CUDA."""
    return values.numpy() if values.device.is_cpu else wp.to_torch(values)
