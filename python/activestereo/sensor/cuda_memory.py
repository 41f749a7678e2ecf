# SPDX-License-Identifier: Apache-2.0
"""Maps GPU memory that kuafu or simsense exports into CUDA, so that PyTorch, CuPy and Numba use the same bytes.

    memory = CudaMemory(kuafu.Buffer(device, 4 * 480 * 640, exportable=True, host_visible=False))
    tensor = torch.as_tensor(memory.array("float32", (480, 640)), device="cuda")

The CUDA driver is loaded when a CudaMemory is made. Names and numbers are those of NVIDIA's CUDA Driver API, section
"External Resource Interoperability". Vulkan or CUDA must finish writing before the other reads: Renderer.render()
finishes before it returns; call torch.cuda.synchronize() for torch."""

from __future__ import annotations

import ctypes as c
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

import simsense
from activestereo.camera.config_limits import DEPTH_MAPS
from activestereo.common.optional import imported

_OPAQUE_FD, _DEDICATED = 1, 1


class CudaError(RuntimeError):
    """CUDA is absent or refused a call; the text states the call and the reason."""


class _HandleDesc(c.Structure):
    _fields_ = [
        ("type", c.c_int),
        ("handle", c.c_uint64 * 2),  # a union; the file descriptor is its first int
        ("size", c.c_uint64),
        ("flags", c.c_uint),
        ("reserved", c.c_uint * 16),
    ]


class _BufferDesc(c.Structure):
    _fields_ = [("offset", c.c_uint64), ("size", c.c_uint64), ("flags", c.c_uint), ("reserved", c.c_uint * 16)]


class _Driver:
    def __init__(self, library: str) -> None:
        try:
            self._library = c.CDLL(library)
        except OSError as error:
            raise CudaError(f"there is no CUDA driver: {error}") from None
        self.call("cuInit", c.c_uint(0))

    def call(self, name: str, *arguments: Any) -> None:
        status = getattr(self._library, name)(*arguments)
        if status != 0:
            text = c.c_char_p()
            self._library.cuGetErrorString(status, c.byref(text))
            raise CudaError(f"{name} failed with {status} ({(text.value or b'unknown').decode()})")

    def device_of(self, uuid: bytes) -> tuple[int, int]:
        """Returns (number, handle) of the CUDA device with this Vulkan UUID."""
        count = c.c_int()
        self.call("cuDeviceGetCount", c.byref(count))
        for ordinal in range(count.value):
            device, own = c.c_int(), (c.c_uint8 * 16)()
            self.call("cuDeviceGet", c.byref(device), ordinal)
            self.call("cuDeviceGetUuid", own, device)
            if bytes(own) == uuid:
                return ordinal, device.value
        raise CudaError(f"none of the {count.value} CUDA devices is the one that the buffer is on")


class CudaMemory:
    """Maps an exportable Buffer into the primary CUDA context of its GPU, and keeps the buffer alive. close() removes
    the mapping; so does the deletion of this object and of its arrays. Raises CudaError."""

    def __init__(self, buffer: Any, *, library: str = "libcuda.so.1") -> None:
        """buffer: a kuafu.Buffer or simsense.Buffer made with exportable=True. library: the file of CUDA's driver."""
        self._buffer = buffer
        self._external, self._address = c.c_void_p(), c.c_uint64()
        self._context: c.c_void_p | None = None  # retained
        self._driver = _Driver(library)
        with buffer.export("opaque_fd") as desc:
            self.ordinal, self._device = self._driver.device_of(desc.device_uuid)
            self.size_bytes: int = desc.size_bytes
            context = c.c_void_p()
            self._driver.call("cuDevicePrimaryCtxRetain", c.byref(context), self._device)
            self._context = context
            handle = _HandleDesc(type=_OPAQUE_FD, size=desc.allocation_bytes, flags=_DEDICATED if desc.dedicated else 0)
            part = _BufferDesc(offset=desc.offset_bytes, size=desc.size_bytes)
            try:
                with self._in_context():
                    handle.handle[0] = fd = os.dup(desc.handle)  # CUDA owns it after success
                    try:
                        self._driver.call("cuImportExternalMemory", c.byref(self._external), c.byref(handle))
                    except CudaError:
                        os.close(fd)
                        raise
                    into = c.byref(self._address)
                    self._driver.call("cuExternalMemoryGetMappedBuffer", into, self._external, c.byref(part))
            except CudaError:
                self.close()
                raise
        self.address: int = self._address.value  # CUdeviceptr of the buffer's first byte

    @contextmanager
    def _in_context(self) -> Iterator[None]:
        """Makes the GPU's primary context current, which PyTorch and CuPy use, too."""
        self._driver.call("cuCtxPushCurrent_v2", self._context)
        try:
            yield
        finally:
            self._driver.call("cuCtxPopCurrent_v2", c.byref(c.c_void_p()))

    def close(self) -> None:
        """Releases the mapping. Arrays of it must not be used afterwards."""
        if self._context is None:
            return
        try:
            with self._in_context():
                if self._address.value:
                    self._driver.call("cuMemFree_v2", self._address)
                if self._external.value:
                    self._driver.call("cuDestroyExternalMemory", self._external)
            self._driver.call("cuDevicePrimaryCtxRelease_v2", self._device)
        finally:
            self._context = None

    __del__ = close

    def array(self, dtype: DTypeLike, shape: Sequence[int], offset_bytes: int = 0) -> CudaArray:
        """Returns a contiguous array over the memory, for torch.as_tensor(..., device="cuda"), cupy.asarray() and
        numba.cuda.as_cuda_array(). Raises ValueError if the array is empty or exceeds the buffer."""
        kind = np.dtype(dtype)
        needed = prod(shape) * kind.itemsize
        if offset_bytes < 0 or min(shape, default=1) < 1 or needed > self.size_bytes - offset_bytes:
            text = f"{tuple(shape)} of {kind} at {offset_bytes} needs {needed} bytes, the buffer has {self.size_bytes}"
            raise ValueError(text)
        return CudaArray(self, kind, tuple(shape), self.address + offset_bytes)


class CudaArray:
    """An array in CUDA memory that offers the CUDA array interface, version 3."""

    def __init__(self, memory: CudaMemory, dtype: np.dtype[Any], shape: tuple[int, ...], address: int) -> None:
        self._memory = memory
        self.ordinal = memory.ordinal  # CUDA's number of the GPU
        self.__cuda_array_interface__: dict[str, Any] = {
            "shape": shape,
            "typestr": dtype.str,
            "data": (address, False),
            "strides": None,
            "stream": None,
            "version": 3,
        }


if TYPE_CHECKING:
    import torch


def cuda_tensor(array: CudaArray) -> torch.Tensor:
    """Returns a torch tensor over the array's memory. Call wait_for() after torch's work with it, before the next
    picture or depth overwrites the memory."""
    return _torch().as_tensor(array, device=f"cuda:{array.ordinal}")


def copied_to_cuda(array: NDArray[Any]) -> torch.Tensor:
    """Returns a copy of a host array on torch's current CUDA device."""
    return _torch().from_numpy(np.ascontiguousarray(array)).cuda()


def wait_for(tensor: torch.Tensor) -> torch.Tensor:
    """Waits for torch's work on the tensor's device, then returns the tensor."""
    if tensor.is_cuda:
        _torch().cuda.current_stream(tensor.device).synchronize()
    return tensor


def require_no_capture() -> None:
    """Raises RuntimeError while torch captures a CUDA graph, because the graph would not record Vulkan's work."""
    if _torch().cuda.is_current_stream_capturing():
        raise RuntimeError(
            "a CUDA graph is being captured, and it would not hold what Vulkan allocates and computes here: call the"
            " sensor before or after the graph's replay"
        )


def _torch() -> Any:
    needed = "arrays on CUDA need torch (pip install torch); the host's is get_...()"
    torch = imported("torch", needed, RuntimeError)
    if not torch.cuda.is_available():
        raise RuntimeError("torch sees no CUDA device here: read the host's array, get_...() without _cuda")
    return torch


# MAPS: {name that get_cuda() takes: map of the depth engine}. PICTURES: {such a name: output of kuafu}.
_OF_EVERY_SENSOR = ("disparity", "ir_left", "ir_right")
MAPS = {"depth": "depth_rgb"} | {name: name for name in (*_OF_EVERY_SENSOR, *DEPTH_MAPS)}
PICTURES = {
    "rgba8": "srgb",
    "radiance": "radiance",
    "true_depth": "depth",
    "instance_ids": "instance_id",
    "material_ids": "material_id",
}


CudaMap = tuple[simsense.Image, CudaMemory]  # the image that the engine writes, and the same memory in CUDA


class CudaMaps:
    """Computes the depth engine's maps into CUDA memory: one allocation for each map, which every picture
    overwrites."""

    def __init__(self, device: simsense.Device) -> None:
        self._device = device
        self._maps: dict[str, CudaMap] = {}

    def compute(self, names: Iterable[str], match: Callable[[Any], Mapping[str, NDArray[Any]]]) -> dict[str, CudaMap]:
        """Computes the named maps of the last picture. match(names) returns new arrays, whose type and shape set a
        map's memory; match({name: simsense.Image}) writes into those images. Raises CudaError without CUDA, or if this
        GPU lacks it."""
        names = list(names)
        new = [name for name in names if name not in self._maps]
        is_host = self._device.info.kind in ("cpu", "host")
        for name, like in match(new).items() if new else ():
            buffer = simsense.Buffer(self._device, like.nbytes, exportable=True, host_visible=is_host)
            self._maps[name] = buffer.image(like.dtype, like.shape), CudaMemory(buffer)
        found = {name: self._maps[name] for name in names}
        match({name: image for name, (image, _) in found.items()})
        return found
