# SPDX-License-Identifier: Apache-2.0
"""Computes the depth engine's maps of the present pictures, for the host or for CUDA."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod
from typing import Any

from numpy.typing import NDArray

from activestereo.sensor.cuda_memory import CudaArray, CudaMaps


class Maps:
    """Computes and caches the maps (depth, disparity, measured infrared images, ...) of the current pictures of a
    SensorEngine. begin() computes those read for earlier pictures; others are computed when first read.

    on_cuda: maps lie in memory that CUDA can access, and the host copies them from there. The first computation raises
    CudaError without CUDA on this GPU."""

    def __init__(self, engine: Any, on_cuda: bool = False) -> None:
        self._engine, self.on_cuda = engine, on_cuda
        self._cuda_maps = CudaMaps(engine.matcher.device) if on_cuda else None
        self._wanted = ["depth_rgb"]
        self._found: dict[str, Any] = {}
        self._has_begun = False

    def clear(self) -> None:
        """Forgets all maps, because the pictures are new."""
        self._found, self._has_begun = {}, False

    def begin(self, names: Iterable[str] = ()) -> None:
        """Forgets all maps, then computes the named ones and those that were read for earlier pictures."""
        self.clear()
        self._found = dict(self._compute(list(dict.fromkeys((*self._wanted, *names)))))
        self._has_begun = True

    def complete(self) -> None:
        """Computes the maps of a matched picture that are not cached yet. Call it before the depth engine's parameters
        change, so that all maps of a picture have the same ones."""
        names = ("disparity", "ir_left", "ir_right", *self._engine.plan.config.depth_maps)
        missing = [name for name in names if name not in self._found]
        if self._has_begun and missing:
            self._found |= self._compute(missing)

    def read(self, name: str) -> NDArray[Any]:
        """Returns one map of the depth engine, [*shape, height, width, ...], in host memory."""
        found = self._one(name)
        if not self.on_cuda:
            return found
        image, _ = found
        return image.buffer.read().view(image.dtype).reshape(self._shape_of(image))

    def cuda(self, name: str) -> CudaArray:
        """Returns one map in CUDA memory, [*shape, height, width, ...]."""
        image, memory = self._one(name)
        return memory.array(image.dtype, self._shape_of(image))

    def _one(self, name: str) -> Any:
        if not self._has_begun:
            raise RuntimeError("no depth of this picture yet: call compute_depth() after take_picture()")
        if name not in self._found:
            self._found |= self._compute([name])
        if name not in self._wanted:
            self._wanted.append(name)
        return self._found[name]

    def _compute(self, names: list[str]) -> Mapping[str, Any]:
        if self._cuda_maps is not None:
            return self._cuda_maps.compute(names, self._engine.compute)
        return {name: image.reshape(self._shape_of(image)) for name, image in self._engine.compute(names).items()}

    def _shape_of(self, image: Any) -> tuple[int, ...]:
        """Returns the shape of a map for the caller, [*shape, height, width, ...]. image: the depth engine's map,
        [sensors, height, width, ...], or without the first axis for one sensor."""
        return (*self._engine.shape, *image.shape[1 if prod(self._engine.shape) > 1 else 0 :])
