# SPDX-License-Identifier: Apache-2.0
"""The light and the view of a scene file that has none of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from activestereo.common.pose import look_at
from activestereo.scene_io.lamp_kinds import LUMENS_PER_WATT

if TYPE_CHECKING:
    import kuafu

# An office, as EN 12464-1 asks for 300 to 500 lux: light from all sides in a scene without lamps.
ROOM_LUX = 400.0
ROOM_WITHOUT_LAMPS = ROOM_LUX / (np.pi * LUMENS_PER_WATT)  # W/(sr m^2): an even sky of radiance L gives pi L
# What the walls of such a room send back, W/(sr m^2), where the scene has lamps.
ROOM_RADIANCE = 0.1

# kuafu's light groups, by which a picture's light is told apart: lamps, surfaces that shine, light from all sides.
LAMPS, SURFACES, ALL_SIDES = 0, 1, 2

_RADII_AWAY = 2.6  # from the middle, where the scene fills half of the picture


def part_light(scene: kuafu.Scene) -> None:
    """Puts surfaces that shine into a light group of their own; light from all sides is the caller's."""
    for number in range(scene.summary.material_count):
        material = scene.get_material(number)
        if any(material.emission) or material.ir_emission:
            material.light_group = SURFACES
            scene.set_material(number, material)


def room_radiance(scene: kuafu.Scene) -> float:
    """Visible radiance from all sides, W/(sr m^2), where nobody states one."""
    return ROOM_RADIANCE if has_lamps(scene) else float(ROOM_WITHOUT_LAMPS)


def has_lamps(scene: kuafu.Scene) -> bool:
    """Whether the scene has a light or a surface that shines."""
    summary = scene.summary
    return summary.light_count > 0 or any(
        any(scene.get_material(number).emission) for number in range(summary.material_count)
    )


def overall_view(summary: kuafu.SceneSummary, least_m: float = 0.0) -> NDArray[np.float64]:
    """camera_to_world [4, 4] of a camera in front of the scene and above it (y up, as in glTF) that sees all of it in
    the middle half of the picture. least_m: the shortest distance that the camera measures."""
    low, high = np.array(summary.bounds_min_m), np.array(summary.bounds_max_m)
    centre, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    direction = np.array([0.0, 0.5, 1.0]) / np.hypot(0.5, 1.0)
    distance = max(_RADII_AWAY * radius, radius + 1.5 * least_m, 0.13)
    return look_at(centre + distance * direction, centre, (0.0, 1.0, 0.0))
