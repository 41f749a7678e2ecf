# SPDX-License-Identifier: Apache-2.0
"""Copies a simulator's images to the memory that the renderer reads, from NumPy, torch (host or CUDA) or DLPack. Maps
the simulator's material numbers to the scene's material ids."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.sensor.cuda_memory import CudaMemory, cuda_tensor, wait_for
from activestereo.sensor.ir_link import has_own_memory

_MIRROR_ROUGHNESS = 0.45
_NONE = np.uint32(0xFFFFFFFF)


def mirrors_or_is_glass(material: kuafu.Material) -> bool:
    """Returns whether the material is a smooth metal or transmits most light, so that it shows other surfaces."""
    return material.transmission > 0.5 or (material.metallic > 0.5 and material.roughness < _MIRROR_ROUGHNESS)


class MaterialNumbers:
    """Adds materials to a scene and maps the caller's numbers to the scene's material ids.

    materials: a sequence of kuafu.Material, or {number: kuafu.Material} with numbers 0 to 65535. None: all surfaces are
    matt and only an albedo tells them apart. Raises TypeError for other entries, ValueError for other numbers."""

    def __init__(self, scene: kuafu.Scene, materials: Any = None) -> None:
        self.is_given = materials is not None
        items = materials.items() if isinstance(materials, Mapping) else enumerate(materials or ())
        found = {int(number): material for number, material in items}
        for number, material in found.items():
            if not isinstance(material, kuafu.Material):
                raise TypeError(f"materials[{number}] is {material!r}, expected a kuafu.Material")
        if found and (min(found) < 0 or max(found) > 0xFFFF):
            raise ValueError(f"materials have the numbers {sorted(found)}, expected 0 to 65535")
        self.numbers = sorted(found)
        self._ids = np.full(max(found, default=0) + 2, _NONE)  # the last entry stands for all unknown numbers
        self._is_odd = np.zeros(len(self._ids), bool)
        for number in self.numbers:
            self._ids[number] = 1 + scene.add_material(found[number])
            self._is_odd[number] = mirrors_or_is_glass(found[number])
        self._ids_on_cuda: Any = None

    def ids(self, numbers: NDArray[Any], unknown: np.uint32 | int = _NONE) -> NDArray[np.uint32]:
        """Returns the scene's material ids for kuafu's light_gbuffers(). numbers: the caller's, of any shape; those
        without a material get `unknown`."""
        ids = self._ids[self._places(numbers)]
        return np.where(ids == _NONE, np.uint32(unknown), ids)

    def ids_of_tensor(self, numbers: Any) -> Any:
        """Returns kuafu's material ids for a torch tensor of the user's material numbers, int32 on its device."""
        if self._ids_on_cuda is None:
            import torch

            self._ids_on_cuda = torch.from_numpy(self._ids.view(np.int32).copy()).to(numbers.device)
        last = len(self._ids) - 1
        places = numbers.long()
        return self._ids_on_cuda[places.where((places >= 0) & (places < last), places.new_tensor(last))]

    def are_odd(self, numbers: NDArray[Any]) -> NDArray[np.bool_]:
        """Returns a mask of the material numbers whose material mirrors or is glass."""
        return self._is_odd[self._places(numbers)]

    def require_known(self, numbers: NDArray[Any], depth: NDArray[Any]) -> None:
        """Raises ValueError if a surface (depth > 0) has a material number that is unknown, with its environment and
        pixel."""
        is_bad = (self.ids(numbers) == _NONE) & (depth > 0) & np.isfinite(depth)
        if is_bad.any():
            environment, v, u = (int(i) for i in np.unravel_index(int(np.argmax(is_bad)), is_bad.shape))
            value, known = numbers[environment, v, u], self.numbers
            place = f"environment {environment}, pixel ({u}, {v})"
            raise ValueError(f"{place}: material is {value}, expected a number of materials {known}")

    def _places(self, numbers: NDArray[Any]) -> NDArray[np.intp]:
        last = len(self._ids) - 1
        if numbers.dtype.kind == "f":
            numbers = np.where(numbers == np.floor(numbers), numbers, -1.0)
        return np.where((numbers >= 0) & (numbers < last), numbers, last).astype(np.intp)


_TYPES = {"depth": np.float32, "normal": np.float32, "albedo": np.float32, "material": np.uint32}
_FURTHEST_NEAR_M = 50.0  # no sensor of this kind measures there


def host_image(name: str, values: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """Returns the values as an array of this shape on the host; for one environment the first axis may be missing.
    Raises ValueError for another shape, TypeError for anything but numbers."""
    image = np.asarray(_on_host(values))
    if image.dtype.kind not in "fiub":
        raise TypeError(f"{name} is of {image.dtype}, expected numbers")
    return _checked_shape(name, image, shape)


def require_metres(name: str, depth: NDArray[Any]) -> None:
    """Raises ValueError if depth [...] is likely in millimetres: every surface is beyond 50 m, and their depths
    differ."""
    there = depth[np.isfinite(depth) & (depth > 0)]
    if there.size and there.min() > _FURTHEST_NEAR_M and there.max() > 1.01 * there.min():
        raise ValueError(
            f"{name} begins at {there.min():g} m: is it in millimetres? Then give {name} / 1000; 0 and inf are nothing"
        )


def _checked_shape(name: str, image: Any, shape: tuple[int, ...]) -> Any:
    if shape[0] == 1 and tuple(image.shape) == shape[1:]:
        image = image[None]
    if tuple(image.shape) != shape:
        raise ValueError(f"{name} is {list(image.shape)}, expected {list(shape)}: input_shape of the sensor")
    return image


def _red(name: str, image: Any, shape: tuple[int, ...]) -> Any:
    """Returns an albedo image with one value per pixel. RGB(A) gives its red channel, a guess of the infrared albedo;
    uint8 is scaled to 0..1."""
    is_rgb = image.ndim > 2 and image.shape[-1] in (3, 4) and tuple(image.shape[-3:-1]) == shape[1:]
    image = _checked_shape(name, image[..., 0] if is_rgb else image, shape)
    return image / 255.0 if str(image.dtype).endswith("uint8") else image


class InputImages:
    """Holds the memory from which kuafu reads one camera's images [E, height, width]: depth, normal, albedo, material.
    Each is allocated when it is first given."""

    def __init__(self, device: kuafu.Device, shape: tuple[int, ...], materials: MaterialNumbers) -> None:
        self._device, self._shape, self._materials = device, shape, materials
        self._is_on_gpu = has_own_memory(device)
        self._buffers: dict[str, kuafu.Buffer] = {}
        self._seen_by_cuda: dict[str, Any] = {}

    def put(self, given: Mapping[str, Any]) -> dict[str, kuafu.Buffer]:
        """Copies the images that are not None to the memory that kuafu's light_gbuffers() reads, and returns {name:
        buffer}."""
        found = {}
        for name, values in given.items():
            if values is None:
                continue
            shape = (*self._shape, 3) if name == "normal" else self._shape
            if name not in self._buffers:
                size_bytes, on_gpu = 4 * int(np.prod(shape)), self._is_on_gpu
                self._buffers[name] = kuafu.Buffer(self._device, size_bytes, exportable=on_gpu, host_visible=not on_gpu)
            found[name] = buffer = self._buffers[name]
            if self._is_on_gpu and getattr(values, "is_cuda", False):
                if name not in self._seen_by_cuda:
                    dtype = "int32" if name == "material" else "float32"  # torch has no arithmetic of uint32
                    self._seen_by_cuda[name] = cuda_tensor(CudaMemory(buffer).array(dtype, shape))
                image = _red(name, values, self._shape) if name == "albedo" else _checked_shape(name, values, shape)
                target = self._seen_by_cuda[name]
                target.copy_(self._materials.ids_of_tensor(image) if name == "material" else image)
                wait_for(target)
                continue
            if name == "albedo":
                image = _red(name, np.asarray(_on_host(values)), self._shape)
            else:
                image = host_image(name, values, shape)
            if name == "material":
                image = self._materials.ids(image, unknown=0)  # no surface here, after require_known()
            if self._is_on_gpu:
                buffer.write(np.ascontiguousarray(image, _TYPES[name]))
            else:
                np.copyto(buffer.image(_TYPES[name], shape).array(), image, casting="unsafe")
        return found


def _on_host(values: Any) -> Any:
    if hasattr(values, "detach"):
        return values.detach().cpu().numpy()
    return np.from_dlpack(values) if hasattr(values, "__dlpack__") and not isinstance(values, np.ndarray) else values
