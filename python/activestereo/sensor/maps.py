# SPDX-License-Identifier: Apache-2.0
"""Computes the depth engine's maps of the present pictures, for the host or for CUDA. Reuses the arrays of results that
nobody holds any more: the kernel clears every page of new memory, which costs more than writing the results."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterable, Mapping, Sequence
from math import prod
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.camera.plan import SensorPlan
from activestereo.sensor.cuda_memory import CudaArray, CudaMap, CudaMaps

_MOST_FREE = 2  # free arrays kept for a result, as the caller holds one during the next computation


class _Lent:
    """Marks memory as in use by a caller. Arrays over the memory keep it alive; when the last one goes, the memory may
    be used again."""

    def __init__(self, memory: NDArray[Any]) -> None:
        self.__array_interface__ = memory.__array_interface__


def _give_back(free: list[NDArray[Any]], memory: NDArray[Any]) -> None:
    if len(free) < _MOST_FREE:
        free.append(memory)


class JoinedResults:
    """Holds one array for each map, into which several devices write the parts for their environments. counts:
    environments in each part. Parts may reserve theirs, and arrays may be released, in any thread."""

    def __init__(self, counts: Sequence[int]) -> None:
        ends = np.cumsum(counts).tolist()
        self._count: int = ends[-1]
        self._own = [slice(end - count, end) for end, count in zip(ends, counts, strict=True)]
        self._kinds: dict[str, tuple[tuple[int, ...], np.dtype[Any]]] = {}  # shape and type of one environment's result
        self._free: dict[str, list[NDArray[Any]]] = {}
        self._whole: dict[str, NDArray[Any]] = {}
        self._taken: set[tuple[str, int]] = set()  # names and parts
        self._lock = threading.Lock()

    def begin(self) -> None:
        """Forgets the last picture's arrays, so that the next picture's maps get new memory."""
        self._whole, self._taken = {}, set()

    def learn(self, found: Mapping[str, NDArray[Any]]) -> None:
        """Notes the shape and type of each map in `found`, one part's {name: array [environments, ...]}, for
        reserve()."""
        with self._lock:
            self._kinds |= {name: (image.shape[1:], image.dtype) for name, image in found.items()}

    def reserve(self, part: int, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        """Returns {name: slice for this part of the map's array}, to be written into. Returns {} if learn() has not
        seen one of the maps. The memory is used again once neither an array nor a view of it lives."""
        own = {(name, part) for name in names}
        with self._lock:
            if any(name not in self._kinds for name, _ in own):
                return {}
            for name, _ in own:
                if name in self._whole and (name, part) not in self._taken:
                    continue
                free, (shape, dtype) = self._free.setdefault(name, []), self._kinds[name]
                memory = free.pop() if free else np.empty((self._count, *shape), dtype)
                lent = _Lent(memory)
                weakref.finalize(lent, _give_back, free, memory).atexit = False
                self._whole[name] = np.asarray(lent)
                self._taken = {one for one in self._taken if one[0] != name}
            self._taken |= own
            return {name: self._whole[name][self._own[part]] for name, _ in own}


class ComputesMaps(Protocol):
    """The attributes of a SensorEngine that Maps uses. compute() returns the named maps or fills given arrays."""

    plan: SensorPlan
    matcher: simsense.Engine
    shape: tuple[int, ...]

    def compute(self, outputs: Any) -> Mapping[str, NDArray[Any]]: ...


class Maps:
    """Computes and caches the maps (depth, disparity, measured infrared images, ...) of the current pictures. Those
    that were read for earlier pictures are computed together; others when they are first read.

    on_cuda: maps lie in memory that CUDA sees, and the host reads them from there. The first computation raises
    CudaError without CUDA on this GPU. results: memory for maps, and number of this engine's part; None: new arrays."""

    def __init__(
        self, engine: ComputesMaps, on_cuda: bool = False, results: tuple[JoinedResults, int] | None = None
    ) -> None:
        self._engine, self._results, self.on_cuda = engine, results, on_cuda
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
        names = ("disparity", "ir_left", "ir_right", *self._engine.plan.depth_maps)
        missing = [name for name in names if name not in self._found]
        if self._has_begun and missing:
            self._found |= self._compute(missing)

    def read(self, name: str) -> NDArray[Any]:
        """Returns one map of the depth engine, [*shape, height, width, ...], in host memory."""
        found = self._one(name)
        return found.read().reshape(self._shape_of(found.image)) if isinstance(found, CudaMap) else found

    def cuda(self, name: str) -> CudaArray:
        """Returns one map in CUDA memory, [*shape, height, width, ...]."""
        found = self._one(name)
        return found.array(self._shape_of(found.image))

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
        taken = {} if self._results is None else self._results[0].reserve(self._results[1], names)
        if taken:
            leading = len(self._engine.shape)
            self._engine.compute({name: image.reshape(-1, *image.shape[leading:]) for name, image in taken.items()})
            return taken
        found = {name: image.reshape(self._shape_of(image)) for name, image in self._engine.compute(names).items()}
        if self._results is not None:
            self._results[0].learn(found)
        return found

    def _shape_of(self, image: Any) -> tuple[int, ...]:
        """Returns the shape of a map for the caller, [*shape, height, width, ...]. image: the depth engine's map,
        [sensors, height, width, ...], or without the first axis for one sensor."""
        return (*self._engine.shape, *image.shape[1 if prod(self._engine.shape) > 1 else 0 :])
