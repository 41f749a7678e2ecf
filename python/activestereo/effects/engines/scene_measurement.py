# SPDX-License-Identifier: Apache-2.0
"""Corrects calibration and scene by values that a fit finds beside the effects: focal lengths, albedos, material
fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import kuafu
from activestereo.effects.core.engine import EngineInputs

# The texture that a measured value replaces.
_TEXTURES = {
    "roughness": "metallic_roughness_texture",
    "metallic": "metallic_roughness_texture",
    "specular": "specular_texture",
    "transmission": "transmission_texture",
    "ir_albedo": "ir_albedo_texture",
}


def set_surface(material: kuafu.Material, values: Mapping[str, float]) -> None:
    """Sets measured fields of a material, {name: value}, and removes the textures that they replace."""
    for name, value in values.items():
        setattr(material, name, value)
        setattr(material, _TEXTURES[name], None)
    if "roughness" in values:
        material.transmission_roughness = values["roughness"]


@dataclass(frozen=True)
class SceneMeasurement:
    """Corrections of calibration and scene. focal: relative change of the left and the right focal length. albedo:
    {material id: factor on its infrared albedo}. surfaces: {material id: {field of kuafu's Material: new value}}."""

    focal: tuple[float, float] = (0.0, 0.0)
    albedo: dict[int, float] = field(default_factory=dict)
    surfaces: dict[int, dict[str, float]] = field(default_factory=dict)

    def apply(self, inputs: EngineInputs) -> None:
        """Corrects the focal lengths, material fields and albedos of the inputs in place."""
        for side, change in zip(inputs.sides, self.focal, strict=True):
            if change:
                side.scale_focal(1.0 + change)
        for number, values in self.surfaces.items():
            set_surface(inputs.material(number), values)
        for number, factor in self.albedo.items():
            material = inputs.material(number)
            if (
                material.ir_albedo is None
                and material.ir_albedo_texture is None
                and material.base_color_texture is None
            ):
                material.ir_albedo = material.base_color[0]
            if material.ir_albedo is None:
                red, green, blue, alpha = material.base_color
                material.base_color = (min(1.0, red * factor), green, blue, alpha)
            else:
                material.ir_albedo = min(1.0, material.ir_albedo * factor)
