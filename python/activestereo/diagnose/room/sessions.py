# SPDX-License-Identifier: Apache-2.0
"""Deviations that good units show: from six sessions of a D415 (root mean squares of each column fitted alone; both
terms of radial distortion together), and from 24 single views of 17 rooms for differences of the two cameras.

Units are those of the parameters. A further effect is named only beyond them.
"""

# For an unknown unit: they include properties of its own lens and electronics.
OF_A_UNIT = {
    "focus_mismatch.sigma_px": 0.6,
    "radial_distortion.k1": 0.0094,
    "radial_distortion.k2": 0.0142,
    "tangential_distortion.p1": 0.0004,
    "tangential_distortion.p2": 0.00035,
    "lens_ghost.fraction": 0.0054,
    "veiling_glare.fraction": 0.031,
    "gain_mismatch.gain": 0.0141,
    "gain_mismatch.offset_dn": 0.26,
    "response_gamma.log_exponent": 0.16,
    "black_level.offset_dn": 0.22,
    "flicker_banding.depth": 0.014,
}
# Correlation of terms that one session cannot tell apart.
ALIKE = {("radial_distortion.k1", "radial_distortion.k2"): -0.98}
# Degrees of freedom behind an effect's deviations: a few sessions by default, more where single views tell them.
FEW = 5.0
FREEDOM = {"focus_mismatch": 16.0, "gain_mismatch": 16.0}
# Between sessions of one unit.
BETWEEN = OF_A_UNIT | {"focus_mismatch.sigma_px": 0.36, "gain_mismatch.gain": 0.0105}
# Share of one session's values that another session of the unit has, too.
SHARED = 0.5
# Between a session and a good one of the same views, from simulated rooms: no real camera has recorded its views twice.
SAME_PLACE = {
    "focus_mismatch.sigma_px": 0.2,
    "radial_distortion.k1": 0.002,
    "radial_distortion.k2": 0.0028,
    "tangential_distortion.p1": 0.00015,
    "tangential_distortion.p2": 0.00015,
    "lens_ghost.fraction": 0.002,
    "veiling_glare.fraction": 0.01,
    "gain_mismatch.gain": 0.005,
    "gain_mismatch.offset_dn": 0.1,
    "response_gamma.log_exponent": 0.006,
    "black_level.offset_dn": 0.2,
    "flicker_banding.depth": 0.005,
}
