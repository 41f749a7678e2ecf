# SPDX-License-Identifier: Apache-2.0
"""Turns light into digital numbers. Static fields come from the sensor's seed, noise from the frame's."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from virtual_sensor.held_out.rig import HEIGHT, REFERENCE_C, WIDTH

MAX_DN = 255
SHAPE = (HEIGHT, WIDTH)
_SIDES = ("left", "right")
_BOLTZMANN_EV, _ACTIVATION_EV = 8.617333e-5, 0.63
_SPECKLE_CELLS = 48


@dataclass(frozen=True)
class Sensor:
    """The imager's figures. projector_scale, ambient_scale: DN per second and radiance; speckle: contrast of the
    multiplicative noise; shot: DN of variance per DN at gain 1."""

    projector_scale: float
    ambient_scale: float
    black_dn: float
    read_dn: float
    shot: float
    speckle: float
    seed: int


def static_rng(sensor, tag, side=None, extra=0):
    number = 0 if side is None else 1 + _SIDES.index(side)
    return np.random.Generator(np.random.PCG64([sensor.seed, tag, number, extra]))


def expected(sensor, lights, frame, side, hidden, previous=None):
    """Returns the image in DN without temporal noise and rounding, clipped to the range. lights: (projector, ambient,
    other) images; hidden: {effect: {parameter: value}}; previous: the residue of the frame before, or None."""
    charge = _charge(sensor, lights, frame, side, hidden, previous)
    return np.clip(_digital(_read_out(charge, sensor, side, hidden), sensor, frame, hidden, rounded=False), 0, MAX_DN)


def exposed(sensor, lights, frame, side, hidden, previous=None, age=0):
    """Returns one noisy exposure as uint8. age: frames before the recorded one; the rest as in expected()."""
    key = [sensor.seed, 1000 + frame.id, 1 + _SIDES.index(side)] + [age] * (age > 0)
    rng = np.random.Generator(np.random.PCG64(key))
    k = 1.0 / sensor.speckle**2
    grain = rng.gamma(k, 1 / k, SHAPE)
    charge = _charge(sensor, tuple(light * grain for light in lights), frame, side, hidden, previous)
    charge = charge + np.sqrt(sensor.shot * frame.gain * np.maximum(charge, 0)) * rng.standard_normal(SHAPE)
    signal = _read_out(charge, sensor, side, hidden) + sensor.read_dn * rng.standard_normal(SHAPE)
    if "row_noise" in hidden:
        signal = signal + hidden["row_noise"]["sigma_dn"] * np.sqrt(3) * rng.uniform(-1, 1, (HEIGHT, 1))
    return np.clip(np.rint(_digital(signal, sensor, frame, hidden)), 0, MAX_DN).astype(np.uint8)


def collected(sensor, lights, frame, side, hidden):
    """Returns the DN of light alone, at the frame's exposure and true gain, without black level and noise."""
    projector, ambient, other = lights
    if "speckle_static" in hidden:
        projector = projector * _grain(sensor, frame, side, **hidden["speckle_static"])
    if "flicker_banding" in hidden:
        ambient = ambient * _flicker(frame, **hidden["flicker_banding"])[:, None]
    gain = frame.gain * (1.0 + hidden.get("gain_error", {}).get("error", 0.0) * (frame.gain != 1.0))
    light = sensor.projector_scale * (frame.power * projector + other) + sensor.ambient_scale * ambient
    return frame.exposure_s * gain * light


def _charge(sensor, lights, frame, side, hidden, previous):
    signal = collected(sensor, lights, frame, side, hidden)
    if previous is not None:
        signal = signal + previous
    if "prnu" in hidden:
        signal = signal * (
            1.0 + hidden["prnu"]["sigma"] * np.sqrt(3) * static_rng(sensor, 21, side).uniform(-1, 1, SHAPE)
        )
    if "tap_gain" in hidden:
        signal = signal * np.where(np.arange(WIDTH) < WIDTH // 2, 1.0, 1.0 + hidden["tap_gain"]["gain"])
    exposure = frame.exposure_s * frame.gain
    if "dark_signal" in hidden:
        signal = signal + hidden["dark_signal"]["rate_dn_per_s"] * exposure * _arrhenius(frame)
    if "hot_pixels" in hidden:
        signal = signal + exposure * _hot(sensor, side, **hidden["hot_pixels"])
    if "saturation_blooming" in hidden:
        signal = _bloomed(signal, **hidden["saturation_blooming"])
    if "column_smear" in hidden:
        signal = signal + hidden["column_smear"]["fraction"] * signal.mean(axis=0, keepdims=True)
    return signal


def _read_out(signal, sensor, side, hidden):
    if "column_crosstalk" in hidden:
        c = hidden["column_crosstalk"]["fraction"] * (np.arange(WIDTH) % 2)
        signal = (1 - c) * signal + c * np.roll(signal, 1, axis=1)
    if "response_gamma" in hidden:
        signal = tone(signal, hidden["response_gamma"]["curvature"])
    if "gain_mismatch" in hidden:
        half = 0.5 if side == "right" else -0.5
        signal = signal * (1.0 + half * hidden["gain_mismatch"]["gain"]) + half * hidden["gain_mismatch"]["offset_dn"]
    if "fixed_pattern_noise" in hidden:
        p, rng = hidden["fixed_pattern_noise"], static_rng(sensor, 22, side)
        for sigma, shape in ((p["column_dn"], (1, WIDTH)), (p["row_dn"], (HEIGHT, 1)), (p["pixel_dn"], SHAPE)):
            signal = signal + sigma * np.sqrt(3) * rng.uniform(-1, 1, shape)
    if "row_droop" in hidden:
        signal = signal - hidden["row_droop"]["fraction"] * signal.mean(axis=1, keepdims=True)
    return signal


def _digital(signal, sensor, frame, hidden, rounded=True):
    dn = signal + sensor.black_dn
    if "black_level" in hidden:  # Exponential in temperature, so that its first 20 K are per_k_dn each on average.
        dn = dn + hidden["black_level"]["per_k_dn"] * 20.0 * np.expm1(frame.warming_k / 30.0) / np.expm1(20.0 / 30.0)
    if "rectification_resampling" in hidden:
        for axis, name in ((1, "phase_u_px"), (0, "phase_v_px")):
            phase = hidden["rectification_resampling"][name]
            before = np.concatenate([np.take(dn, [0], axis), np.delete(dn, -1, axis)], axis)
            dn = (1 - phase) * dn + phase * before
    if "quantisation" in hidden and rounded:  # Mid-rise steps; the offset of half a step joins the black level.
        q = hidden["quantisation"]["step_dn"]
        dn = q * (np.floor(dn / q) + 0.5)
    return dn


def tone(signal, curvature):
    """Compresses a signal logarithmically; black and full scale stay fixed."""
    relative = np.maximum(signal, 0.0) / MAX_DN
    return MAX_DN * np.log1p(curvature * relative) / np.log1p(curvature)


def _arrhenius(frame):
    hot, cold = frame.temperature_c + 273.15, REFERENCE_C + 273.15
    return np.exp(_ACTIVATION_EV / _BOLTZMANN_EV * (1 / cold - 1 / hot))


def _hot(sensor, side, share, rate_dn_per_s):
    """Returns hot pixels' dark current, DN/s [height][width]: a share of pixels, log-normal of mean rate_dn_per_s."""
    rng = static_rng(sensor, 23, side)
    strength = np.exp(0.7 * rng.standard_normal(SHAPE) - 0.245)
    return np.where(rng.random(SHAPE) < share, strength, 0.0) * rate_dn_per_s


def _bloomed(signal, lost_range, spill):
    """Clips the signal at full well and spills the overflow along the column, up to two pixels far."""
    full = (1 - lost_range) * MAX_DN
    over = spill * np.maximum(signal - full, 0.0)
    value = np.minimum(signal, full)
    for shift, share in ((1, 0.36), (2, 0.14)):
        padded = np.pad(over, ((shift, shift), (0, 0)))
        value = value + share * (padded[: -2 * shift] + padded[2 * shift :])
    return np.minimum(value, full)


def _grain(sensor, frame, side, contrast):
    """Returns static speckle of mean 1 for each pose of the rig: sums of complex Gaussian fields through a pupil."""
    pose = int(np.abs(frame.camera_to_world[:3, 3] @ [7919, 104729, 1299709] * 1e3)) % 2**31
    rng = static_rng(sensor, 24, side, pose)
    cells = min(_SPECKLE_CELLS, max(1, round(1 / contrast**2)))
    total = np.zeros(SHAPE)
    for _ in range(cells):
        field = gaussian_filter(rng.standard_normal((2, *SHAPE)), (0, 0.45, 0.45), mode="wrap")
        total += (field**2).sum(axis=0)
    total /= total.mean()
    return np.maximum(1.0 + contrast * (total - 1.0) / total.std(), 0.0)


def _flicker(frame, depth, frequency_hz, phase_rad, line_time_s):
    """Returns each row's relative lamp light: a rectified sine, averaged over its exposure. depth: its amplitude."""
    row_time = frame.timestamp_s + (np.arange(HEIGHT) - (HEIGHT - 1) / 2) * line_time_s
    instants = row_time[:, None] + (np.arange(24) + 0.5 - 12) / 24 * frame.exposure_s
    wave = np.pi / 2 * np.abs(np.sin(np.pi * frequency_hz * instants + phase_rad / 2))
    return 1.0 + 1.5 * depth * (wave.mean(axis=1) - 1.0)
