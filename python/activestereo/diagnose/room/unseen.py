# SPDX-License-Identifier: Apache-2.0
"""A view that was held out, as the others say it looks: the proof of what was measured on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image
from activestereo.diagnose.room.bands import Looks, blur

_SMOOTH_PX = 0.6


@dataclass(frozen=True)
class Unseen:
    """Root mean squares in DN of a held-out view's left image, at half size: what other views leave of it under a
    falloff, dots by the pattern; what the same view's right image leaves; and the share of its pixels that others
    see."""

    frame: int
    by_other_views: float
    by_other_eye: float
    seen: float


def unseen(room: Room, view: int, black_dn: float, exponent: float) -> Unseen:
    """The Unseen of one view of a room, predicted by all others."""
    left = room.images[2 * view]
    measured = blur(left.dn - np.float32(black_dn), _SMOOTH_PX)
    expected, known = _expected(room, view, black_dn, exponent)
    scale = float((measured * expected)[known].sum() / (expected**2)[known].sum())
    error = _rms(measured - scale * expected, known)
    there = room.places(2 * view, 2 * view + 1)
    beside = blur(there.read(room.images[2 * view + 1].dn - np.float32(black_dn)), _SMOOTH_PX)
    both = there.seen & known
    scale = float((measured * beside)[both].sum() / (beside**2)[both].sum())
    other = _rms(measured - scale * beside, both)
    return Unseen(left.frame.id, error, other, float(known.mean()))


def _rms(rest: Image, known: np.ndarray) -> float:
    return float(np.sqrt(np.mean(rest[known] ** 2)))


def _expected(room: Room, view: int, black_dn: float, exponent: float) -> tuple[Image, np.ndarray]:
    """(the left image by other views' left ones, where it is known)."""
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
        lit = lens * np.minimum(image.geometry, 5.0)
        for j, (value, weight) in enumerate(((light, lens), (np.maximum(amplitude, 0.0), lit))):
            sums[2 * j] += there.read(weight * value) * there.seen
            sums[2 * j + 1] += there.read(weight * weight) * there.seen
    light, amplitude = (sums[j] / np.maximum(sums[j + 1], 1e-6) for j in (0, 2))
    expected = gain * (light + amplitude * np.minimum(own.geometry, 5.0) * own.dots)
    return blur(expected, _SMOOTH_PX), (sums[1] > 0) & own.usable & (own.geometry > 0.02)
