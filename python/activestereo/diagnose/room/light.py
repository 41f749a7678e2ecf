# SPDX-License-Identifier: Apache-2.0
"""Estimates the expected light in every image of a room: the mean over all images that see a surface, at each image's
exposure and lens falloff."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image
from activestereo.diagnose.room.bands import MOST_GEOMETRY, Looks, blur

_SLOW_PX, _AGREE_PX, _NO_CONTRAST_DN2 = 3.0, 4.0, 0.01
_LEAST_WEIGHT = 1e-6


@dataclass(frozen=True)
class RoomLight:
    """The light of a room's images. Each list has one array [height][width] per image, in DN above black at half size.
    gain: exposure times lens falloff, without unit. seen: recorded. room: expected without dots. dots: expected dots
    alone. both: mean of the view's two cameras, as recorded. looks: each image's band filters. black_dn: the black
    level. lens: n of the falloff cos^n."""

    gain: list[Image]
    seen: list[Image]
    room: list[Image]
    dots: list[Image]
    both: list[Image]
    looks: list[Looks]
    black_dn: float
    lens: float


def room_light(room: Room, black_dn: float, exponent: float) -> RoomLight:
    """Returns the expected light of a room's images for a black level in DN and a lens falloff cos^exponent."""
    count = len(room.images)
    looks = [Looks.of(image) for image in room.images]
    gain = gains(room, exponent)
    lit = [g * np.minimum(i.geometry, MOST_GEOMETRY) for g, i in zip(gain, room.images, strict=True)]
    seen = [image.dn - np.float32(black_dn) for image in room.images]
    split = [look.split(image) for look, image in zip(looks, seen, strict=True)]
    own, amplitude = [s[0] for s in split], [look.even(s[1]) for look, s in zip(looks, split, strict=True)]
    rooms, dots, both = [], [], []
    for k in range(count):
        rooms.append(_expected(room, k, own, gain))
        dots.append(np.maximum(mean_seen(room, k, amplitude, lit)[0], 0.0) * room.images[k].dots)
        partner = room.places(k, k ^ 1)
        beside = partner.read(seen[k ^ 1])
        both.append(np.where(partner.seen, 0.5 * (seen[k] + beside), seen[k]).astype(np.float32))
    return RoomLight(gain, seen, rooms, dots, both, looks, black_dn, exponent)


def gains(room: Room, exponent: float) -> list[Image]:
    """Returns each image's exposure times its lens falloff cos^exponent, [height][width]."""
    return [(i.exposure * (1.0 + i.r2()) ** (-0.5 * exponent)).astype(np.float32) for i in room.images]


def _expected(room: Room, k: int, own: list[Image], gain: list[Image]) -> Image:
    """Returns the room light expected in image k, DN [height][width], without dots. It is the blurred mean of all
    images at k's pixels, plus fine light weighted by how well image k agrees with other views. Fine light that no other
    view confirms is noise or remains of dots, and would weaken every column computed from it. own: each image's light
    without dots and black level. gain: as in RoomLight."""
    fine = [image - blur(image, _SLOW_PX) for image in own]
    mean, _ = mean_seen(room, k, own, gain)
    fine_mean, _ = mean_seen(room, k, fine, gain)
    view = room.images[k].view
    other, have = mean_seen(room, k, fine, gain, [j for j in range(len(own)) if room.images[j].view != view])
    product, square = blur(fine[k] * other * have, _AGREE_PX), blur((fine[k] ** 2 + other**2) * have, _AGREE_PX)
    agreed = np.clip(product / (0.5 * square + _NO_CONTRAST_DN2), 0.0, 1.0)
    return np.asarray(blur(mean, _SLOW_PX) + have * 2.0 * agreed / (1.0 + agreed) * fine_mean, np.float32)


def mean_seen(
    room: Room, k: int, of: list[Image], gain: list[Image], images: Sequence[int] | None = None,
    lit: Callable[[int], Image] = lambda j: np.ones(1, np.float32),
) -> tuple[Image, Image]:  # fmt: skip
    """Returns (mean of the images `of` at the pixels of image k, scaled to the gain of image k; mask, 1 where it is
    known). All images have equal weights for every k; otherwise each column would contain its own image's errors.
    images: the indices to average, None = all. lit(j): a factor on the light of image j at the pixels of image k."""
    total, weight = np.zeros_like(of[k]), np.zeros_like(of[k])
    for j in range(len(of)) if images is None else images:
        if j == k:
            total, weight = total + gain[k] * of[k], weight + gain[k] ** 2
        else:
            there = room.places(k, j)
            total = total + there.read(gain[j] * of[j]) * lit(j) * there.seen
            weight = weight + there.read(gain[j] ** 2) * there.seen
    return np.asarray(gain[k] * total / np.maximum(weight, _LEAST_WEIGHT)), (weight > _LEAST_WEIGHT).astype(np.float32)
