# SPDX-License-Identifier: Apache-2.0
"""Applies effects of lens, projector, imager and lamps to one measured image and to its noise variance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing
from scipy.signal import fftconvolve

Image = NDArray[np.float64]
_LOBES = 3  # lobes of Lanczos' windowed sinc, which keeps dots sharp
_PARTS = 16  # parts of a pixel's side in which the disc's rim is drawn
# A direction without light is as wide as this share of the pattern's width: a dot and its surroundings.
_DISC = 1.0 / 150.0
_WINDOW_PX = 4  # half width of the window in which the light between dots is measured
_BETWEEN = 0.2  # the window's quantile that is taken for the light between dots


@dataclass(frozen=True)
class Light:
    """An image without its black level, in DN above black [height][width], with its noise's variance in DN^2."""

    value: Image
    variance: Image

    def scaled(self, factor: Image | float) -> Light:
        """Returns the light times a factor per pixel; the noise scales with it."""
        return Light(self.value * factor, self.variance * np.square(factor))


@dataclass(frozen=True)
class View:
    """Describes how an image was taken. time_s: time of its middle row; row_time_s: from one row to the next; max_dn:
    full scale above the black level. depth: z in this camera in metres, 0 = unknown, None without depth."""

    K: NDArray[np.float64]
    is_right: bool
    time_s: float
    row_time_s: float
    max_dn: float
    depth: Image | None
    camera_to_projector: NDArray[np.float64]
    projector_K: NDArray[np.float64]
    projector_size: tuple[int, int]
    temporal: np.random.Generator  # noise drawn anew for this image
    static: np.random.Generator  # the same in all images of the capture

    def rays(self, shape: tuple[int, ...]) -> tuple[Image, Image]:
        """Returns the slopes (x / z, y / z) of the rays through the pixels' centres. shape: (height, width)."""
        v, u = np.indices(shape, dtype=np.float64)
        y = (v - self.K[1, 2]) / self.K[1, 1]
        return (u - self.K[0, 2] - self.K[0, 1] * y) / self.K[0, 0], y


def resampled(light: Light, u: np.ndarray, v: np.ndarray, outside: float | None = None) -> Light:
    """Returns the light interpolated at pixels (u, v). outside: value beyond the image; None repeats the border."""
    height, width = light.value.shape
    first_u, weight_u = _taps(u)
    first_v, weight_v = _taps(v)
    value, variance = np.zeros(u.shape), np.zeros(u.shape)
    for i in range(2 * _LOBES):
        row = np.clip(first_v + i, 0, height - 1)
        for j in range(2 * _LOBES):
            column, weight = np.clip(first_u + j, 0, width - 1), weight_v[i] * weight_u[j]
            value += weight * light.value[row, column]
            variance += weight**2 * light.variance[row, column]
    if outside is not None:
        beyond = (u < -0.5) | (u > width - 0.5) | (v < -0.5) | (v > height - 0.5)
        value, variance = np.where(beyond, outside, value), np.where(beyond, 0.0, variance)
    return Light(value, variance)


def _taps(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns (first pixel, weights [6][...]) of Lanczos interpolation at each place; the weights sum to 1."""
    first = np.floor(place).astype(np.int64) - _LOBES + 1
    distance = place - first - np.arange(2 * _LOBES).reshape(-1, *[1] * place.ndim)
    weights = np.sinc(distance) * np.sinc(distance / _LOBES) * (np.abs(distance) < _LOBES)
    return first, weights / weights.sum(axis=0)


def disc(radius_px: float) -> np.ndarray:
    """Returns the point spread of a defocused ideal lens: an even disc, averaged over pixels, with sum 1."""
    side = 2 * int(np.ceil(radius_px + 0.5)) + 1
    offset = (np.arange(side * _PARTS) + 0.5) / _PARTS - side / 2
    inside = np.hypot(offset[:, None], offset) <= radius_px
    kernel = inside.reshape(side, _PARTS, side, _PARTS).mean(axis=(1, 3))
    return kernel / kernel.sum()


def blur(light: Light, view: View, radius_px: float) -> Light:
    """Blurs the light by defocus: every point becomes a disc."""
    kernel = disc(radius_px)

    def spread(image: np.ndarray, weights: np.ndarray) -> np.ndarray:
        padded = np.pad(image, len(weights) // 2, mode="reflect")
        return fftconvolve(padded, weights, mode="valid")

    return Light(spread(light.value, kernel), spread(light.variance, kernel**2))


def veiling_glare(light: Light, view: View, fraction: float) -> Light:
    """Scatters a fraction of all light evenly over the image."""
    kept = light.scaled(1.0 - fraction)
    return Light(kept.value + fraction * light.value.mean(), kept.variance)


def ghost(light: Light, view: View, fraction: float) -> Light:
    """Adds a reflection between the lens's surfaces: the image turned by 180 degrees about the optical axis."""
    v, u = np.indices(light.value.shape, dtype=np.float64)
    turned = resampled(light, 2.0 * view.K[0, 2] - u, 2.0 * view.K[1, 2] - v, outside=0.0)
    return Light(light.value + fraction * turned.value, light.variance + fraction**2 * turned.variance)


def vignetting(light: Light, view: View, exponent: float) -> Light:
    """Dims the light by cos^exponent of the angle to the optical axis."""
    x, y = view.rays(light.value.shape)
    return light.scaled(np.cos(np.arctan(np.hypot(x, y))) ** exponent)


def radial_distortion(light: Light, view: View, k1: float) -> Light:
    """Bends the image: a point at r focal lengths from the axis moves to r (1 + k1 r^2)."""
    return _bent(light, view, lambda x, y, r2: (x * k1 * r2, y * k1 * r2))


def tangential_distortion(light: Light, view: View, size: float, direction_rad: float) -> Light:
    """Bends the image as decentred lens elements do (Brown 1966), by p1 and p2 of this size and direction."""
    p1, p2 = size * np.sin(direction_rad), size * np.cos(direction_rad)
    return _bent(
        light, view, lambda x, y, r2: (2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
    )


def _bent(light: Light, view: View, shift: Callable[..., tuple[Image, Image]]) -> Light:
    """Resamples under a distortion: a pixel shows the ray that ray + shift(ray) moves to its centre (fixed point)."""
    drawn_x, drawn_y = view.rays(light.value.shape)
    x, y = drawn_x, drawn_y
    for _ in range(12):
        dx, dy = shift(x, y, x * x + y * y)
        x, y = drawn_x - dx, drawn_y - dy
    K = view.K
    return resampled(light, K[0, 0] * x + K[0, 1] * y + K[0, 2], K[1, 1] * y + K[1, 2])


def gain(light: Light, view: View, excess: float) -> Light:
    """Multiplies light and noise by 1 + excess, as an amplifier does."""
    return light.scaled(1.0 + excess)


def black_level(light: Light, view: View, offset_dn: float) -> Light:
    """Adds a constant offset, which is there without light too."""
    return Light(light.value + offset_dn, light.variance)


def row_noise(light: Light, view: View, sigma_dn: float) -> Light:
    """Adds a random offset to every row, drawn anew for every image."""
    offsets = sigma_dn * view.temporal.standard_normal((light.value.shape[0], 1))
    return Light(light.value + offsets, light.variance)


def response(light: Light, view: View, compression: float) -> Light:
    """Compresses the light by a soft saturation: y = x (1 + c) / (1 + c x / full scale). Full scale stays fixed."""
    relative = np.maximum(light.value, 0.0) / view.max_dn
    below = 1.0 + compression * relative
    slope = (1.0 + compression) / below**2
    value = np.where(light.value > 0.0, view.max_dn * relative * (1.0 + compression) / below, light.value)
    return Light(value, light.variance * slope**2)


def bands(light: Light, view: View, depth: float, frequency_hz: float, phase_rad: float) -> Light:
    """Modulates light by mains flicker, read row by row. depth: amplitude over mean, after the exposure's average."""
    height = light.value.shape[0]
    time_s = view.time_s + (np.arange(height) - (height - 1) / 2) * view.row_time_s
    return light.scaled(1.0 + depth * np.cos(2.0 * np.pi * frequency_hz * time_s + phase_rad)[:, None])


def dead_dots(light: Light, view: View, share: float) -> Light:
    """Removes a share of the projector's dots; the light between dots stays. Raises ValueError without depth."""
    if view.depth is None:
        raise ValueError("has no depth, which dead_dots needs to follow a dot from one image to the next")
    rows, columns = np.nonzero(_is_dead(view, share) & (view.depth > 0.0))
    offsets = np.mgrid[-_WINDOW_PX : _WINDOW_PX + 1, -_WINDOW_PX : _WINDOW_PX + 1].reshape(2, -1, 1)
    height, width = light.value.shape
    near = light.value[np.clip(rows + offsets[0], 0, height - 1), np.clip(columns + offsets[1], 0, width - 1)]
    value, variance = light.value.copy(), light.variance.copy()
    between = np.minimum(np.quantile(near, _BETWEEN, axis=0), value[rows, columns]) if len(rows) else near[:0].sum(0)
    value[rows, columns], variance[rows, columns] = between, 0.0
    return Light(value, variance)


def dead_directions(view: View, share: float) -> np.ndarray:
    """Draws the pattern's pixels without light, bool [height][width]: discs at random places that fill `share`."""
    width, height = view.projector_size
    dead, count = np.zeros((height, width), bool), 0
    radius = max(1.0, _DISC * width / 2)
    while count < share * dead.size:
        centre_u, centre_v = view.static.uniform(0.0, (width, height))
        rows, columns = (slice(max(0, int(c - radius)), int(c + radius) + 2) for c in (centre_v, centre_u))
        part = dead[rows, columns]
        v, u = np.indices(part.shape)
        disc = np.hypot(u + columns.start - centre_u, v + rows.start - centre_v) <= radius
        count += int(np.count_nonzero(disc & ~part))
        part |= disc
    return dead


def _is_dead(view: View, share: float) -> np.ndarray:
    """Returns a mask of the pixels whose surface point lies in a dead direction of the projector."""
    assert view.depth is not None
    x, y = view.rays(view.depth.shape)
    point = np.stack([x, y, np.ones_like(x)]) * view.depth
    point = np.einsum("ij,jhw->ihw", view.camera_to_projector[:3, :3], point)
    point += view.camera_to_projector[:3, 3, None, None]
    place = np.einsum("ij,jhw->ihw", view.projector_K, point)
    in_front = point[2] > 0.0
    u, v = np.rint(place[:2] / np.where(in_front, place[2], 1.0))
    width, height = view.projector_size
    inside = in_front & (u >= 0) & (u < width) & (v >= 0) & (v < height)
    dead = dead_directions(view, share)
    return inside & dead[np.where(inside, v, 0).astype(int), np.where(inside, u, 0).astype(int)]


def moved_depth(depth: np.ndarray, K: np.ndarray, to_other: np.ndarray, other_K: np.ndarray) -> np.ndarray:
    """Projects depth in metres into a camera of its size (to_other, 4x4); the nearest wins, gaps of 1 px close."""
    v, u = np.nonzero(depth > 0.0)
    z = depth[v, u]
    point = np.linalg.inv(K) @ np.stack([u * z, v * z, z])
    point = to_other[:3, :3] @ point + to_other[:3, 3:]
    point = point[:, point[2] > 0.0]
    u, v = np.rint((other_K @ point)[:2] / point[2]).astype(int)
    inside = (u >= 0) & (u < depth.shape[1]) & (v >= 0) & (v < depth.shape[0])
    out = np.full(depth.shape, np.inf)
    np.minimum.at(out, (v[inside], u[inside]), point[2, inside])
    out = np.where(np.isfinite(out), out, 0.0)
    closed: np.ndarray = grey_closing(out, size=(3, 3))
    return np.where(out > 0.0, out, closed)
