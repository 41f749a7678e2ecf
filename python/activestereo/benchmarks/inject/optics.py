# SPDX-License-Identifier: Apache-2.0
"""Effects of the lens on the light that falls on the imager."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import fftconvolve

from activestereo.benchmarks.inject.light import Image, Light, View
from activestereo.benchmarks.inject.resample import resampled

_PARTS = 16  # of a pixel's side, in which the disc's rim is drawn


def disc(radius_px: float) -> np.ndarray:
    """The point spread of a defocused ideal lens: an even disc, averaged over pixels; its sum is 1."""
    side = 2 * int(np.ceil(radius_px + 0.5)) + 1
    offset = (np.arange(side * _PARTS) + 0.5) / _PARTS - side / 2
    inside = np.hypot(offset[:, None], offset) <= radius_px
    kernel = inside.reshape(side, _PARTS, side, _PARTS).mean(axis=(1, 3))
    return kernel / kernel.sum()


def blur(light: Light, view: View, radius_px: float) -> Light:
    """Defocus: every point becomes a disc."""
    kernel = disc(radius_px)

    def spread(image: np.ndarray, weights: np.ndarray) -> np.ndarray:
        padded = np.pad(image, len(weights) // 2, mode="reflect")
        return fftconvolve(padded, weights, mode="valid")

    return Light(spread(light.value, kernel), spread(light.variance, kernel**2))


def veiling_glare(light: Light, view: View, fraction: float) -> Light:
    """A fraction of all light is scattered evenly over the image."""
    kept = light.scaled(1.0 - fraction)
    return Light(kept.value + fraction * light.value.mean(), kept.variance)


def ghost(light: Light, view: View, fraction: float) -> Light:
    """A reflection between the lens's surfaces: the image again, turned by half a turn about the optical axis."""
    v, u = np.indices(light.value.shape, dtype=np.float64)
    turned = resampled(light, 2.0 * view.K[0, 2] - u, 2.0 * view.K[1, 2] - v, outside=0.0)
    return Light(light.value + fraction * turned.value, light.variance + fraction**2 * turned.variance)


def vignetting(light: Light, view: View, exponent: float) -> Light:
    """Light falls by cos^exponent of the angle to the optical axis."""
    x, y = view.rays(light.value.shape)
    return light.scaled(np.cos(np.arctan(np.hypot(x, y))) ** exponent)


def radial_distortion(light: Light, view: View, k1: float) -> Light:
    """A point at r focal lengths from the axis is drawn at r (1 + k1 r^2)."""
    return _bent(light, view, lambda x, y, r2: (x * k1 * r2, y * k1 * r2))


def tangential_distortion(light: Light, view: View, size: float, direction_rad: float) -> Light:
    """A lens with decentred elements (Brown 1966), p1 and p2 being `size` times the direction's sine and cosine."""
    p1, p2 = size * np.sin(direction_rad), size * np.cos(direction_rad)
    return _bent(
        light,
        view,
        lambda x, y, r2: (2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y),
    )


def _bent(light: Light, view: View, shift: Callable[..., tuple[Image, Image]]) -> Light:
    """Shows in each pixel the ray that the distortion, ray + shift(ray), moves to its centre. Finds it by fixed-point
    iteration."""
    drawn_x, drawn_y = view.rays(light.value.shape)
    x, y = drawn_x, drawn_y
    for _ in range(12):
        dx, dy = shift(x, y, x * x + y * y)
        x, y = drawn_x - dx, drawn_y - dy
    K = view.K
    return resampled(light, K[0, 0] * x + K[0, 1] * y + K[0, 2], K[1, 1] * y + K[1, 2])
