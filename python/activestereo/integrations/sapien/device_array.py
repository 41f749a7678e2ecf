# SPDX-License-Identifier: Apache-2.0
"""An array on a CUDA device with the ways out that sapien.CudaArray has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import torch


class DeviceArray:
    """A torch tensor's."""

    def __init__(self, tensor: torch.Tensor) -> None:
        self._tensor = tensor

    @property
    def shape(self) -> list[int]:
        return list(self._tensor.shape)

    @property
    def strides(self) -> list[int]:
        """In bytes."""
        return [n * self._tensor.element_size() for n in self._tensor.stride()]

    @property
    def typestr(self) -> str:
        return str(self.__cuda_array_interface__["typestr"])

    @property
    def cuda_id(self) -> int:
        return int(self._tensor.device.index)

    @property
    def ptr(self) -> int:
        return int(self._tensor.data_ptr())

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return dict(self._tensor.__cuda_array_interface__)

    def torch(self) -> torch.Tensor:
        """The torch tensor itself."""
        return self._tensor

    def dlpack(self) -> Any:
        return self._tensor.__dlpack__()

    def cupy(self) -> Any:
        import cupy

        return cupy.asarray(self)

    def jax(self) -> Any:
        import jax

        return jax.dlpack.from_dlpack(self._tensor)
