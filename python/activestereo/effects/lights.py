# SPDX-License-Identifier: Apache-2.0
"""Effects of further light: of the room, of lamps and of other projectors."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, rotation
from activestereo.effects.core.flicker import flicker_starts
from activestereo.effects.core.lamp import lamp_pose, lamp_starts
from activestereo.effects.core.light import Light
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.room_unit import room_unit_starts
from activestereo.effects.core.second_unit import unit_starts
from activestereo.effects.core.unit_match import axes
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


@effect(
    "flicker_banding",
    stage=Stage.SURFACE,
    family="ambient light",
    finding="The ambient light flickers",
    source="IEEE 1789: lamps vary at twice the mains frequency",
    starts=flicker_starts,
    parameters=[
        Parameter("depth", "1", neutral=0.0, low=0.0, high=1.0, typical=0.15),
        Parameter(
            "frequency_hz", "Hz", neutral=100.0, low=80.0, high=250.0, typical=20.0,
            slope_step=1e-3,  # a capture of a minute resolves a hundredth of a hertz
        ),
        Parameter("phase_rad", "rad", neutral=0.0, low=-np.pi, high=np.pi, typical=1.0),
        Parameter(
            "line_time_s", "s", neutral=0.0, low=0.0, high=1e-4, typical=2e-5,
            source="0 = all rows at once: frames vary, no bands",
        ),
    ],
    image_only="kuafu's lights do not vary within a frame",
)  # fmt: skip
def flicker_banding(
    light: Light, view: View, depth: float, frequency_hz: float, phase_rad: float, line_time_s: float
) -> Light:
    """Ambient light varies sinusoidally in time, averaged over each row's exposure."""
    height = view.shape[0]
    row_time = view.frame.timestamp_s + (np.arange(height) - (height - 1) / 2) * line_time_s
    averaged = depth * np.sinc(frequency_hz * view.frame.exposure_s)
    gain = 1.0 + averaged * np.sin(2 * np.pi * frequency_hz * row_time + phase_rad)
    return replace(light, ambient=light.ambient * gain[:, None])


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
        inputs.add_light(on_rig=False, kind="directional", name="sun", light_to_world=place, ir_intensity=intensity)
    else:
        intensity /= nearness_per_m**2
        inputs.add_light(on_rig=False, kind="point", name="lamp", light_to_world=place, ir_intensity=intensity)


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
