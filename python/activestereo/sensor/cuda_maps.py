# SPDX-License-Identifier: Apache-2.0
"""The depth engine's maps in memory that CUDA sees too."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

import simsense
from activestereo.camera.config_limits import DEPTH_MAPS
from activestereo.sensor.cuda_memory import CudaArray, CudaMemory

# get_cuda()'s names: the depth engine's or kuafu's by them.
_OF_EVERY_SENSOR = ("disparity", "ir_left", "ir_right")
MAPS = {"depth": "depth_rgb"} | {name: name for name in (*_OF_EVERY_SENSOR, *DEPTH_MAPS)}
PICTURES = {
    "rgba8": "srgb",
    "radiance": "radiance",
    "true_depth": "depth",
    "instance_ids": "instance_id",
    "material_ids": "material_id",
}


@dataclass(frozen=True)
class CudaMap:
    """One map: the image that the engine writes, and CUDA's view of its memory."""

    image: simsense.Image
    memory: CudaMemory

    def array(self, shape: tuple[int, ...]) -> CudaArray:
        """The map as an array of another shape with as many elements."""
        assert math.prod(shape) == math.prod(self.image.shape)
        return self.memory.array(self.image.dtype, shape)

    def read(self) -> NDArray[Any]:
        """A copy in host memory."""
        return self.image.buffer.read().view(self.image.dtype).reshape(self.image.shape)


class CudaMaps:
    """Memory of each map; every picture overwrites it."""

    def __init__(self, device: simsense.Device) -> None:
        self._device = device
        self._maps: dict[str, CudaMap] = {}

    def compute(self, names: Iterable[str], match: Callable[[Any], Mapping[str, NDArray[Any]]]) -> dict[str, CudaMap]:
        """Computes the named maps of the last picture. match: computes maps into new arrays if it gets names, else into
        {name: simsense.Image}. The first arrays of a map tell its type and shape. Raises CudaError without CUDA, or if
        this GPU lacks it."""
        names = list(names)
        new = [name for name in names if name not in self._maps]
        for name, like in match(new).items() if new else ():
            self._maps[name] = self._made(like)
        found = {name: self._maps[name] for name in names}
        match({name: one.image for name, one in found.items()})
        return found

    def _made(self, like: NDArray[Any]) -> CudaMap:
        is_host = self._device.info.kind in ("cpu", "host")
        buffer = simsense.Buffer(self._device, like.nbytes, exportable=True, host_visible=is_host)
        return CudaMap(buffer.image(like.dtype, like.shape), CudaMemory(buffer))
