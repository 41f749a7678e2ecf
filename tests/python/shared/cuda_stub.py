# SPDX-License-Identifier: Apache-2.0
"""A stub of CUDA's driver that maps the file behind lavapipe's descriptors: CUDA's memory, seen by the host."""

import ctypes as c
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import kuafu
from activestereo.sensor.cuda_memory import CudaArray, CudaMemory


def place_in_file(address: int) -> int:
    """Where in the mapped file an address lies."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        span, _, offset = line.split()[:3]
        start, end = (int(part, 16) for part in span.split("-"))
        if start <= address < end:
            return int(offset, 16) + address - start
    raise AssertionError(f"{address:x} is not mapped")


def exportable(module: ModuleType, device: Any) -> Any:
    if "export_opaque_fd" not in device.info.capabilities:
        pytest.skip(f"{device.info.name} exports no opaque fd")
    return module.Buffer(device, 4 * 6 * 5, exportable=True)


def stub_for(device: kuafu.Device, library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All CudaMemory of this device, a processor, is the stub's."""
    probe = exportable(kuafu, device)
    begin = place_in_file(probe.image("float32", (6, 5)).array().ctypes.data)
    c.CDLL(str(library)).stub_be(device.info.device_uuid, c.c_uint64(begin))
    monkeypatch.setitem(CudaMemory.__init__.__kwdefaults__, "library", str(library))


def seen_by_host(array: CudaArray) -> np.ndarray:
    """The stub's memory, no copy."""
    interface = array.__cuda_array_interface__
    kind = np.ctypeslib.as_ctypes_type(np.dtype(interface["typestr"]))
    return np.ctypeslib.as_array(c.cast(interface["data"][0], c.POINTER(kind)), interface["shape"])


def stub_for_torch(device: kuafu.Device, library: Path, monkeypatch: pytest.MonkeyPatch) -> list[CudaArray]:
    """stub_for(), and torch takes the stub's memory for its tensors; returns the list of what it took."""
    torch = pytest.importorskip("torch", reason="the package torch is not installed (pip install torch)")
    stub_for(device, library, monkeypatch)
    taken: list[CudaArray] = []

    def as_tensor(array: CudaArray, device: str) -> Any:
        assert device == "cuda:1"  # the stub's GPU is the second one
        taken.append(array)
        return torch.from_numpy(seen_by_host(array))

    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch, "as_tensor", as_tensor)
    return taken
