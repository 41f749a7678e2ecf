# SPDX-License-Identifier: Apache-2.0
"""Fireflies: pixels that a few rare paths make far too bright, as no camera shows them.

A pixel of indirect light that is more than _FACTOR times its brightest neighbour is taken down to that neighbour. The
projector's direct light has no such pixels, and is left alone. What is taken away is lost: indirect light gets a little
darker (by less than a part in a thousand in the example scene), most where few samples meet caustics; more samples take
away less.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

_FACTOR = 1.5


def infrared_layers(
    pair: NDArray[np.float32], layers: Mapping[str, NDArray[np.float32]], laser_apart: bool, clamps: bool
) -> tuple[NDArray[np.float32] | None, NDArray[np.float32] | None]:
    """The laser's light in both eyes, (None, None) unless laser_apart.

    pair: radiance [2][height][width], whose indirect light is clamped in place where `clamps`; layers: kuafu's
    projector_direct and, for the laser, projector_indirect, [2, height, width, 1].
    """
    out: list[NDArray[np.float32] | None] = [None, None]
    for eye, image in enumerate(pair):
        if clamps:
            direct = layers["projector_direct"][eye, ..., 0]
            image[:] = direct + clamp_fireflies(np.maximum(image - direct, 0.0))
        if laser_apart:
            light = layers["projector_direct"][eye, ..., 0] + layers["projector_indirect"][eye, ..., 0]
            out[eye] = np.minimum(light, image)
    return out[0], out[1]


def clamp_fireflies(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """A copy of light [height][width] without lone bright pixels; pairs of them go by the second round."""
    for reach in (1, 2):
        image = np.where(image > _FACTOR * _brightest_around(image, reach), _brightest_around(image, reach), image)
    return image


def _brightest_around(image: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
    """The brightest of the eight pixels `reach` away, beyond the border the border's own."""
    height, width = image.shape
    padded = np.pad(image, reach, mode="reflect")
    offsets = [(y, x) for y in (0, reach, 2 * reach) for x in (0, reach, 2 * reach) if (y, x) != (reach, reach)]
    out = padded[:height, :width].copy()
    for y, x in offsets[1:]:
        np.maximum(out, padded[y : y + height, x : x + width], out=out)
    return out
