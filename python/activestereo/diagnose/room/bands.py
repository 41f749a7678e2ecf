# SPDX-License-Identifier: Apache-2.0
"""Splits an image of a room into four bands, each with errors of its own.

slow    the room's smooth light: shows exposure, falloff, glare, tone
fine    the room's light at edges and textures: shows registration, blur
dots    the amplitude of the dots, a second light on the same surfaces
pair    all fine light, for the two cameras of one view: they see the same dots
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from activestereo.calibrate.world.cells import RoomImage
from activestereo.calibrate.world.views import Image

BANDS = ("slow", "fine", "dots", "pair")
_FAST_PX, _AMPLITUDE_PX, _SLOW_PX = 2.0, 4.5, 3.0
_FINE_PX, _PAIR_PX = 0.8, 1.2
_LEAST_DOTS, _LEAST_USABLE = 2e-4, 0.05
# The least projector light at which dots are measured, and the value at which it is capped, 1/m^2.
LEAST_GEOMETRY, MOST_GEOMETRY = 0.02, 5.0


def blur(image: Image, sigma_px: float) -> Image:
    """Returns an image under a Gaussian blur that mirrors the border."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT), np.float32)


@dataclass(frozen=True)
class Looks:
    """Filters that split one camera's image into bands; all arrays are [height][width] of a RoomImage. dots: the
    projector's pattern on the surfaces, 0..1. fast_dots: its high-pass part. dots_square: the local mean square of
    fast_dots. usable: 1 at pixels that count, else 0. share: the local mean of usable."""

    dots: Image
    fast_dots: Image
    dots_square: Image
    usable: Image
    share: Image

    @classmethod
    def of(cls, image: RoomImage) -> Looks:
        fast, usable = image.dots - blur(image.dots, _FAST_PX), image.usable.astype(np.float32)
        square = np.maximum(blur(fast * fast * usable, _AMPLITUDE_PX), _LEAST_DOTS)
        return cls(image.dots, fast, square, usable, np.maximum(blur(usable, _SLOW_PX), _LEAST_USABLE))

    def amplitude(self, image: Image) -> Image:
        """Returns the local amplitude of the dots in an image, [height][width], DN per unit of the pattern. It is a
        local regression on fast_dots."""
        fast = image - blur(image, _FAST_PX)
        return blur(fast * self.fast_dots * self.usable, _AMPLITUDE_PX) / self.dots_square

    def split(self, image: Image) -> tuple[Image, Image]:
        """Splits an image in DN into (the room's light without dots, DN; the dots' local amplitude, DN per unit of the
        pattern)."""
        amplitude = self.amplitude(image)
        return image - amplitude * self.dots, amplitude

    def of_room(self, room: Image) -> dict[str, Image]:
        """Returns {"slow": low-pass part, "fine": band-pass part} of an image that holds no dots."""
        slow = blur(room * self.usable, _SLOW_PX) / self.share
        return {"slow": slow, "fine": blur(room, _FINE_PX) - slow}

    def pair(self, image: Image) -> Image:
        return blur(image, _PAIR_PX) - blur(image, _SLOW_PX)

    def even(self, amplitude: Image) -> Image:
        """Returns a dot amplitude [height][width] blurred like the "slow" band, over usable pixels only."""
        return blur(amplitude * self.usable, _SLOW_PX) / self.share

    def all(self, image: Image) -> dict[str, Image]:
        """Splits an image in DN into all four bands; returns {band: [height][width]}."""
        room, amplitude = self.split(image)
        return self.of_room(room) | {"dots": self.even(amplitude), "pair": self.pair(image)}
