# SPDX-License-Identifier: Apache-2.0
"""Measures a real camera: each part turns frames of something known into one section of model.json. README.md has the
commands and figures.

    noise     repeats of a static view      -> imager      calibrate/noise.py
              even light by EMVA 1288       -> imager      calibrate/emva1288.py
    pattern   frames of a flat wall         -> pattern     calibrate/pattern.py
    rig       frames of a calibration board -> rig         calibrate/rig.py

Every failure of the input is a ValueError of one line: the file, the number, and the remedy."""
