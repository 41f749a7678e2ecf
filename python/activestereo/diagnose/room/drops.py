# SPDX-License-Identifier: Apache-2.0
"""Finds places of one camera that are blurred in every view. Drops or dirt on its window stay while the rig turns, and
the view's other camera sees the same dots sharp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image
from activestereo.diagnose.room.bands import blur

_FINE_PX, _COARSE_PX, _AROUND_PX, _PLACE_PX = 0.6, 3.0, 3.0, 4.0
_LEAST_DN2, _NOISE_DN2, _MOST_LOG = 0.6, 0.03, 2.0
_LEAST_SEEN, BLURRED_LOG = 0.4, 0.5


@dataclass(frozen=True)
class Blurred:
    """Describes how blurred one camera (side) is in places, against the other one. Only places count that two or more
    views show. log_ratio: how far the worst place lies below the median sharpness, as a log ratio of high-frequency
    energy. share: blurred part of the image, 0..1."""

    side: str
    log_ratio: float
    share: float


def blurred_places(room: Room, exponent: float) -> list[Blurred]:
    """Returns a Blurred for each camera that two or more views allow to judge. exponent: n of the lens falloff cos^n,
    which is corrected because the cameras see a place at different angles."""
    maps = [_per_view(room, view, exponent) for view in range(room.views)]
    out = []
    for s, side in enumerate(("left", "right")):
        each = np.stack([m[s] for m in maps])
        often = np.isfinite(each).sum(axis=0) > 1
        if not often.any():
            continue
        mildest = np.nanmax(each[:, often], axis=0)
        middle = float(np.median(mildest))
        share = float((mildest < middle - BLURRED_LOG).mean())
        out.append(Blurred(side, middle - float(mildest.min()), share))
    return out


def _per_view(room: Room, view: int, exponent: float) -> tuple[Image, Image]:
    """Returns one sharpness map [height][width] for each camera (left, right): the log ratio of high-frequency energy
    to the other camera's at the same place. NaN = unknown."""
    images, places = room.images[2 * view : 2 * view + 2], room.places(2 * view, 2 * view + 1)
    energy = [blur((blur(i.dn, _FINE_PX) - blur(i.dn, _COARSE_PX)) ** 2, _AROUND_PX) for i in images]
    other = places.read(energy[1])
    known = places.seen & (energy[0] + other > _LEAST_DN2)
    if not known.any():
        nothing = np.full(room.shape, np.nan, np.float32)
        return nothing, nothing
    lens = [np.float32(-exponent) * np.log1p(image.r2()) for image in images]
    ratio = np.log((energy[0] + _NOISE_DN2) / (other + _NOISE_DN2)) - lens[0] + places.read(lens[1])
    ratio = np.clip(ratio - np.median(ratio[known]), -_MOST_LOG, _MOST_LOG)[known]
    row, column = np.nonzero(known)
    there = np.rint(places.row[known]).astype(int), np.rint(places.column[known]).astype(int)
    return _spread(room, row, column, ratio), _spread(room, *there, -ratio)


def _spread(room: Room, row: np.ndarray, column: np.ndarray, value: np.ndarray) -> Image:
    total, count = np.zeros(room.shape, np.float32), np.zeros(room.shape, np.float32)
    np.add.at(total, (row, column), value)
    np.add.at(count, (row, column), 1.0)
    near = blur(count, _PLACE_PX)
    return np.where(near > _LEAST_SEEN, blur(total, _PLACE_PX) / np.maximum(near, 1e-3), np.nan).astype(np.float32)
