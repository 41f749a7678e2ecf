# SPDX-License-Identifier: Apache-2.0
"""Changes by a flickering lamp between repeats: they are no noise, but the variance of repeats contains them.

A rolling shutter lays a lamp's brightness over time along the rows: in every row the ambient light is brighter or
darker by one factor, and neighbouring rows, which are exposed at nearly the same time, have nearly the same factor.
Noise that the pixels of a row share has another value in every row, and is left to the floor.
"""

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import uniform_filter1d

from activestereo.capture.capture import Frame, ImageKey
from activestereo.compare.noise import by_repeats
from activestereo.compare.nuisances import Images, regressors

# Neighbouring rows that are taken to see one brightness: 0.4 ms at 26 us a line, a twentieth of a period of 120 Hz.
_ROWS = 15
# Share of the rows' change that neighbours have to have in common; independent rows have 1 / _ROWS.
_COMMON = 0.5


def unsteady_light(measured_images: Mapping[ImageKey, tuple[Frame, Images, np.ndarray]]) -> dict[ImageKey, np.ndarray]:
    """{(frame id, side): DN [height][width]} by which a repeat's ambient light differs from its group's mean; of no
    repeat where neighbouring rows do not change together, or where one level for all pixels tells more.

    measured_images: {(frame id, side): (frame, its rendered light, measured DN [height][width])}.
    """
    found, lamp, level, all_rows = {}, 0.0, 0.0, 0.0
    for keys in by_repeats((frame, key[1], key) for key, (frame, *_) in measured_images.items()):
        mean = np.mean([measured_images[key][2] for key in keys], axis=0)
        for key in keys:
            frame, light, measured = measured_images[key]
            ambient = regressors(frame, light)[1]
            change = measured - mean
            found[key] = _common(change, ambient)
            lamp += float((found[key] ** 2).sum())
            level += float((_common(change, np.ones(ambient.shape)) ** 2).sum())
            all_rows += float((_common(change, ambient, 1) ** 2).sum())
    return found if lamp > max(_COMMON * all_rows, level) else {}


def _common(change: np.ndarray, light: np.ndarray, rows: int = _ROWS) -> np.ndarray:
    """The part of a change that neighbouring rows have in common: the light times one factor in each row."""
    moment, power = (uniform_filter1d((x * light).sum(axis=1), rows, mode="nearest") for x in (change, light))
    return (moment / np.maximum(power, 1e-12))[:, None] * light
