# SPDX-License-Identifier: Apache-2.0
"""The depth engine's maps in memory that CUDA sees too."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from numpy.typing import NDArray

import simsense
from activestereo.cuda_memory import CudaArray, CudaMemory


class CudaMaps:
    """One memory for each map, which the next picture's is written into."""

    def __init__(self, device: simsense.Device) -> None:
        self._device = device
        self._targets: dict[str, simsense.Image] = {}
        self._memories: dict[str, CudaMemory] = {}

    def missing(self, names: Iterable[str]) -> list[str]:
        """Those of the names that have no memory yet."""
        return [name for name in names if name not in self._targets]

    def make(self, name: str, like: NDArray[Any]) -> None:
        """Memory for a map of this type and shape. CudaError where there is no CUDA, or none on this GPU."""
        is_host = self._device.info.kind in ("cpu", "host")
        buffer = simsense.Buffer(self._device, like.nbytes, exportable=True, host_visible=is_host)
        self._memories[name] = CudaMemory(buffer)
        self._targets[name] = buffer.image(like.dtype, like.shape)

    def targets(self, names: Iterable[str]) -> dict[str, simsense.Image]:
        """What the engine writes."""
        return {name: self._targets[name] for name in names}

    def array(self, name: str, shape: tuple[int, ...]) -> CudaArray:
        """The map as an array of this shape, of the same number of elements."""
        target = self._targets[name]
        assert math.prod(shape) == math.prod(target.shape)
        return self._memories[name].array(target.dtype, shape)
