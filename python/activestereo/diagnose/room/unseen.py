# SPDX-License-Identifier: Apache-2.0
"""Predicts a held-out view from the other views, to prove the values that were measured on them.

Its slow light comes from the other views, its fine light from its own other camera, because no other view's dots are as
near. Dots are not taken out of the other views' light: where a texture passes for dots, that leaves more than the dots.
The model's effects in the camera are taken out of all images, and put into the prediction.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import cv2
import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image, pixel_grid
from activestereo.diagnose.room.bands import LEAST_GEOMETRY, MOST_GEOMETRY, Looks, blur
from activestereo.diagnose.room.columns import acting, is_warp, view_of
from activestereo.effects import Effect

_SMOOTH_PX, _SLOW_PX, _CLEAR_PX = 0.6, 3.0, 9
_MOST_NEARER = 4.0
_INVERTED = 3  # rounds; more of them sharpen noise


@dataclass(frozen=True)
class Unseen:
    """One view's left image at half size, and as the other views predict it.

    frame: the view's id. measured, expected: DN [height][width], NaN in expected where they do not see it. off_axis:
    tangent of each pixel's angle to the optical axis. rmse_dn: NaN if they see none of it.
    """

    frame: int
    measured: Image
    expected: Image
    off_axis: Image
    rmse_dn: float


def predict_unseen(
    room: Room,
    views: Iterable[int],
    black_dn: float,
    exponent: float,
    effects: Sequence[tuple[Effect, Mapping[str, float]]] = (),
) -> list[Unseen]:
    """Predicts each of the views from the others, with one free scale, under a falloff cos^exponent and further effects
    in the camera, each with its parameters' values."""
    free = copy(room)
    free.images = [replace(i, dn=_without(room, k, black_dn, effects)) for k, i in enumerate(room.images)]
    return [_predicted(room, free, view, black_dn, exponent, effects) for view in views]


def _predicted(
    room: Room,
    free: Room,
    view: int,
    black_dn: float,
    exponent: float,
    effects: Sequence[tuple[Effect, Mapping[str, float]]],
) -> Unseen:
    """Predicts one view. free: the room as the camera would record it without the effects."""
    left, beside = free.images[2 * view], room.places(2 * view, 2 * view + 1)
    expected, known = _slow_from_others(free, view, black_dn, exponent)
    known &= beside.seen
    clear = cv2.erode(known.astype(np.uint8), np.ones((_CLEAR_PX,) * 2, np.uint8)) > 0
    own = blur(left.dn - np.float32(black_dn), _SMOOTH_PX)
    other = blur(beside.read(free.images[2 * view + 1].dn), _SMOOTH_PX)
    square = max(np.vdot(expected[clear], expected[clear]), 1e-6)
    scale = np.vdot(blur(own, _SLOW_PX)[clear], expected[clear]) / square
    light = np.where(clear, scale * expected + other - blur(other, _SLOW_PX), own)
    for effect, values in effects:
        light = acting(effect, values, light, view_of(room, 2 * view), black_dn)
    expected = np.where(clear, light, np.nan).astype(np.float32)
    measured = blur(room.images[2 * view].dn - np.float32(black_dn), _SMOOTH_PX)
    error = float(np.sqrt(np.mean((measured - expected)[clear] ** 2))) if clear.any() else float("nan")
    shown, off_axis = measured + np.float32(black_dn), np.sqrt(left.r2())
    return Unseen(room.frames[view].id, shown, expected + np.float32(black_dn), off_axis, error)


def _without(room: Room, k: int, black_dn: float, effects: Sequence[tuple[Effect, Mapping[str, float]]]) -> Image:
    """Returns image number k, DN, as the camera would record it without the effects: moved back by a warp's
    displacement, else by van Cittert's iteration."""
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
    return light + np.float32(black_dn)


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
        nearer = np.minimum(own.geometry, MOST_GEOMETRY) / np.maximum(there.read(image.geometry), LEAST_GEOMETRY)
        lit = 1.0 + np.clip(dots, 0.0, 1.0) * (np.minimum(nearer, _MOST_NEARER) - 1.0)
        total += there.read(lens * looks.even(dn)) * lit * there.seen
        weight += there.read(lens * lens) * there.seen
    gain = (1.0 + own.r2()) ** np.float32(-0.5 * exponent)
    return gain * total / np.maximum(weight, 1e-6), (weight > 0) & own.usable & (own.geometry > LEAST_GEOMETRY)
