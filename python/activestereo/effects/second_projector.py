# SPDX-License-Identifier: Apache-2.0
"""Simulates another pattern projector on the rig."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs, rotation
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.second_unit import unit_starts


@engine_effect(
    "second_projector",
    moves=("rig_lights",),
    stage=Stage.SURFACE,
    family="second projector",
    finding="A second projector on the rig is on",
    source="overlapping units: holes where two patterns meet (librealsense issue 516)",
    starts=unit_starts,
    parameters=[
        Parameter(
            "intensity_m2", "m^2", neutral=0.0, low=0.0, high=200.0, typical=8.0,
            source="radiant intensity over ambient radiance: the unit burns whatever the own projector does",
        ),
        Parameter("offset_x_m", "m", neutral=0.2, low=-1.0, high=1.0, typical=0.1, source="from the own projector, its "
                                                                                          "axes"),
        Parameter("offset_y_m", "m", neutral=0.0, low=-1.0, high=1.0, typical=0.1),
        Parameter("yaw_rad", "rad", neutral=0.0, low=-0.6, high=0.6, typical=0.1, source="positive turns its axis to "
                                                                                         "the right"),
    ],
)  # fmt: skip
def second_projector(
    inputs: EngineInputs, intensity_m2: float, offset_x_m: float, offset_y_m: float, yaw_rad: float
) -> None:
    """A second unit on the same rig projects the same pattern from another position, also while the rig's projector is
    off."""
    own = inputs.projector
    if own is None:
        return
    place = np.eye(4)
    place[:2, 3] = offset_x_m, offset_y_m
    place[:3, :3] = rotation((0.0, 1.0, 0.0), yaw_rad)
    inputs.add_unit(
        on_rig=True, name="second projector", light_to_world=own.light_to_world @ place, intensity_m2=intensity_m2,
        linear_velocity=own.linear_velocity, angular_velocity=own.angular_velocity,
    )  # fmt: skip
