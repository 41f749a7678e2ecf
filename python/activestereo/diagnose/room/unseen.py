# SPDX-License-Identifier: Apache-2.0
"""Predicts a held-out view from the other views, to prove the values that were measured on them.

Its slow light comes from the other views, its fine light from its own other camera, because no other view's dots are as
near. Dots are not taken out of the other views' light: where a texture passes for dots, that leaves more than the dots.
"""

from __future__ import annotations

import cv2
import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image
from activestereo.diagnose.room.bands import Looks, blur

_SMOOTH_PX, _SLOW_PX, _CLEAR_PX = 0.6, 3.0, 9
_MOST_GEOMETRY, _LEAST_GEOMETRY, _MOST_NEARER = 5.0, 0.02, 4.0


def unseen_rmse(room: Room, view: int, black_dn: float, exponent: float) -> float:
    """Returns the root mean square error in DN of one view's left image as the other views predict it, at half size;
    NaN if they see none of it. The prediction has a falloff cos^exponent and one free scale."""
    left, beside = room.images[2 * view], room.places(2 * view, 2 * view + 1)
    expected, known = _slow_from_others(room, view, black_dn, exponent)
    known &= beside.seen
    clear = cv2.erode(known.astype(np.uint8), np.ones((_CLEAR_PX,) * 2, np.uint8)) > 0
    if not clear.any():
        return float("nan")
    measured = blur(left.dn - np.float32(black_dn), _SMOOTH_PX)
    other = blur(beside.read(room.images[2 * view + 1].dn), _SMOOTH_PX)
    scale = np.vdot(blur(measured, _SLOW_PX)[clear], expected[clear]) / np.vdot(expected[clear], expected[clear])
    rest = measured - scale * expected - (other - blur(other, _SLOW_PX))
    return float(np.sqrt(np.mean(rest[clear] ** 2)))


def _slow_from_others(room: Room, view: int, black_dn: float, exponent: float) -> tuple[Image, np.ndarray]:
    """Returns (the left image's slow light as other views' left images predict it, a mask of the places that they see).
    The dots' share of a view's light changes with the distance from the projector."""
    own, number = room.images[2 * view], 2 * view
    total, weight = (np.zeros(room.shape, np.float32) for _ in range(2))
    for k, image in enumerate(room.images):
        if image.view == view or image.side == "right":
            continue
        there, looks, dn = room.places(number, k), Looks.of(image), image.dn - np.float32(black_dn)
        lens = (1.0 + image.r2()) ** np.float32(-0.5 * exponent) * np.float32(image.exposure / own.exposure)
        dots = 1.0 - looks.split(dn)[0][image.usable].mean() / dn[image.usable].mean()
        nearer = np.minimum(own.geometry, _MOST_GEOMETRY) / np.maximum(there.read(image.geometry), _LEAST_GEOMETRY)
        lit = 1.0 + np.clip(dots, 0.0, 1.0) * (np.minimum(nearer, _MOST_NEARER) - 1.0)
        total += there.read(lens * looks.even(dn)) * lit * there.seen
        weight += there.read(lens * lens) * there.seen
    gain = (1.0 + own.r2()) ** np.float32(-0.5 * exponent)
    return gain * total / np.maximum(weight, 1e-6), (weight > 0) & own.usable & (own.geometry > _LEAST_GEOMETRY)
