# SPDX-License-Identifier: Apache-2.0
"""A camera's images, which stay in the renderer's memory until somebody reads one. A picture that nobody reads costs no
copy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

import kuafu
from activestereo.sensor.cuda_memory import CudaArray, CudaMemory

# dtype and channels of an RGB picture's outputs
RGB_OUTPUTS = {
    "radiance": (np.float32, 3),
    "srgb": (np.uint8, 4),
    "depth": (np.float32, 1),
    "material_id": (np.uint32, 1),
    "instance_id": (np.uint32, 1),
}


class PictureMemory:
    """Images [count, height, width, channels] of several outputs; each picture overwrites the last. After an output is
    read once, a GPU writes it directly to host memory, which saves a copy. `radiance` stays on the GPU, which reads it
    itself.

    outputs: {kuafu's name: (dtype, channels)}. host_visible: None = no on a GPU. on_cuda: CUDA sees the memory, too;
    raises CudaError without CUDA on this GPU.
    """

    def __init__(
        self,
        device: kuafu.Device,
        shape: tuple[int, int, int],
        outputs: Mapping[str, tuple[DTypeLike, int]],
        host_visible: bool | None = None,
        on_cuda: bool = False,
    ) -> None:
        is_host = device.info.kind in ("cpu", "host") if host_visible is None else host_visible
        self._device = device
        self.targets: dict[str, kuafu.Image] = {}
        for name, (dtype, channels) in outputs.items():
            full = (*shape, channels)
            size_bytes = int(np.prod(full)) * np.dtype(dtype).itemsize
            self.targets[name] = kuafu.Buffer(device, size_bytes, host_visible=is_host, exportable=on_cuda).image(
                dtype, full
            )
        shared = self.targets if on_cuda else {}
        self._cuda = {name: CudaMemory(image.buffer) for name, image in shared.items()}
        self._on_device = set() if is_host or on_cuda else set(outputs) - {"radiance"}
        self._read: dict[str, NDArray[Any]] = {}

    def forget(self) -> None:
        """Forgets the last picture's outputs, before a render into `targets`."""
        for name in self._on_device & self._read.keys():
            image = self.targets[name]
            self.targets[name] = kuafu.Buffer(self._device, image.buffer.size_bytes).image(image.dtype, image.shape)
            self._on_device.remove(name)
        self._read = {}

    def read(self, name: str) -> NDArray[Any]:
        """One output of the last picture; a copy, the same one until forget()."""
        if name not in self._read:
            image = self.targets[name]
            self._read[name] = image.buffer.read().view(image.dtype).reshape(image.shape)
        return self._read[name]

    def cuda(self, name: str, shape: tuple[int, ...]) -> CudaArray:
        """One output of the last picture in this shape, in the memory that it was rendered into. No copy; the next
        picture overwrites it."""
        return self._cuda[name].array(self.targets[name].dtype, shape)
