# SPDX-License-Identifier: Apache-2.0
"""CUDA memory as torch's tensors. Raises RuntimeError if torch or CUDA is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.sensor.cuda_memory import CudaArray

if TYPE_CHECKING:
    import torch


def cuda_tensor(array: CudaArray) -> torch.Tensor:
    """Returns a torch tensor of the same memory. Call wait_for() on torch's work with it before the engines write
    again."""
    return _torch().as_tensor(array, device=f"cuda:{array.ordinal}")


def copied_to_cuda(array: NDArray[Any]) -> torch.Tensor:
    """A copy of a host's array on torch's current CUDA device."""
    return _torch().from_numpy(np.ascontiguousarray(array)).cuda()


def wait_for(tensor: torch.Tensor) -> torch.Tensor:
    """Waits for torch's work on the tensor's device, then returns the tensor."""
    if tensor.is_cuda:
        _torch().cuda.current_stream(tensor.device).synchronize()
    return tensor


def require_no_capture() -> None:
    """Raises RuntimeError while torch captures a CUDA graph."""
    if _torch().cuda.is_current_stream_capturing():
        raise RuntimeError(
            "a CUDA graph is being captured, and it would not hold what Vulkan allocates and computes here: call the"
            " sensor before or after the graph's replay"
        )


def _torch() -> Any:
    try:
        import torch
    except ImportError as error:
        raise RuntimeError("arrays on CUDA need torch (pip install torch); the host's is get_...()") from error
    if not torch.cuda.is_available():
        raise RuntimeError("torch sees no CUDA device here: read the host's array, get_...() without _cuda")
    return torch
