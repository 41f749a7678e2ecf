# SPDX-License-Identifier: Apache-2.0
"""Simulates a lamp in the room, or the sun through a window."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.lamp import lamp_pose, lamp_starts
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "external_light",
    moves=("lights",),
    stage=Stage.SURFACE,
    family="ambient light",
    finding="A lamp shines on the scene that the scene file lacks",
    source="lamps and sunlight hold near infrared; librealsense issues on sunlight and halogen lamps",
    parameters=[
        Parameter(
            "strength", "1", neutral=0.0, low=0.0, high=50.0, typical=1.0,
            source="radiance of a white surface that faces it at the world's origin, over the ambient radiance",
        ),
        Parameter(
            "azimuth_rad", "rad", neutral=0.0, low=-np.pi, high=np.pi, typical=1.0,
            source="about the world's y axis, from z towards x",
        ),
        Parameter(
            "elevation_rad", "rad", neutral=0.8, low=-0.5, high=np.pi / 2, typical=0.5,
            source="above the world's xz plane",
        ),
        Parameter(
            "nearness_per_m", "1/m", neutral=0.0, low=0.0, high=2.0, typical=0.3,
            source="1 / distance from the world's origin; 0 = the sun",
        ),
    ],
    starts=lamp_starts,
)  # fmt: skip
def external_light(
    inputs: EngineInputs, strength: float, azimuth_rad: float, elevation_rad: float, nearness_per_m: float
) -> None:
    """One more light shines from one side, with shadows: a lamp at a place in the room, or the sun; it stays when the
    rig moves."""
    if strength == 0.0:
        return
    place = lamp_pose(azimuth_rad, elevation_rad, nearness_per_m)
    intensity = np.pi * strength * inputs.ambient_radiance
    if nearness_per_m == 0.0:
        inputs.add_light(
            on_rig=False, kind="directional", name="sun", light_to_world=place, ir_intensity=intensity
        )
    else:
        intensity /= nearness_per_m**2
        inputs.add_light(on_rig=False, kind="point", name="lamp", light_to_world=place, ir_intensity=intensity)
