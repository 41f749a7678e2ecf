# SPDX-License-Identifier: Apache-2.0
"""Simulates another unit that stands in the room, with a pattern projector of the same kind."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.room_unit import room_unit_starts
from activestereo.effects.core.unit_match import axes


@engine_effect(
    "room_projector",
    moves=("lights",),
    stage=Stage.SURFACE,
    family="second projector",
    finding="A second projector stands in the room",
    source="overlapping units: holes where two patterns meet (librealsense issue 516)",
    starts=room_unit_starts,
    parameters=[
        Parameter(
            "intensity_m2", "m^2", neutral=0.0, low=0.0, high=200.0, typical=8.0,
            source="radiant intensity over ambient radiance: the unit burns whatever the own projector does",
        ),
        Parameter("x_m", "m", neutral=-0.2, low=-10.0, high=10.0, typical=0.3, source="of the world", slope_step=0.002),
        Parameter("y_m", "m", neutral=0.5, low=-10.0, high=10.0, typical=0.3, source="of the world", slope_step=0.002),
        Parameter("z_m", "m", neutral=0.1, low=-10.0, high=10.0, typical=0.3, source="of the world", slope_step=0.002),
        Parameter(
            "azimuth_rad", "rad", neutral=2.8, low=-2 * np.pi, high=2 * np.pi, typical=0.3, slope_step=0.002,
            source="of its beam, about the world's y axis, from z towards x",
        ),
        Parameter(
            "elevation_rad", "rad", neutral=-1.5, low=-1.55, high=1.55, typical=0.15, slope_step=0.002,
            source="of its beam, above the world's xz plane",
        ),
        Parameter("roll_rad", "rad", neutral=0.0, low=-np.pi, high=np.pi, typical=0.1, slope_step=0.002,
                  source="about its beam, right-handed"),
    ],
)  # fmt: skip
def room_projector(
    inputs: EngineInputs,
    intensity_m2: float,
    x_m: float,
    y_m: float,
    z_m: float,
    azimuth_rad: float,
    elevation_rad: float,
    roll_rad: float,
) -> None:
    """A unit that stands in the room projects the same pattern, also while the rig's projector is off; it stays when
    the rig moves."""
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = axes(azimuth_rad, elevation_rad, roll_rad), (x_m, y_m, z_m)
    inputs.add_unit(on_rig=False, name="room projector", light_to_world=place, intensity_m2=intensity_m2)
