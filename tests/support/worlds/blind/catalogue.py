"""What may be hidden in a world: every effect at four strengths, pairs, effects that no library has, depth-engine faults.

A level multiplies the scaled parameters; the four were measured on trial worlds so that the error they leave on test frames,
over the noise floor and in quadrature, is about TARGETS (see oracle.py). Two effects change the noise itself: theirs are chosen.
"""

from dataclasses import dataclass, field

import numpy as np

STRENGTHS = ("below", "weak", "medium", "strong")
TARGETS = (0.15, 0.4, 0.9, 2.0)


@dataclass(frozen=True)
class Entry:
    """scaled: parameters at level 1; fixed: ranges to draw from; signed: the level's sign is drawn, too."""

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
    "projector_defocus": Entry((1, 2, 4, 8), {"aperture_px_m": 1.0}, {"focus_m": (1.3, 1.7)}),
    "pattern_scale_drift": Entry((1, 2, 4, 8), {"scale": 1e-3}, signed=True),
    "dot_gain_spread": Entry((1, 2, 4, 8), {"spread": 0.05}),
    "projector_vignetting": Entry((1, 2, 4, 8), {"exponent": 0.5}),
    "laser_power_drift": Entry((1, 2, 4, 8), {"per_k": -0.005}, {"per_s": (0.0, 0.0)}),
    "speckle_static": Entry((1, 2, 4, 8), {"contrast": 0.05}),
    "second_projector": Entry((1, 2, 4, 8), {"power": 0.1}),
    "ambient_ir": Entry((1, 2, 4, 8), {"strength": 0.5}),
    "flicker_banding": Entry((1, 2, 4, 8), {"depth": 0.1}, {"frequency_hz": (100, 120), "phase_rad": (-3, 3), "line_time_s": (1e-5, 3e-5)}),
    "specular": Entry((1, 2, 4, 8), {"f0": 0.05}, {"roughness": (0.3, 0.45)}),
    "transmission": Entry((1, 2, 4, 8), {"share": 0.1}),
    "subsurface": Entry((1, 2, 4, 8), {"length_m": 1e-3}),
    "interreflection": Entry((1, 2, 4, 8), {"gain": 0.3}),
    "haze": Entry((1, 2, 4, 8), {"extinction_per_m": 0.05}),
    "vignetting": Entry((1, 2, 4, 8), {"exponent": 0.5}),
    "lens_psf": Entry((1, 2, 4, 8), {"sigma_px": 0.2}),
    "veiling_glare": Entry((1, 2, 4, 8), {"fraction": 0.1}),
    "chromatic_drift": Entry((1, 2, 4, 8), {"sigma_px_per_k": 0.02}, {"transmission_per_k": (-0.003, -0.001)}),
    "radial_distortion": Entry((1, 2, 4, 8), {"k1": 2e-3}, signed=True),
    "rectification_resampling": Entry((1, 2, 4, 8), {"phase_u_px": 0.1, "phase_v_px": 0.08}),
    "prnu": Entry((1, 2, 4, 8), {"sigma": 0.05}),
    "fixed_pattern_noise": Entry((1, 2, 4, 8), {"column_dn": 0.7, "row_dn": 0.7, "pixel_dn": 1.0}),
    "dark_signal": Entry((1, 2, 4, 8), {"rate_dn_per_s": 200.0}),
    "black_level": Entry((1, 2, 4, 8), {"per_k_dn": 0.1}),
    "saturation_blooming": Entry((1, 1.5, 2, 3), {"lost_range": 0.3}, {"spill": (0.3, 0.7)}),
    "response_gamma": Entry((1, 2, 4, 8), {"curvature": 0.5}),
    "gain_mismatch": Entry((1, 2, 4, 8), {"gain": 0.05, "offset_dn": 0.5}, signed=True),
    "quantisation": Entry((4, 7, 12, 20), {"step_dn": 1.0}),
    "rolling_shutter": Entry((1, 2, 4, 8), {"line_time_s": 1e-5}),
    "motion_blur": Entry((1, 2, 4, 8), {}, {"exposure_fraction": (1.0, 1.0)}),
    "exposure_desync": Entry((1, 2, 4, 8), {"delay_s": 1e-3}, signed=True),
    "hot_pixels": Entry((1, 2, 4, 8), {"share": 0.002}, {"rate_dn_per_s": (3000, 6000)}),
    "baseline_drift": Entry((1, 2, 4, 8), {"offset_m": 2e-4}, signed=True),
    "principal_point_offset": Entry((1, 2, 4, 8), {"cx_px": 0.05, "cy_px": 0.01}, signed=True),
    "stereo_pitch": Entry((1, 2, 4, 8), {"angle_rad": 5e-4}, signed=True),
    "stereo_roll": Entry((1, 2, 4, 8), {"angle_rad": 1e-3}, signed=True),
    "thermal_drift": Entry((1, 2, 4, 8), {"cx_px_per_k": 5e-3, "focal_per_k": 4e-5}, signed=True),
    "row_noise": Entry((0.6, 1.2, 2.4, 5.0), {"sigma_dn": 1.0}),
    "gain_error": Entry((1, 2, 4, 8), {"error": 0.05}, signed=True),
}
OUTSIDE = {
    "window_haze": Entry((1, 2, 4, 8), {"fraction": 0.1}),
    "row_desync": Entry((1, 2, 4, 8), {"delay_s": 5e-3}, signed=True),
    "thermal_lens": Entry((1, 2, 4, 8), {"growth": 1e-3}, {"time_constant_s": (4, 7)}, signed=True),
    "dot_astigmatism": Entry((1, 2, 4, 8), {"sigma_px": 1.0}),
    "column_crosstalk": Entry((1, 2, 4, 8), {"fraction": 0.1}),
    "ghost_image": Entry((1, 2, 4, 8), {"fraction": 0.05}),
    "image_lag": Entry((1, 2, 4, 8), {"fraction": 0.05}),
    "tap_gain": Entry((1, 2, 4, 8), {"gain": 0.05}),
    "pattern_rotation": Entry((1, 2, 4, 8), {"angle_rad": 1e-3}, signed=True),
    "tangential_distortion": Entry((1, 2, 4, 8), {"p1": 1e-3, "p2": -7e-4}, signed=True),
    "emitter_bands": Entry((1, 2, 4, 8), {"depth": 0.05}, {"cycles": (4.0, 7.0)}),
    "lens_dust": Entry((1, 2, 4, 8), {"depth": 0.2}),
    "column_smear": Entry((1, 2, 4, 8), {"fraction": 0.1}),
    "row_droop": Entry((1, 2, 4, 8), {"fraction": 0.1}),
}
