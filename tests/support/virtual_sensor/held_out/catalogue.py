# SPDX-License-Identifier: Apache-2.0
"""Lists the effects that may be hidden in a world, each at four strengths: single effects, pairs, effects that no
library has, and depth engine faults.

A level multiplies the scaled parameters. Trial cases set the levels so that an effect's error on test frames, over the
noise floor and in quadrature, is about TARGETS (see oracle.py). Two effects change the noise itself; their levels are
chosen.
"""

from dataclasses import dataclass, field

import numpy as np

STRENGTHS = ("below", "weak", "medium", "strong")
TARGETS = (0.15, 0.4, 0.9, 2.0)


@dataclass(frozen=True)
class Entry:
    """An effect's parameters at four levels. scaled: at level 1; fixed: ranges; signed: the level's sign is drawn."""

    levels: tuple
    scaled: dict
    fixed: dict = field(default_factory=dict)
    signed: bool = False

    def draw(self, strength, rng):
        level = self.levels[strength] * np.exp(rng.uniform(-0.1, 0.1))
        if self.signed:
            level *= rng.choice([-1.0, 1.0])
        drawn = {name: float(rng.uniform(*bounds)) for name, bounds in self.fixed.items()}
        return {name: float(unit * level) for name, unit in self.scaled.items()} | drawn


SINGLE = {
    "projector_defocus": Entry((0.7, 1.4, 2.6, 4.6), {"aperture_px_m": 1.0}, {"focus_m": (1.3, 1.7)}),
    "pattern_scale_drift": Entry((0.23, 0.7, 1.7, 4.2), {"scale": 1e-3}, signed=True),
    "dot_gain_spread": Entry((0.5, 1.4, 3.1, 7), {"spread": 0.05}),
    "projector_vignetting": Entry((0.7, 2, 4.9, 11), {"exponent": 0.5}),
    "laser_power_drift": Entry((0.6, 1.7, 3.5, 5.2), {"per_k": -0.005}, {"per_s": (0.0, 0.0)}),
    "speckle_static": Entry((0.47, 1.3, 2.9, 6.6), {"contrast": 0.05}),
    "second_projector": Entry(
        (0.42, 1.2, 2.9, 6.8), {"power": 0.1}, {"on_rig": (-1, 1), "beside_m": (0.1, 0.3), "yaw_rad": (-0.15, 0.05)}
    ),
    "ambient_ir": Entry((0.6, 1.8, 4.5, 11), {"strength": 0.5}),
    "flicker_banding": Entry(
        (1.5, 3, 5, 6.5),
        {"depth": 0.1},
        {"frequency_hz": (100, 120), "phase_rad": (-3, 3), "line_time_s": (1e-5, 3e-5)},
    ),
    "specular": Entry((0.12, 0.3, 0.6, 0.9), {"f0": 0.05}, {"roughness": (0.25, 0.4), "everywhere": (-1, 1)}),
    "transmission": Entry((0.47, 1.2, 2.5, 5.4), {"share": 0.1}),
    "subsurface": Entry((0.5, 2, 6, 14), {"length_m": 1e-3}, {"everywhere": (-1, 1)}),
    "interreflection": Entry((0.7, 1.6, 3.4, 7), {"gain": 0.3}),
    "haze": Entry((0.24, 0.87, 2.5, 7.2), {"extinction_per_m": 0.05}),
    "vignetting": Entry((0.25, 1, 3, 9), {"exponent": 0.5}),
    "lens_psf": Entry((0.3, 0.8, 1.7, 3.5), {"sigma_px": 0.2}),
    "veiling_glare": Entry((1.1, 2.1, 3.5, 5), {"fraction": 0.1}),
    "chromatic_drift": Entry((0.3, 0.9, 2, 5), {"sigma_px_per_k": 0.01, "transmission_per_k": -1e-3}),
    "radial_distortion": Entry((0.32, 1, 2.4, 5.8), {"k1": 2e-3}, signed=True),
    "rectification_resampling": Entry((0.14, 0.47, 1.3, 3.3), {"phase_u_px": 0.1, "phase_v_px": 0.08}),
    "prnu": Entry((0.38, 1, 2.4, 4), {"sigma": 0.05}),
    "fixed_pattern_noise": Entry((0.32, 0.9, 2.1, 4.9), {"column_dn": 0.7, "row_dn": 0.7, "pixel_dn": 1.0}),
    "dark_signal": Entry((0.45, 1.2, 2.8, 6.3), {"rate_dn_per_s": 200.0}),
    "black_level": Entry((0.66, 1.8, 4, 8.9), {"per_k_dn": 0.1}),
    "saturation_blooming": Entry((1.2, 1.6, 2.1, 2.6), {"lost_range": 0.3}, {"spill": (0.3, 0.7)}),
    "response_gamma": Entry((0.3, 1.5, 5, 14), {"curvature": 0.5}),
    "gain_mismatch": Entry((0.6, 1.6, 3.5, 6), {"gain": 0.05, "offset_dn": 0.5}, signed=True),
    "quantisation": Entry((4, 7, 12, 20), {"step_dn": 1.0}),
    "rolling_shutter": Entry((1.2, 3.2, 6, 9), {"line_time_s": 1e-5}),
    "motion_blur": Entry((0.5, 1.2, 2.5, 5), {}, {"exposure_fraction": (1.0, 1.0)}),
    "exposure_desync": Entry((0.47, 1.6, 4.6, 12), {"delay_s": 1e-3}, signed=True),
    "hot_pixels": Entry((0.2, 1.2, 5, 20), {"share": 0.002}, {"rate_dn_per_s": (3000, 6000)}),
    "baseline_drift": Entry((0.8, 2.1, 4.8, 11), {"offset_m": 2e-4}, signed=True),
    "principal_point_offset": Entry((0.65, 1.8, 4.2, 9.5), {"cx_px": 0.05, "cy_px": 0.01}, signed=True),
    "stereo_pitch": Entry((0.49, 1.4, 3.3, 7.7), {"angle_rad": 5e-4}, signed=True),
    "stereo_roll": Entry((0.47, 1.3, 3.2, 7.5), {"angle_rad": 1e-3}, signed=True),
    "thermal_drift": Entry((0.6, 1.7, 4, 9), {"cx_px_per_k": 5e-3, "focal_per_k": 4e-5}, signed=True),
    "row_noise": Entry((0.6, 1.2, 2.4, 5.0), {"sigma_dn": 1.0}),
    "gain_error": Entry((0.7, 2, 4.5, 9), {"error": 0.05}, signed=True),
}
OUTSIDE = {
    "window_haze": Entry((0.67, 1.6, 3.4, 7), {"fraction": 0.1}),
    "row_desync": Entry((0.12, 0.6, 2.3, 8.8), {"delay_s": 5e-3}, signed=True),
    "thermal_lens": Entry((0.37, 1.1, 2.5, 5.8), {"growth": 1e-3}, {"time_constant_s": (4, 7)}, signed=True),
    "dot_astigmatism": Entry((0.56, 1.3, 2.7, 5.5), {"sigma_px": 1.0}),
    "column_crosstalk": Entry((0.44, 1.1, 2.4, 5.1), {"fraction": 0.1}),
    "image_lag": Entry((0.55, 1.5, 3.5, 7.9), {"fraction": 0.05}),
    "tap_gain": Entry((0.86, 2.4, 5, 8), {"gain": 0.05}),
    "pattern_shear": Entry((0.42, 1.1, 2.6, 5.9), {"angle_rad": 1e-3}, signed=True),
    "emitter_bands": Entry((0.79, 2, 4.4, 9.4), {"depth": 0.05}, {"cycles": (4.0, 7.0)}),
    "lens_dust": Entry((1, 2, 3, 4.5), {"depth": 0.2}),
    "column_smear": Entry((0.74, 2, 4.6, 8), {"fraction": 0.1}),
    "row_droop": Entry((0.57, 1.8, 4.5, 11), {"fraction": 0.1}),
}
# Effects of the library that are not in SINGLE.
WIDER = {
    "tangential_distortion": Entry((0.14, 0.46, 1.2, 3.2), {"p1": 1e-3, "p2": -7e-4}, signed=True),
    "thin_prism": Entry((0.65, 1.9, 4.4, 11.5), {"s1": 1e-3, "s3": 6e-4}, signed=True),
    "imager_tilt": Entry((0.3, 0.8, 1.9, 5.2), {"tau_x_rad": 2e-3, "tau_y_rad": 3e-3}, signed=True),
    "focus_mismatch": Entry((0.56, 1.06, 1.9, 5.5), {"sigma_px": 0.3}, signed=True),
    "lens_ghost": Entry((0.45, 1.3, 3.1, 7.3), {"fraction": 0.05}),
    "double_image": Entry(
        (0.67, 1.8, 4, 9), {"fraction": 0.05}, {"shift_u_px": (3.0, 7.0), "shift_v_px": (-3.0, 3.0)}
    ),
    "dim_dots": Entry(
        (0.6, 1.6, 3.5, 6), {"depth": 0.1, "per_k": 0.003},
        {"place_x": (-0.2, 0.2), "place_y": (-0.15, 0.15), "radius": (0.1, 0.2)},
    ),
}  # fmt: skip
# Faults of the device's own depth engine, which the infrared images do not show.
DEPTH_ENGINE = {
    "pixel_locking": Entry((0.02, 0.04, 0.08, 0.14), {"amplitude_px": 1.0}),
    "edge_fattening": Entry((3, 5, 7, 9), {"block_px": 1.0}),
    "foreshortening_bias": Entry((0.3, 0.6, 1.2, 2.4), {"px_per_slope": 1.0}),
    "post_filter": Entry((0.6, 1.0, 1.6, 2.5), {"sigma_px": 1.0}),
}
# Pairs whose signatures resemble each other.
TWINS = (
    ("baseline_drift", "principal_point_offset"),
    ("speckle_static", "prnu"),
    ("ambient_ir", "veiling_glare"),
    ("saturation_blooming", "response_gamma"),
    ("lens_psf", "projector_defocus"),
    ("vignetting", "projector_vignetting"),
    ("stereo_pitch", "stereo_roll"),
    ("dark_signal", "black_level"),
    ("hot_pixels", "fixed_pattern_noise"),
    ("rolling_shutter", "exposure_desync"),
    ("laser_power_drift", "chromatic_drift"),
)
# Filters of a device's firmware on good depth: they are no fault, and the tool must not name them.
FILTERS = {
    "temporal_filter": Entry((0.9, 0.7, 0.4, 0.2), {"weight": 1.0}),
    "hole_filling": Entry((2, 8, 32, 128), {"reach_px": 1.0}),
}
CATALOGUE = SINGLE | WIDER | OUTSIDE | DEPTH_ENGINE | FILTERS
# Effects on noise leave no signature in mean images, so that no pair with them could be found.
_PARTNERS = [name for name in SINGLE if name not in ("row_noise", "quantisation", "motion_blur")]


def pairs(count):
    """Returns `count` pairs of effects: first the similar ones in TWINS, then random partners; no pair occurs twice."""
    rng = np.random.Generator(np.random.PCG64(40))
    found = list(TWINS)
    while len(found) < count:
        order = rng.permutation(_PARTNERS)
        fresh = [tuple(map(str, pair)) for pair in zip(order[::2], order[1::2])]
        found += [pair for pair in fresh if set(pair) not in [set(p) for p in found]]
    return found[:count]


def draw_hidden(strengths, rng):
    """Draws parameters; strengths: {effect: index into STRENGTHS}. Returns ({effect: parameters}, moving exposure)."""
    hidden, moving_exposure = {}, 1 / 8
    for name, strength in strengths.items():
        hidden[name] = CATALOGUE[name].draw(strength, rng)
        if name == "motion_blur":
            moving_exposure = float(CATALOGUE[name].levels[strength])
    return hidden, moving_exposure
