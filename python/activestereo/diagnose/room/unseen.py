# SPDX-License-Identifier: Apache-2.0
"""Predicts a held-out view from the other views, to prove the values that were measured on them.

Its light comes from the other views, its dots from its own other camera, because no other view's dots are as near.
"""

from __future__ import annotations

import cv2
import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image
from activestereo.diagnose.room.bands import Looks, blur

_SMOOTH_PX, _SLOW_PX, _CLEAR_PX = 0.6, 3.0, 9
_MOST_GEOMETRY, _LEAST_GEOMETRY = 5.0, 0.02


def unseen_rmse(room: Room, view: int, black_dn: float, exponent: float) -> float:
    """Returns the root mean square error in DN of one view's left image as the other views predict it, at half size;
    NaN if they see none of it. The prediction has a falloff cos^exponent and one free scale."""
    left, beside = room.images[2 * view], room.places(2 * view, 2 * view + 1)
    expected, known = _predict_from_others(room, view, black_dn, exponent)
    known &= beside.seen
    clear = cv2.erode(known.astype(np.uint8), np.ones((_CLEAR_PX,) * 2, np.uint8)) > 0
    if not clear.any():
        return float("nan")
    measured = blur(left.dn - np.float32(black_dn), _SMOOTH_PX)
    other = blur(beside.read(room.images[2 * view + 1].dn), _SMOOTH_PX)
    scale = np.float32((measured * expected)[clear].sum() / (expected**2)[clear].sum())
    rest = measured - blur(scale * expected, _SLOW_PX) - (other - blur(other, _SLOW_PX))
    return float(np.sqrt(np.mean(rest[clear] ** 2)))


def _predict_from_others(room: Room, view: int, black_dn: float, exponent: float) -> tuple[Image, np.ndarray]:
    """Returns (the left image as other views' left images predict it, a mask of the places that they see)."""
    own = room.images[2 * view]
    gain = (1.0 + own.r2()) ** np.float32(-0.5 * exponent)
    sums = np.zeros((4, *room.shape), np.float32)
    for k in range(0, len(room.images), 2):
        image = room.images[k]
        if image.view == view:
            continue
        there, lens = room.places(2 * view, k), (1.0 + image.r2()) ** np.float32(-0.5 * exponent)
        light, amplitude = Looks.of(image).split(image.dn - np.float32(black_dn))
        lens *= np.float32(image.exposure / own.exposure)
        lit = lens * np.minimum(image.geometry, _MOST_GEOMETRY)
        for j, (value, weight) in enumerate(((light, lens), (np.maximum(amplitude, 0.0), lit))):
            sums[2 * j] += there.read(weight * value) * there.seen
            sums[2 * j + 1] += there.read(weight * weight) * there.seen
    light, amplitude = (sums[j] / np.maximum(sums[j + 1], 1e-6) for j in (0, 2))
    expected = gain * (light + amplitude * np.minimum(own.geometry, _MOST_GEOMETRY) * own.dots)
    return np.asarray(expected, np.float32), (sums[1] > 0) & own.usable & (own.geometry > _LEAST_GEOMETRY)
