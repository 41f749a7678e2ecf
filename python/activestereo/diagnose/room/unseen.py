# SPDX-License-Identifier: Apache-2.0
"""Predicts a held-out view from the other views, to test the values that were estimated from them.

Its slow light comes from the other views. Its fine light comes from its own other camera, because no other view's dots
are as close to its own. Dots are not removed from the other views' light: if a texture passes for dots, their removal
leaves a larger error than the dots. The model's effects in the camera are removed from all images, and then applied to
the prediction.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import cv2
import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image, Mask, pixel_grid
from activestereo.diagnose.room.bands import LEAST_GEOMETRY, MOST_GEOMETRY, Looks, blur
from activestereo.diagnose.room.columns import acting, is_warp, view_of
from activestereo.diagnose.room.light import gains, mean_seen
from activestereo.effects import Effect

_SMOOTH_PX, _SLOW_PX, _CLEAR_PX = 0.6, 3.0, 9
_MOST_NEARER = 4.0
_INVERTED = 3  # rounds; more of them sharpen noise


@dataclass(frozen=True)
class Unseen:
    """One view's left image at half size, as recorded and as predicted from the other views.

    frame: the frame's id. measured, expected: DN [height][width]; expected is NaN where the other views see nothing.
    off_axis: tangent of each pixel's angle to the optical axis. rmse_dn: root mean square error, NaN without
    prediction.
    """

    frame: int
    measured: Image
    expected: Image
    off_axis: Image
    rmse_dn: float


Effects = Sequence[tuple[Effect, Mapping[str, float]]]


def predict_unseen(
    room: Room, views: Iterable[int], black_dn: float, exponent: float, effects: Effects = ()
) -> list[Unseen]:
    """Predicts each of the views from the others, up to one free scale per view; returns an Unseen for each. exponent:
    n of the lens falloff cos^n. effects: further effects in the camera with their parameters' values."""
    free = copy(room)
    free.images = [replace(i, dn=_without(room, k, black_dn, effects)) for k, i in enumerate(room.images)]
    gain, out = gains(room, exponent), []
    for view in views:
        left, beside = free.images[2 * view], room.places(2 * view, 2 * view + 1)
        expected, known = _slow_from_others(free, view, gain)
        clear = cv2.erode((known & beside.seen).astype(np.uint8), np.ones((_CLEAR_PX,) * 2, np.uint8)) > 0
        own, other = blur(left.dn, _SMOOTH_PX), blur(beside.read(free.images[2 * view + 1].dn), _SMOOTH_PX)
        square = max(np.vdot(expected[clear], expected[clear]), 1e-6)
        scale = np.vdot(blur(own, _SLOW_PX)[clear], expected[clear]) / square
        light = np.where(clear, scale * expected + other - blur(other, _SLOW_PX), own)
        for effect, values in effects:
            light = acting(effect, values, light, view_of(room, 2 * view), black_dn)
        shown = np.where(clear, light, np.nan).astype(np.float32) + np.float32(black_dn)
        measured = blur(room.images[2 * view].dn, _SMOOTH_PX)
        error = float(np.sqrt(np.mean((measured - shown)[clear] ** 2))) if clear.any() else float("nan")
        out.append(Unseen(room.frames[view].id, measured, shown, np.sqrt(left.r2()), error))
    return out


def _without(room: Room, k: int, black_dn: float, effects: Effects) -> Image:
    """Returns image k in DN above black as the camera would record it without the effects. Warps are undone by the
    opposite displacement, other effects by van Cittert's iteration."""
    view, light = view_of(room, k), room.images[k].dn - np.float32(black_dn)
    for effect, values in reversed(effects):
        if is_warp(effect):
            grid = pixel_grid(light.shape)
            back = [(2.0 * at - acting(effect, values, at, view, 0.0)).astype(np.float32) for at in grid]
            light = cv2.remap(light, *back, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
            continue
        seen = light
        for _ in range(_INVERTED):
            light = np.asarray(light + seen - acting(effect, values, light, view, black_dn), np.float32)
    return light


def _slow_from_others(free: Room, view: int, gain: list[Image]) -> tuple[Image, Mask]:
    """Returns (slow light of a view's left image as predicted from other left images, mask of the pixels that these
    see). free: the room with light above black. The dots' share of the light is corrected for the distance from the
    projector."""
    own, looks = free.images[2 * view], [Looks.of(image) for image in free.images]

    def lit(k: int) -> Image:
        image, there = free.images[k], free.places(2 * view, k)
        dots = 1.0 - looks[k].split(image.dn)[0][image.usable].mean() / image.dn[image.usable].mean()
        nearer = np.minimum(own.geometry, MOST_GEOMETRY) / np.maximum(there.read(image.geometry), LEAST_GEOMETRY)
        return 1.0 + np.clip(dots, 0.0, 1.0) * (np.minimum(nearer, _MOST_NEARER) - 1.0)

    slow = [looks[k].even(image.dn) for k, image in enumerate(free.images)]
    others = [k for k in range(0, len(free.images), 2) if k != 2 * view]
    expected, known = mean_seen(free, 2 * view, slow, gain, others, lit)
    return expected, (known > 0) & own.usable & (own.geometry > LEAST_GEOMETRY)
