# SPDX-License-Identifier: Apache-2.0
"""Measures how a camera drifts as it warms up, from frames of a static scene: parameters of the library's effects per
kelvin.

The scene need not be known. Frames with the projector off show the room's light; the other frames less these show the
dots. A derivative image is the change by one parameter, of the library's effects or of other movements (mount, lamps).
A sum of these is fitted to each frame's difference from the mean frame. A line over temperature is fitted to each
parameter; its slope is the drift. Its deviation accounts for correlated errors of successive frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d, gaussian_filter

from activestereo.calibrate.least_squares import INTERVAL_90
from activestereo.capture.capture import SAME_EXPOSURE, SIDES, Capture, Frame, read_capture
from activestereo.common.input_files import read_text
from activestereo.common.limits import TEMPERATURE
from activestereo.effects import Light, View, builtin
from activestereo.effects.core.model import acted
from activestereo.effects.core.view import REFERENCE_TEMPERATURE_C
from activestereo.model import Quantity, SensorModel

# Effects whose change per kelvin shows without a known scene. Laser power and filter transmission change alike.
_EFFECTS = ("thermal_drift.cx_px_per_k", "thermal_drift.focal_per_k", "laser_power_drift.per_k")
_GROWTH = "pattern_scale_drift.per_k"
_FEWEST, _LEAST_K, _NAMED = 8, 3.0, 4.0
_LEAST_ALIKE = 0.9  # correlation of a frame with the frames' mean; of one still view it is above 0.99
_STEP_PX = 2  # between pixels that are used
_READ_DN2, _SHOT_DN = 0.5, 0.05  # noise that weighs pixels
_FULL = 0.95
_RIDGE = 1e-9
# Derivative images err by this share of a drift, as simulated warm-ups show.
_COLUMNS = 0.03
# Blur in pixels; noise in a derivative image would bias movements towards 0.
_SMOOTH_PX = 1.0
# Fourth-order derivative (Fornberg 1988); central differences make a dot's slope 5 % too small.
_DERIVATIVE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0

Matrix = NDArray[np.float64]
Layers = tuple[Matrix, Matrix]  # the dots' light and the room's, DN [height][width]


@dataclass(frozen=True)
class Slope:
    """A parameter's change per kelvin, its standard deviation and unit. moves: whether it exceeds 4 deviations."""

    name: str
    value: float
    deviation: float
    unit: str

    @property
    def moves(self) -> bool:
        return abs(self.value) > _NAMED * self.deviation


@dataclass(frozen=True)
class Drift:
    """The measured drift. slopes: of the parameters of the library's effects. celsius: lowest and highest temperature.
    frames: their number. source: where the values come from."""

    slopes: tuple[Slope, ...]
    celsius: tuple[float, float]
    frames: int
    source: str

    def model(self) -> SensorModel:
        """Makes a SensorModel, for model.json, of the effects that have a parameter whose slope moves."""
        model = SensorModel()
        for name in dict.fromkeys(s.name.split(".")[0] for s in self.slopes if s.moves):
            own = [s for s in self.slopes if s.name.startswith(f"{name}.")]
            values = {}
            for s in own:
                half = INTERVAL_90 * s.deviation
                values[s.name.split(".")[1]] = Quantity(s.value, s.value - half, s.value + half, s.unit, self.source)
            model = model.with_effect(builtin()[name], values)
        return model

    def summary(self) -> str:
        """Describes the drift as text: a sentence, then a line for each parameter with its 90 % interval."""
        moving = [s.name for s in self.slopes if s.moves]
        low, high = self.celsius
        first = f"{', '.join(moving) or 'nothing'} moves with temperature, {low:g} to {high:g} C, {self.frames} frames"
        lines = [f"{s.name}: {s.value:.3g} +- {INTERVAL_90 * s.deviation:.2g} {s.unit}" for s in self.slopes]
        lines.append("laser_power_drift may be chromatic_drift.transmission_per_k: above 25 C they are one")
        return "\n".join([first, *lines])


def calibrate_drift(folder: Path, temperatures: Path | None) -> Drift:
    """Measures the Drift from a capture's frames. temperatures: CSV file of seconds, celsius, interpolated linearly;
    None: the frames' own temperatures. Raises ValueError for fewer than 8 frames with dots and a temperature, a range
    below 3 kelvin, no frame with the projector off, other exposures or other views."""
    capture = read_capture(folder)
    frames = _frames_with_temperature(capture, temperatures)
    lit = [f for f in frames if f.projector_power > 0.0]
    dark = [f for f in capture.frames if f.has_infrared and f.projector_power == 0.0]
    if not dark:
        raise ValueError(f"{folder}: no frame has the projector off: record some into off/, the others into on/")
    if len(lit) < _FEWEST:
        of = "file names with milliseconds tell frames' times" if temperatures else "give --temperatures"
        raise ValueError(f"{folder}: {len(lit)} frames with dots have a temperature: {_FEWEST} are needed ({of})")
    celsius = np.array([f.temperature_c for f in lit], float)
    if np.ptp(celsius) < _LEAST_K:
        told = f"frames span {np.ptp(celsius):.2g} K: record from switching on, {_LEAST_K:g} K or more"
        raise ValueError(f"{folder}: {told}")
    exposures = {f.exposure_s * f.gain for f in (*lit, *dark)}
    if max(exposures) > SAME_EXPOSURE * min(exposures):
        told = f"exposures times gain of {min(exposures):g} to {max(exposures):g} s: record all frames at one"
        raise ValueError(f"{folder}: the frames have {told}")

    def smooth(frame: Frame, side: str) -> Matrix:
        return np.asarray(gaussian_filter(capture.ir(frame, side).astype(float), _SMOOTH_PX))

    layers: dict[str, Layers] = {}
    for side in SIDES:
        room, both = (np.mean([smooth(f, side) for f in frames], axis=0) for frames in (dark, lit))
        layers[side] = both - room, room
    names, columns, weight = _columns(capture, lit[0], layers)
    mean = np.concatenate([_picked(layers[side][0] + layers[side][1]) for side in SIDES])
    pixels = [np.concatenate([_picked(smooth(frame, side)) for side in SIDES]) for frame in lit]
    for frame, own in zip(lit, pixels, strict=True):
        if (alike := float(np.corrcoef(own, mean)[0, 1])) < _LEAST_ALIKE:
            told = f"frame {frame.id} correlates with the frames' mean by {alike:.2f} only, {_LEAST_ALIKE} is needed"
            raise ValueError(f"{folder}: {told}: give frames of one still view")
    changes = np.stack(pixels) - mean
    weighted = columns * weight
    square = weighted @ columns.T
    sizes = np.linalg.solve(square + _RIDGE * np.diag(np.diag(square)), weighted @ changes.T).T
    # Fit a line of each parameter over temperature; errors of successive frames correlate (AR(1): Bartlett 1935).
    slopes, x = [], celsius - celsius.mean()
    for name, size in zip(names, sizes.T, strict=True):
        if "." in name:
            effect, key = name.split(".")
            unit = next(p.unit for p in builtin()[effect].parameters if p.name == key)
            value = float(x @ size / (x @ x))
            rest = size - size.mean() - value * x
            alike = float(np.clip(rest[1:] @ rest[:-1] / max(float(rest @ rest), 1e-30), 0.0, 0.9))
            variance = float(rest @ rest) / (len(size) - 2) * (1.0 + alike) / (1.0 - alike)
            deviation = float(np.hypot(np.sqrt(variance / (x @ x)), _COLUMNS * value))
            slopes.append(Slope(name, value, deviation, unit))
    span = float(celsius.min()), float(celsius.max())
    return Drift(tuple(slopes), span, len(lit), f"{len(lit)} frames of {capture.name}")


def _frames_with_temperature(capture: Capture, temperatures: Path | None) -> list[Frame]:
    """Returns the frames that have a temperature, ordered by time. temperatures: as for calibrate_drift(); frames
    outside the file's range of time are left out."""
    frames = sorted((f for f in capture.frames if f.has_infrared), key=lambda f: f.timestamp_s)
    if temperatures is not None:
        try:
            rows = [line.split(",") for line in read_text(temperatures).splitlines() if line.strip()]
            table = np.array([(float(seconds), float(celsius)) for seconds, celsius in rows])
        except (OSError, ValueError) as error:
            raise ValueError(f"{temperatures}: is no CSV of seconds, celsius ({error})") from error
        if len(table) < 2 or not np.isfinite(table).all() or not np.all(np.diff(table[:, 0]) > 0.0):
            raise ValueError(f"{temperatures}: needs two rows or more of seconds, celsius, seconds rising")
        for celsius in table[:, 1]:
            TEMPERATURE.check(f"{temperatures}: a temperature", float(celsius))
        inside = [f for f in frames if table[0, 0] <= f.timestamp_s <= table[-1, 0]]
        frames = [replace(f, temperature_c=float(np.interp(f.timestamp_s, *table.T))) for f in inside]
    return [f for f in frames if f.temperature_c is not None]


def _columns(capture: Capture, frame: Frame, layers: dict[str, Layers]) -> tuple[list[str], Matrix, Matrix]:
    """Returns (names of the fitted parameters, derivative images [n, pixels of both cameras], weights of pixels). A
    derivative image is the images' change per unit of a parameter. layers: {side: dots' and room's light}."""
    focal_px, columns, light = capture.rig.left.K[0, 0], dict[str, list[Matrix]](), list[Matrix]()
    place_m = np.linalg.inv(capture.rig.projector.left_to_projector)[:3, 3]
    across_px, _ = cv2.phaseCorrelate(layers["right"][0], layers["left"][0])[0]
    nearness = max(across_px, 0.0) / (focal_px * capture.rig.baseline_m)  # 1/m, of what the dots light
    for side in SIDES:
        (dots, room), camera = layers[side], capture.rig.camera(side)
        both = dots + room
        row, column = np.indices((camera.height, camera.width), dtype=float)
        x, y = (column - camera.K[0, 2]) / camera.K[0, 0], (row - camera.K[1, 2]) / camera.K[1, 1]
        changes = {name: _per_kelvin(capture, frame, side, layers[side], name) for name in _EFFECTS}
        # Dots move by f t (1 + t^2) pixels when sines of the pattern's angles grow by one unit. t is the tangent at the
        # projector, of a surface at the mean distance: the camera's own would move the right image's centre.
        beside_m = capture.rig.baseline_m if side == "right" else 0.0
        from_x, from_y = x - (place_m[0] - beside_m) * nearness, y - place_m[1] * nearness
        grown = 1.0 + from_x**2 + from_y**2
        changes[_GROWTH] = _flow(dots, camera.K[0, 0] * from_x * grown, camera.K[1, 1] * from_y * grown)
        for axis, unit in (("x", (1.0, 0.0)), ("y", (0.0, 1.0))):
            changes[f"rig {axis}"], changes[f"dots {axis}"] = _flow(both, *unit), _flow(dots, *unit)
            # The mean blurs dots that move by a part of a pixel; their blur would pass for the laser's power.
            changes[f"blur {axis}"] = _flow(_flow(both, *unit), *unit)
        changes["right row"] = _flow(both, 0.0, float(side == "right"))
        changes["roll"] = _flow(both, -focal_px * y, focal_px * x)
        changes |= {"room light": room, "offset": np.ones_like(dots)}
        for name, image in changes.items():
            columns.setdefault(name, []).append(_picked(image))
        light.append(_picked(both))
    seen = np.concatenate(light)
    weight = np.where(seen < _FULL * capture.rig.max_dn, 1.0 / (_READ_DN2 + _SHOT_DN * np.maximum(seen, 0.0)), 0.0)
    return list(columns), np.stack([np.concatenate(parts) for parts in columns.values()]), weight


def _per_kelvin(capture: Capture, frame: Frame, side: str, layers: Layers, name: str) -> Matrix:
    """Computes the derivative of one camera's image [height, width] by an effect's parameter, with the sensor one
    kelvin warmer than the reference. name: 'effect.parameter'. layers: the dots' and the room's light, DN."""
    effect, key = builtin()[name.split(".")[0]], name.split(".")[1]
    typical = next(p.typical for p in effect.parameters if p.name == key)
    rig, nothing = capture.rig, np.zeros_like(layers[0])
    to_camera = np.eye(4) if side == "left" else rig.left_to_right
    view = View(
        side, rig.camera(side).K, nothing, np.zeros((*nothing.shape, 3)), rig.projector.pattern(), rig.projector.K,
        rig.projector.left_to_projector @ np.linalg.inv(to_camera), to_camera,
        replace(frame, temperature_c=REFERENCE_TEMPERATURE_C + 1.0), rig.max_dn,
        baseline_m=rig.baseline_m,
    )  # fmt: skip
    before = Light.of_images([layers[0], nothing, layers[1], nothing])
    after = acted(effect, effect.values({key: typical}), before, view)
    return np.asarray((after.images.sum(axis=0) - before.images.sum(axis=0)) / typical)


def _flow(image: Matrix, dx: Matrix | float, dy: Matrix | float) -> Matrix:
    """Computes the first-order change of an image whose content moves by (dx, dy) pixels, numbers or images."""
    down, across = (correlate1d(image, _DERIVATIVE, axis, mode="nearest") for axis in (0, 1))
    return np.asarray(-(dx * across + dy * down))


def _picked(image: Matrix) -> Matrix:
    return np.asarray(image[1:-1:_STEP_PX, 1:-1:_STEP_PX], float).ravel()
