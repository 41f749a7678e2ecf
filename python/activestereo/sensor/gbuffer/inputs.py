# SPDX-License-Identifier: Apache-2.0
"""Moves a simulator's images into the renderer's memory: from NumPy, torch on the host or on CUDA, and DLPack."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.sensor.cuda_memory import CudaMemory
from activestereo.sensor.cuda_tensor import cuda_tensor, wait_for
from activestereo.sensor.gbuffer.materials import MaterialNumbers
from activestereo.sensor.ir_link import has_own_memory

_TYPES = {"depth": np.float32, "normal": np.float32, "albedo": np.float32, "material": np.uint32}
_FURTHEST_NEAR_M = 50.0  # no sensor of this kind measures there


def host_image(name: str, values: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """An array of this shape on the host; adds a missing axis for one environment. Raises ValueError for another shape,
    TypeError for anything but an array of numbers."""
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    elif hasattr(values, "__dlpack__") and not isinstance(values, np.ndarray):
        values = np.from_dlpack(values)
    image = np.asarray(values)
    if image.dtype.kind not in "fiub":
        raise TypeError(f"{name} is of {image.dtype}, expected numbers")
    return _checked_shape(name, image, shape)


def require_metres(name: str, depth: NDArray[Any]) -> None:
    """Raises ValueError for depth that can only be in millimetres: nothing is nearer than 50 m, and not all is one
    far plane."""
    there = depth[np.isfinite(depth) & (depth > 0)]
    if there.size and there.min() > _FURTHEST_NEAR_M and there.max() > 1.01 * there.min():
        raise ValueError(
            f"{name} begins at {there.min():g} m: is it in millimetres? Then give {name} / 1000; 0 and inf are nothing"
        )


def _checked_shape(name: str, image: Any, shape: tuple[int, ...]) -> Any:
    if shape[0] == 1 and tuple(image.shape) == shape[1:]:
        image = image[None]
    if tuple(image.shape) != shape:
        raise ValueError(f"{name} is {list(image.shape)}, expected {list(shape)}")
    return image


def red_of(name: str, image: Any, shape: tuple[int, ...]) -> Any:
    """The first channel of an image with three or four, a guess of the infrared."""
    is_rgb = image.ndim > 2 and image.shape[-1] in (3, 4) and tuple(image.shape[-3:-1]) == shape[1:]
    image = _checked_shape(name, image[..., 0] if is_rgb else image, shape)
    return image / 255.0 if str(image.dtype).endswith("uint8") else image


class InputImages:
    """Images of one camera, [E, height, width]; each one's memory is made when it is first given."""

    def __init__(self, device: kuafu.Device, shape: tuple[int, ...], materials: MaterialNumbers) -> None:
        self._device, self._shape, self._materials = device, shape, materials
        self._is_on_gpu = has_own_memory(device)
        self._buffers: dict[str, kuafu.Buffer] = {}
        self._seen_by_cuda: dict[str, Any] = {}

    def put(self, given: Mapping[str, Any]) -> dict[str, kuafu.Buffer]:
        """Copies the images that are not None to the memory that kuafu's light_gbuffers() reads."""
        return {name: self._taken(name, image) for name, image in given.items() if image is not None}

    def _taken(self, name: str, values: Any) -> kuafu.Buffer:
        shape = (*self._shape, 3) if name == "normal" else self._shape
        buffer = self._buffers.get(name)
        if buffer is None:
            size_bytes = 4 * int(np.prod(shape))
            buffer = kuafu.Buffer(
                self._device, size_bytes, exportable=self._is_on_gpu, host_visible=not self._is_on_gpu
            )
            self._buffers[name] = buffer
        if self._is_on_gpu and getattr(values, "is_cuda", False):
            self._copy_on_cuda(name, values, buffer, shape)
            return buffer
        if name == "albedo":
            image = red_of(name, np.asarray(_on_host(values)), self._shape)
        else:
            image = host_image(name, values, shape)
        if name == "material":
            image = self._materials.ids(image, unknown=0)  # no surface here, after require_known()
        if self._is_on_gpu:
            buffer.write(np.ascontiguousarray(image, _TYPES[name]))
        else:
            np.copyto(buffer.image(_TYPES[name], shape).array(), image, casting="unsafe")
        return buffer

    def _copy_on_cuda(self, name: str, values: Any, buffer: kuafu.Buffer, shape: tuple[int, ...]) -> None:
        if name not in self._seen_by_cuda:
            dtype = "int32" if name == "material" else "float32"  # torch has no arithmetic of uint32
            self._seen_by_cuda[name] = cuda_tensor(CudaMemory(buffer).array(dtype, shape))
        image = red_of(name, values, self._shape) if name == "albedo" else _checked_shape(name, values, shape)
        target = self._seen_by_cuda[name]
        target.copy_(self._materials.ids_of_tensor(image) if name == "material" else image)
        wait_for(target)


def _on_host(values: Any) -> Any:
    if hasattr(values, "detach"):
        return values.detach().cpu().numpy()
    return np.from_dlpack(values) if hasattr(values, "__dlpack__") and not isinstance(values, np.ndarray) else values
