# SPDX-License-Identifier: Apache-2.0
"""The light that is expected in every image of a room: what all images say of each cell, brought back to each image's
exposure and falloff."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image
from activestereo.diagnose.room.bands import Looks, blur

_SLOW_PX, _AGREE_PX, _NO_CONTRAST_DN2 = 3.0, 4.0, 0.01


@dataclass(frozen=True)
class RoomLight:
    """Images [image][height][width], DN above black at half size. gain: exposure times falloff. seen: as recorded;
    room: expected, without dots; dots: expected, of the projector alone; both: room and dots as both cameras of the
    view show them; lens: the exponent n of cos^n that the gain has."""

    gain: list[Image]
    seen: list[Image]
    room: list[Image]
    dots: list[Image]
    both: list[Image]
    looks: list[Looks]
    black_dn: float
    lens: float


def room_light(room: Room, black_dn: float, exponent: float) -> RoomLight:
    """The RoomLight of a room's images, under a black level and a falloff."""
    count = len(room.images)
    looks = [Looks.of(image) for image in room.images]
    gain = [(i.exposure * (1.0 + i.r2()) ** (-0.5 * exponent)).astype(np.float32) for i in room.images]
    seen = [image.dn - np.float32(black_dn) for image in room.images]
    split = [look.split(image) for look, image in zip(looks, seen, strict=True)]
    own = [s[0] for s in split]
    rooms, dots, both = [], [], []
    for k in range(count):
        rooms.append(_expected(room, k, own, gain))
        dots.append(np.maximum(looks[k].even(split[k][1]), 0.0) * room.images[k].dots)
        partner = room.places(k, k ^ 1)
        beside = partner.read(seen[k ^ 1])
        both.append(np.where(partner.seen, 0.5 * (seen[k] + beside), seen[k]).astype(np.float32))
    return RoomLight(gain, seen, rooms, dots, both, looks, black_dn, exponent)


def _expected(room: Room, k: int, own: list[Image], gain: list[Image]) -> Image:
    """Room light of image k: slow light of all images; of what is fine, as much as other views agree to, for noise and
    what dots leave would weaken every column that is made of it."""
    total, weight = gain[k] * own[k], gain[k] ** 2
    other, views = np.zeros_like(own[k]), np.zeros_like(own[k])
    fine = own[k] - blur(own[k], _SLOW_PX)
    for j in range(len(own)):
        if j == k:
            continue
        there = room.places(k, j)
        total = total + there.read(gain[j] * own[j]) * there.seen
        weight = weight + there.read(gain[j] ** 2) * there.seen
        if room.images[j].view != room.images[k].view:
            other += there.read((own[j] - blur(own[j], _SLOW_PX)) / gain[j]) * gain[k] * there.seen
            views += there.seen
    have = (views > 0).astype(np.float32)
    other = other / np.maximum(views, 1.0)
    product, square = blur(fine * other * have, _AGREE_PX), blur((fine**2 + other**2) * have, _AGREE_PX)
    agreed = np.clip(product / (0.5 * square + _NO_CONTRAST_DN2), 0.0, 1.0)
    slow = blur(gain[k] * total / weight, _SLOW_PX)
    return np.asarray(slow + have * agreed / (1.0 + agreed) * (fine + other), np.float32)
