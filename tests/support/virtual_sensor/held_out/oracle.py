# SPDX-License-Identifier: Apache-2.0
"""Bounds of the best model of a world: its own noise, and the error without the hidden effects."""

import numpy as np

from virtual_sensor.held_out.imager import MAX_DN, tone
from virtual_sensor.held_out.optics import shading

SIDES = ("left", "right")


def errors(world, images):
    """Returns {split: {floor_dn, before_dn, ratio}}. floor_dn: RMSE of the true model. before_dn: RMSE without hidden
    effects, after projector scale, ambient scale and black level are fitted to the train frames. ratio: root of the
    excess square, over the floor."""
    scales = _fit(world, images)
    figures = {}
    for split in ("train", "test"):
        floor, before = [], []
        for frame in (f for f in world.frames if f.split == split):
            for side in SIDES:
                measured = images[frame.id, side].astype(np.float64)
                floor.append(np.mean((measured - world.expected(frame, side, world.hidden)) ** 2))
                model = np.clip(scales @ _columns(world, frame, side), 0, MAX_DN)
                before.append(np.mean((measured - model.reshape(measured.shape)) ** 2))
        floor, before = np.sqrt(np.mean(floor)), np.sqrt(np.mean(before))
        ratio = np.sqrt(max(0.0, before**2 - floor**2)) / floor
        figures[split] = {"floor_dn": float(floor), "before_dn": float(before), "ratio": float(ratio)}
    return figures


def ratio_alone(world, name, floor_dn):
    """Returns errors()' ratio on test frames as if the world hid only the effect `name`."""
    hidden = {name: world.hidden[name]}
    images = {(frame.id, side): world.expected(frame, side, hidden) for frame in world.frames for side in SIDES}
    scales, tests = (
        _fit(world, images),
        [(frame, side) for frame in world.frames if frame.split == "test" for side in SIDES],
    )
    rest = [images[f.id, e].ravel() - np.clip(scales @ _columns(world, f, e), 0, MAX_DN) for f, e in tests]
    return float(np.sqrt(np.mean(np.square(rest))) / floor_dn)


def _fit(world, images):
    columns, values = [], []
    for frame in (f for f in world.frames if f.split == "train"):
        for side in SIDES:
            columns.append(_columns(world, frame, side))
            values.append(images[frame.id, side].ravel())
    return np.linalg.lstsq(np.concatenate(columns, axis=1).T, np.concatenate(values).astype(np.float64), rcond=None)[0]


def _columns(world, frame, side):
    projector, ambient, _ = world.lights(frame, side, {})
    exposure = frame.exposure_s * frame.gain
    return np.stack([exposure * frame.power * projector.ravel(), exposure * ambient.ravel(), np.ones(ambient.size)])


def scored_parameters(world):
    """Returns {hidden effect: {parameter: true value}} on which a tool is scored; parameters are the lab library's."""
    return {name: _scored(world, name, dict(values)) for name, values in world.hidden.items()}


def _best_power(x, y, exponents):
    """Returns the exponent e among `exponents` whose multiple of x^e fits y best."""
    misfit = [np.sum((y - x**e * (y @ x**e) / (x**e @ x**e)) ** 2) for e in exponents]
    return exponents[int(np.argmin(misfit))]


def _scored(world, name, values):
    if name == "response_gamma":  # The power law that best fits the true curve over the first frame's own signal.
        signal = world.expected(world.frames[0], "left", {}) - world.sensor.black_dn
        x = signal[signal > 0.5]
        return {"log_exponent": float(np.log(_best_power(x, tone(x, values["curvature"]), np.linspace(0.3, 1.2, 181))))}
    if name == "vignetting":  # The power of cos that fits the true falloff best over the image.
        falloff, squared_cosine = (
            shading("left", {name: {"exponent": n}}, world.rig).ravel() for n in (values["exponent"], 2.0)
        )
        return {"exponent": 2.0 * float(_best_power(squared_cosine, falloff, np.linspace(0.0, 4.0, 801)))}
    if name == "gain_error":  # The gain's error as a power of the nominal gain.
        gain = max(frame.gain for frame in world.frames)
        return {"log_gain": float(np.log1p(values["error"]) / np.log(gain))}
    if name == "projector_defocus":  # The radius; hidden is the diameter of the disc of equal second moment.
        return {"aperture_px_m": values["aperture_px_m"] / 2}
    if name == "subsurface":  # The rms distance along one axis; hidden is the length of exp(-r / length).
        return {"length_m": float(np.sqrt(3.0) * values["length_m"])}
    main = {
        "flicker_banding": ("depth",),
        "chromatic_drift": ("sigma_px_per_k",),
        "saturation_blooming": ("lost_range",),
        "laser_power_drift": ("per_k",),
        "thermal_drift": ("cx_px_per_k",),
        "principal_point_offset": ("cx_px",),
        "fixed_pattern_noise": ("pixel_dn",),
        "gain_mismatch": ("gain",),
        "hot_pixels": ("share",),
        "specular": ("roughness",),
        "dark_signal": ("rate_dn_per_s",),
    }
    # Lamps, second projectors and clear walls have no parameter that every model would name alike.
    free = {"ambient_ir", "second_projector", "transmission", "edge_fattening", "foreshortening_bias", "post_filter"}
    free |= {"temporal_filter", "hole_filling"}
    return {} if name in free else {k: values[k] for k in main.get(name, values)}
