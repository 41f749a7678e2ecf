# SPDX-License-Identifier: Apache-2.0
"""The depth engine's maps of the present pictures, for the host or for CUDA."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod
from typing import Any, Protocol

from numpy.typing import NDArray

import simsense
from activestereo.camera.plan import SensorPlan
from activestereo.sensor.cuda_memory import CudaArray, CudaMap, CudaMaps
from activestereo.sensor.result_memory import Kind, PartOfResults


class ComputesMaps(Protocol):
    """A SensorEngine."""

    plan: SensorPlan
    matcher: simsense.Engine
    shape: tuple[int, ...]

    def compute(self, outputs: Any) -> Mapping[str, NDArray[Any]]: ...


class Maps:
    """Computes maps that were read of earlier pictures together, others when first read.

    on_cuda: maps lie in memory that CUDA sees, and the host reads them from there. The first computation raises
    CudaError without CUDA on this GPU. results: memory for maps, None for new arrays."""

    def __init__(self, engine: ComputesMaps, on_cuda: bool = False, results: PartOfResults | None = None) -> None:
        self._engine, self._results = engine, results
        self._on_cuda = CudaMaps(engine.matcher.device) if on_cuda else None
        self._wanted = ["depth_rgb"]
        self._found: dict[str, Any] = {}
        self._has_begun = False

    @property
    def on_cuda(self) -> bool:
        return self._on_cuda is not None

    def clear(self) -> None:
        """Forgets all maps, because the pictures are new."""
        self._found, self._has_begun = {}, False

    def begin(self, names: Iterable[str] = ()) -> None:
        """Computes these maps and those that were read of earlier pictures."""
        self.clear()
        self._found = dict(self._compute(list(dict.fromkeys((*self._wanted, *names)))))
        self._has_begun = True

    def complete(self) -> None:
        """Computes all maps of matched pictures, before the engine changes: one engine makes all maps of a picture."""
        names = ("disparity", "ir_left", "ir_right", *self._engine.plan.depth_maps)
        missing = [name for name in names if name not in self._found]
        if self._has_begun and missing:
            self._found |= self._compute(missing)

    def read(self, name: str) -> NDArray[Any]:
        """One map of the depth engine, [*shape, height, width, ...]."""
        found = self._one(name)
        return found.read().reshape(self._shape_of(found.image)) if isinstance(found, CudaMap) else found

    def cuda(self, name: str) -> CudaArray:
        """The map in CUDA memory."""
        found = self._one(name)
        return found.array(self._shape_of(found.image))

    def values(self) -> list[Any]:
        """The maps computed so far."""
        return list(self._found.values())

    def _one(self, name: str) -> Any:
        if not self._has_begun:
            raise RuntimeError("no depth of this picture yet: call compute_depth() after take_picture()")
        if name not in self._found:
            self._found |= self._compute([name])
        if name not in self._wanted:
            self._wanted.append(name)
        return self._found[name]

    def _compute(self, names: list[str]) -> Mapping[str, Any]:
        if self._on_cuda is not None:
            return self._on_cuda.compute(names, self._engine.compute)
        taken = {} if self._results is None else self._results.reserve(names)
        if taken:
            leading = len(self._engine.shape)
            self._engine.compute({name: image.reshape(-1, *image.shape[leading:]) for name, image in taken.items()})
            return taken
        found = {name: image.reshape(self._shape_of(image)) for name, image in self._engine.compute(names).items()}
        if self._results is not None:
            self._results.learn({name: Kind(image.shape[1:], image.dtype) for name, image in found.items()})
        return found

    def _shape_of(self, image: Any) -> tuple[int, ...]:
        """The shape of one sensor's map, or of several with their number in front."""
        return (*self._engine.shape, *image.shape[1 if prod(self._engine.shape) > 1 else 0 :])
