# SPDX-License-Identifier: Apache-2.0
"""The spread of good units: root mean squares of each column's coefficient, fitted alone, over seven sessions of a
D415. Both terms of radial distortion are fitted together.

Units are those of the parameters. A further effect is named only beyond this spread. The spread of flicker bands with c
cycles over an image is the value divided by 1 + c^2, as six clean rooms show.
"""

# For a unit without reference: these include properties of its own lens and electronics.
OF_A_UNIT = {
    "focus_mismatch.sigma_px": 0.46,
    "radial_distortion.k1": 0.019,
    "radial_distortion.k2": 0.03,
    "tangential_distortion.p1": 0.00063,
    "tangential_distortion.p2": 0.00058,
    "lens_ghost.fraction": 0.0053,
    "veiling_glare.fraction": 0.034,
    "gain_mismatch.gain": 0.0141,
    "gain_mismatch.offset_dn": 0.27,
    "response_gamma.log_exponent": 0.16,
    "black_level.offset_dn": 0.17,
    "flicker_banding.depth": 0.08,
}
# Correlation of terms that one session cannot tell apart.
ALIKE = {("radial_distortion.k1", "radial_distortion.k2"): -0.98}
# Degrees of freedom behind an effect's deviations: one for each session; more for gain, for 24 single views of the unit
# agree with its sessions. In blur they do not: single views deviate by 0.82.
FEW = 7.0
FREEDOM = {"gain_mismatch": 16.0}
# Between sessions of one unit: single views scatter about their own mean by 0.41 px and 0.0108.
BETWEEN = OF_A_UNIT | {"focus_mismatch.sigma_px": 0.41, "gain_mismatch.gain": 0.0108}
# Share of one session's values that another session of the unit has, too.
SHARED = 0.5
# Between a session and a good one of the same views. No real camera has recorded its views twice: three pairs of drawn
# rooms deviate as much in distortion and response, and less in all else: by a seventh in blur, by half in black levels.
SAME_PLACE = {
    "focus_mismatch.sigma_px": 0.2,
    "radial_distortion.k1": 0.0048,
    "radial_distortion.k2": 0.0087,
    "tangential_distortion.p1": 0.0004,
    "tangential_distortion.p2": 0.0004,
    "lens_ghost.fraction": 0.002,
    "veiling_glare.fraction": 0.01,
    "gain_mismatch.gain": 0.005,
    "gain_mismatch.offset_dn": 0.1,
    "response_gamma.log_exponent": 0.012,
    "black_level.offset_dn": 0.2,
    "flicker_banding.depth": 0.02,
}
