# SPDX-License-Identifier: Apache-2.0
"""Measures a real camera: each part turns frames of something known into one section of model.json. README.md has the
commands and figures.

Every failure of the input is a ValueError of one line: the file, the number, and the remedy."""
