# SPDX-License-Identifier: Apache-2.0
"""Measures a real camera: each part turns frames of something known into one section of model.json. README.md has the
commands and figures.

    noise     frames of static views        -> imager      calibrate/noise.py
    pattern   frames of a flat wall         -> pattern     calibrate/pattern.py
    rig       frames of a calibration board -> rig         calibrate/rig.py

Every failure of the input is a ValueError of one line: the file, the number, and the remedy."""
