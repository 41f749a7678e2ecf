# SPDX-License-Identifier: Apache-2.0
"""Deviations of what a good unit shows: four sessions of a D415 (root mean squares of what each column finds alone,
of radial distortion with both of its terms), the pair's gain, black level and glare of six.

Units are those of the parameters. A further effect is named against them.
"""

# Nothing is known of the unit: what its own lens and electronics have is in it.
OF_A_UNIT = {
    "focus_mismatch.sigma_px": 0.22,
    "radial_distortion.k1": 0.004,
    "radial_distortion.k2": 0.006,
    "tangential_distortion.p1": 0.0004,
    "tangential_distortion.p2": 0.0003,
    "lens_ghost.fraction": 0.0035,
    "veiling_glare.fraction": 0.1,
    "gain_mismatch.gain": 0.02,
    "gain_mismatch.offset_dn": 0.4,
    "response_gamma.log_exponent": 0.27,
    "black_level.offset_dn": 0.42,
    "flicker_banding.depth": 0.014,
}
# Between sessions of one unit.
BETWEEN = OF_A_UNIT | {
    "focus_mismatch.sigma_px": 0.1,
    "gain_mismatch.gain": 0.009,
    "veiling_glare.fraction": 0.09,
    "response_gamma.log_exponent": 0.08,
}
