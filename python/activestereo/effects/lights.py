# SPDX-License-Identifier: Apache-2.0
"""Effects of further light: of the room, of lamps and of other projectors."""

from dataclasses import replace
from heapq import nlargest

import numpy as np

import kuafu
from activestereo.capture.capture import Frame
from activestereo.common.pose import rigid_motion
from activestereo.effects.core.descriptor import Parameter, Stage, StartImage, effect
from activestereo.effects.core.engine import EngineInputs, axes, rotation
from activestereo.effects.core.lamp import lamp_pose, lamp_starts
from activestereo.effects.core.light import Light
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.room_unit import COARSE, PlaneMatch, SeenPoints, room_unit_starts
from activestereo.effects.core.view import View

# Lamps flicker at twice the mains' 50 or 60 Hz, which grids and generators keep to 2 %. A few frames would fit
# other frequencies as well.
_FREQUENCIES_HZ = np.arange(98.0, 122.5, 0.02)
_LINE_TIMES_S = np.arange(0.0, 6.1e-5, 5e-6)
_FLICKERS = 8

# (frame, sums over each row of w A^2 and w A r), with weight w, ambient light A and residual r.
_RowSums = tuple[Frame, np.ndarray, np.ndarray]


def flicker_starts(images: list[StartImage]) -> list[dict[str, float]]:
    """Returns the best few fits of flicker as {depth, frequency_hz, phase_rad, line_time_s}, best first. Their
    frequencies differ, because a few frames hardly determine the frequency. The likelihood has a peak every hundredth
    of a hertz, so all frequencies are tried.

    The residual of a row is linear in the sine and cosine of the flicker's phase at the row's time. Each pair of
    frequency and line time is therefore a regression on a few sums per row. The ambient level is fitted, too: a fit
    without flicker took the mean of a few phases for it. Light is never negative, so an amplitude above the mean is
    limited to the mean. Otherwise slow waves, of which frames show a few similar phases, would pass for the level."""
    rows = []
    for image in images:
        weighted = image.weight * image.ambient
        sums = (weighted * image.ambient).sum(axis=1), (weighted * image.residual).sum(axis=1)
        rows.append((image.view.frame, *sums))
    gains, depths, phases = (np.stack(x) for x in zip(*(_gains(rows, t) for t in _LINE_TIMES_S), strict=True))
    line, best = gains.argmax(axis=0), gains.max(axis=0)
    beside = np.pad(best, 1, constant_values=-np.inf)
    peaks = np.flatnonzero((best >= beside[:-2]) & (best > beside[2:]))
    return [
        {
            "depth": float(depths[line[i], i]),
            "frequency_hz": float(_FREQUENCIES_HZ[i]),
            "phase_rad": float(phases[line[i], i]),
            "line_time_s": float(_LINE_TIMES_S[line[i]]),
        }
        for i in peaks[np.argsort(-best[peaks])][:_FLICKERS]
    ]


def _gains(images: list[_RowSums], line_time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns (fall of chi2, depth, phase in radians), each an array over all frequencies. line_time: seconds.

    Sums of squares and products of sine and cosine follow from twice the angle: from a row's wave exp(i angle) and its
    square.
    """
    total, square, product, level = 0.0, 0.0, 0.0, 0.0
    heights = {len(strength) for _, strength, _ in images}
    times = {height: line_time * (np.arange(height) - (height - 1) / 2) for height in heights}  # of rows
    waves = {height: np.exp(2j * np.pi * np.outer(_FREQUENCIES_HZ, of_rows)) for height, of_rows in times.items()}
    for frame, strength, moment in images:
        rows, start = waves[len(strength)], np.exp(2j * np.pi * _FREQUENCIES_HZ * frame.timestamp_s)
        averaged = np.sinc(_FREQUENCIES_HZ * frame.exposure_s)
        total = total + averaged**2 * strength.sum()
        square = square + (averaged * start) ** 2 * ((rows * rows) @ strength)
        product = product + averaged * start * (rows @ moment)
        level = level + averaged * start * (rows @ strength)
    # Normal equations of sine and cosine after the level's share (Schur's complement).
    light = sum(strength.sum() for _, strength, _ in images) + 1e-30
    rest = sum(moment.sum() for *_, moment in images)
    product = product - level * (rest / light)
    ss, cc, sc = 0.5 * (total - square.real), 0.5 * (total + square.real), 0.5 * square.imag
    ss, cc, sc = ss - level.imag**2 / light, cc - level.real**2 / light, sc - level.real * level.imag / light
    determinant = np.maximum(ss * cc - sc * sc, 1e-12 * (ss * cc + 1e-30))
    sine = (cc * product.imag - sc * product.real) / determinant
    cosine = (ss * product.real - sc * product.imag) / determinant
    mean = np.maximum(1.0 + (rest - sine * level.imag - cosine * level.real) / light, 0.0)
    amplitude = np.hypot(sine, cosine) + 1e-30
    taken = np.minimum(mean / amplitude, 1.0)
    fall = taken * (2.0 - taken) * (sine * product.imag + cosine * product.real)
    return fall, np.minimum(amplitude / (mean + 1e-30), 1.0), np.arctan2(cosine, sine)


# Positions up to _REACH_M beside the rig's projector are tried, in steps of a dot's width as seen from the scene.
# _LARGEST_TURNS are tangents of the largest tilt (a dot's width) and yaw.
_REACH_M, _STEP_RAD, _LARGEST_TURNS = 0.4, 0.009, (0.009, 0.3)
_IMAGES, _PIXELS, _UNITS = 3, 6000, 4


def unit_starts(images: list[StartImage]) -> list[dict[str, float]]:
    """Returns intensity, position and yaw of the best few poses of a second projector on the rig, {parameter: value}
    each. Its dots match the image from one position alone, so a fine grid of positions beside the rig is tried, each at
    its best yaw. Images with the least power of the rig's own projector are used."""
    chosen = sorted(images, key=lambda image: image.view.frame.projector_power)[:_IMAGES]
    if not chosen:
        return []
    seen = SeenPoints.of(chosen, _PIXELS, lambda view: view.camera_to_projector)
    match = PlaneMatch(chosen[0].view, *COARSE)
    # In the projector's frame y points down, so that a unit beside it is rolled by half a turn from axes()' upright.
    places = np.arange(-_REACH_M, _REACH_M, _STEP_RAD * np.median(seen.points[:, 2]))
    found = [match.best(seen, np.array([x, 0.0, 0.0, 0.0, 0.0, np.pi]), _LARGEST_TURNS) for x in places]
    return [
        {"intensity_m2": strength, "offset_x_m": float(pose[0]), "offset_y_m": 0.0, "yaw_rad": float(pose[3])}
        for _, strength, pose in nlargest(_UNITS, found, lambda one: one[0])
    ]


@effect(
    stage=Stage.SURFACE, family="ambient light",
    finding="There is more ambient infrared light than the scene file says",
    source="sun and lamps at 850 nm through windows come from one side",
    image_only="kuafu's environment shines alike on every place",
    parameters=[
        Parameter("level", "1", low=-0.9, high=5.0, typical=0.3,
                  source="relative change; the fit's ambient scale absorbs a constant one"),
        Parameter("gradient_x", "1", low=-0.9, high=0.9, typical=0.2,
                  source="relative change per metre to the right in the scene"),
        Parameter("gradient_y", "1", low=-0.9, high=0.9, typical=0.2, source="relative change per metre downwards"),
    ],
)  # fmt: skip
def ambient_ir(light: Light, view: View, level: float, gradient_x: float, gradient_y: float) -> Light:
    """Ambient light is stronger. It grows to one side of the scene (left camera's axes)."""
    points = view.points()
    gain = 1.0 + level + gradient_x * points[..., 0] + gradient_y * points[..., 1]
    return replace(light, ambient=light.ambient * np.maximum(gain, 0.0))


@effect(
    stage=Stage.SURFACE, family="ambient light", starts=flicker_starts,
    finding="The ambient light flickers",
    source="IEEE 1789: lamps vary at twice the mains frequency",
    image_only="kuafu's lights do not vary within a frame",
    parameters=[
        Parameter("depth", "1", high=1.0, typical=0.15),
        Parameter("frequency_hz", "Hz", neutral=100.0, low=80.0, high=250.0, typical=20.0,
                  slope_step=1e-3),  # a capture of a minute resolves a hundredth of a hertz
        Parameter("phase_rad", "rad", low=-np.pi, high=np.pi, typical=1.0),
        Parameter("line_time_s", "s", high=1e-4, typical=2e-5, slope_step=4e-7,
                  source="0 = all rows at once: frames vary, no bands"),
    ],
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


# A light farther than 1000 km lights a scene as the sun does; kuafu's numbers end at 1e12 m.
_SUN_PER_M = 1e-6


@engine_effect(
    stage=Stage.SURFACE, family="ambient light", starts=lamp_starts, moves=("lights",),
    finding="A lamp shines on the scene that the scene file lacks",
    source="lamps and sunlight hold near infrared; librealsense issues on sunlight and halogen lamps",
    parameters=[
        Parameter("strength", "1", high=50.0, typical=1.0, scales_light=True,
                  source="radiance of a white surface that faces it at the world's origin, over the ambient radiance"),
        Parameter("azimuth_rad", "rad", low=-np.pi, high=np.pi, typical=1.0,
                  source="about the world's y axis, from z towards x"),
        Parameter("elevation_rad", "rad", neutral=0.8, low=-0.5, high=np.pi / 2, typical=0.5,
                  source="above the world's xz plane"),
        Parameter("nearness_per_m", "1/m", high=2.0, typical=0.3,
                  source="1 / distance from the world's origin; 0 = the sun"),
    ],
)  # fmt: skip
def external_light(
    inputs: EngineInputs, strength: float, azimuth_rad: float, elevation_rad: float, nearness_per_m: float
) -> None:
    """One more light shines from one side and casts shadows: a lamp at a place in the room, or the sun. It stays when
    the rig moves."""
    if strength == 0.0:
        return
    is_sun = nearness_per_m < _SUN_PER_M
    kind, name = ("directional", "sun") if is_sun else ("point", "lamp")
    place = lamp_pose(azimuth_rad, elevation_rad, 0.0 if is_sun else nearness_per_m)
    intensity = np.pi * strength * inputs.ambient_radiance / (1.0 if is_sun else nearness_per_m**2)
    inputs.lights.append(kuafu.Light(kind=kind, name=name, light_to_world=place, ir_intensity=intensity))


_UNIT_INTENSITY = Parameter(
    "intensity_m2", "m^2", high=200.0, typical=8.0, scales_light=True,
    source="radiant intensity over ambient radiance: the unit burns whatever the own projector does",
)  # fmt: skip


@engine_effect(
    stage=Stage.SURFACE, family="second projector", starts=unit_starts, moves=("rig_lights",),
    finding="A second projector on the rig is on",
    source="overlapping units: holes where two patterns meet (librealsense issue 516)",
    parameters=[
        _UNIT_INTENSITY,
        Parameter("offset_x_m", "m", neutral=0.2, low=-1.0, high=1.0, typical=0.1,
                  source="from the own projector, its axes"),
        Parameter("offset_y_m", "m", low=-1.0, high=1.0, typical=0.1),
        Parameter("yaw_rad", "rad", low=-0.6, high=0.6, typical=0.1, source="positive turns its axis to the right"),
    ],
)  # fmt: skip
def second_projector(
    inputs: EngineInputs, intensity_m2: float, offset_x_m: float, offset_y_m: float, yaw_rad: float
) -> None:
    """A second unit on the same rig projects the same pattern from another position. It shines also while the rig's
    projector is off."""
    pose = rigid_motion((offset_x_m, offset_y_m, 0.0), rotation((0.0, 1.0, 0.0), yaw_rad))
    inputs.add_unit("second projector", intensity_m2, pose, on_rig=True)


@engine_effect(
    stage=Stage.SURFACE, family="second projector", starts=room_unit_starts, starts_late=True, moves=("lights",),
    finding="A second projector stands in the room",
    source="overlapping units: holes where two patterns meet (librealsense issue 516)",
    parameters=[
        _UNIT_INTENSITY,
        Parameter("x_m", "m", neutral=-0.2, low=-10.0, high=10.0, typical=0.3, slope_step=0.002, source="of the world"),
        Parameter("y_m", "m", neutral=0.5, low=-10.0, high=10.0, typical=0.3, slope_step=0.002, source="of the world"),
        Parameter("z_m", "m", neutral=0.1, low=-10.0, high=10.0, typical=0.3, slope_step=0.002, source="of the world"),
        Parameter("azimuth_rad", "rad", neutral=2.8, low=-2 * np.pi, high=2 * np.pi, typical=0.3, slope_step=0.002,
                  source="of its beam, about the world's y axis, from z towards x"),
        Parameter("elevation_rad", "rad", neutral=-1.5, low=-1.55, high=1.55, typical=0.15, slope_step=0.002,
                  source="of its beam, above the world's xz plane"),
        Parameter("roll_rad", "rad", low=-np.pi, high=np.pi, typical=0.1, slope_step=0.002,
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
    """A unit that stands in the room projects the same pattern. It shines also while the rig's projector is off, and it
    stays when the rig moves."""
    pose = rigid_motion((x_m, y_m, z_m), axes(azimuth_rad, elevation_rad, roll_rad))
    inputs.add_unit("room projector", intensity_m2, pose, on_rig=False)
