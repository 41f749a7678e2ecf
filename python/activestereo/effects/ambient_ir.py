# SPDX-License-Identifier: Apache-2.0
"""Simulates ambient infrared light that differs in strength and is not uniform."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@effect(
    "ambient_ir",
    stage=Stage.SURFACE,
    family="ambient light",
    finding="There is more ambient infrared light than the scene file says",
    source="sun and lamps at 850 nm through windows come from one side",
    parameters=[
        Parameter(
            "level", "1", neutral=0.0, low=-0.9, high=5.0, typical=0.3,
            source="relative change; the fit's ambient scale absorbs a constant one",
        ),
        Parameter(
            "gradient_x", "1", neutral=0.0, low=-0.9, high=0.9, typical=0.2,
            source="relative change per metre to the right in the scene",
        ),
        Parameter(
            "gradient_y", "1", neutral=0.0, low=-0.9, high=0.9, typical=0.2,
            source="relative change per metre downwards",
        ),
    ],
    image_only="kuafu's environment shines alike on every place",
)  # fmt: skip
def ambient_ir(light: Light, view: View, level: float, gradient_x: float, gradient_y: float) -> Light:
    """Ambient light is stronger, and grows to one side of the scene (left camera's axes)."""
    points = view.points()
    gain = 1.0 + level + gradient_x * points[..., 0] + gradient_y * points[..., 1]
    return replace(light, ambient=light.ambient * np.maximum(gain, 0.0))
