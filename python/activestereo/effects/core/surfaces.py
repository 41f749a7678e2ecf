# SPDX-License-Identifier: Apache-2.0
"""Restricts effects to some of the scene's surfaces, such as a glaze on one object or a clear wall."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View

# A float in a file holds a sum of powers of 2 exactly up to this number of materials.
MOST_MATERIALS = 48

SURFACES = Parameter(
    "surfaces", "bits", neutral=0.0, low=0.0, high=2.0**MOST_MATERIALS - 1, typical=1.0, choice=True,
    source="sum of 2^k over the scene file's materials k that show it; 0 = all surfaces",
)  # fmt: skip


def material_numbers(surfaces: float) -> list[int]:
    """Returns the material numbers k that an effect's parameter `surfaces`, a sum of 2^k, selects."""
    return [k for k in range(MOST_MATERIALS) if int(surfaces) >> k & 1]


def chosen(view: View, surfaces: float) -> np.ndarray:
    """Returns a mask [height][width] of the pixels on the selected materials. surfaces: the sum of 2^k over their
    numbers k. All pixels are selected by 0, or if the view has no material image."""
    if surfaces == 0 or view.material is None:
        return np.ones(view.shape, dtype=bool)
    material = view.material
    return view.once(("surfaces", surfaces), lambda: np.isin(material, material_numbers(surfaces)))


def on_surfaces(light: Light, changed: Light, view: View, surfaces: float) -> Light:
    """Returns the light that is `changed` on the selected surfaces and `light` elsewhere. surfaces: as for chosen()."""
    if surfaces == 0:
        return changed
    here = chosen(view, surfaces)
    return Light.of_images(np.where(here, changed.images, light.images), light.supersampled)
