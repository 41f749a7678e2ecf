# SPDX-License-Identifier: Apache-2.0
"""Materials of a simulator's surfaces: their own numbers, and the scene's ids."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu

_MIRROR_ROUGHNESS = 0.45
_NONE = np.uint32(0xFFFFFFFF)


def mirrors_or_is_glass(material: kuafu.Material) -> bool:
    """Whether the material shows light of several reflections."""
    return material.transmission > 0.5 or (material.metallic > 0.5 and material.roughness < _MIRROR_ROUGHNESS)


class MaterialNumbers:
    """kuafu.Materials by number, put into the scene.

    materials: a sequence or a mapping. None: all surfaces are matt, and only an albedo tells them apart. Raises
    TypeError for anything but a Material."""

    def __init__(self, scene: kuafu.Scene, materials: Any = None) -> None:
        self.is_given = materials is not None
        found = {} if materials is None else dict(_items(materials))
        for number, material in found.items():
            if not isinstance(material, kuafu.Material):
                raise TypeError(f"materials[{number}] is {material!r}, expected a kuafu.Material")
        if found and (min(found) < 0 or max(found) > 0xFFFF):
            raise ValueError(f"materials have the numbers {sorted(found)}, expected 0 to 65535")
        self.numbers = sorted(found)
        self._ids = np.full(max(found, default=0) + 2, _NONE)  # the last one: of numbers beyond
        self._is_odd = np.zeros(len(self._ids), bool)
        for number in self.numbers:
            self._ids[number] = 1 + scene.add_material(found[number])
            self._is_odd[number] = mirrors_or_is_glass(found[number])
        self._ids_on_cuda: Any = None

    def ids(self, numbers: NDArray[Any], unknown: np.uint32 | int = _NONE) -> NDArray[np.uint32]:
        """Material ids for kuafu's light_gbuffers(); a number that is not there gets `unknown`."""
        ids = self._ids[self._places(numbers)]
        return np.where(ids == _NONE, np.uint32(unknown), ids)

    def ids_of_tensor(self, numbers: Any) -> Any:
        """ids() of a torch tensor, on its device."""
        if self._ids_on_cuda is None:
            import torch

            self._ids_on_cuda = torch.from_numpy(self._ids.view(np.int32).copy()).to(numbers.device)
        last = len(self._ids) - 1
        places = numbers.long()
        return self._ids_on_cuda[places.where((places >= 0) & (places < last), places.new_tensor(last))]

    def mirrors_or_are_glass(self, numbers: NDArray[Any]) -> NDArray[np.bool_]:
        return self._is_odd[self._places(numbers)]

    def require_known(self, numbers: NDArray[Any], depth: NDArray[Any]) -> None:
        """Raises ValueError with the environment and the pixel of a surface whose material is unknown."""
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


def _items(materials: Any) -> Any:
    items = materials.items() if isinstance(materials, Mapping) else enumerate(materials)
    return ((int(number), material) for number, material in items)
