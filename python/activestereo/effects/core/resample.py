# SPDX-License-Identifier: Apache-2.0
"""Moves and blurs images: cubic resampling, sums of shifts, exact box means over a pattern, blurs that vary over the
image. SupersampledImages are finer than the camera's pixels and extend beyond its frame, so warped images stay sharp up
to the border."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal
from weakref import WeakValueDictionary

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2
from scipy.ndimage import convolve1d, gaussian_filter, map_coordinates, spline_filter, zoom
from scipy.special import ive

from activestereo.common.computed_once import Remembering, computed_once, once_of_picked

# Most uniform blurs from which a varying blur is mixed, at equal steps and at equal ratios of variance.
_MAX_LEVELS, _MAX_RATIO_LEVELS = 5, 7
# A blur's kernel reaches this many standard deviations and one pixel.
_REACH = 4.0
# Narrower blurs are ignored: in pixels, and as a share of the widest blur of an image.
_LEAST_SIGMA_PX, _LEAST_SHARE = 0.05, 1.0 / 64.0

# Pairs (shift, weight).
_Taps = Sequence[tuple[float, float]]


def interpolated(images: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Returns values of images [..., height][width] at pixel positions (u, v), linearly interpolated; beyond the
    border, the border's value."""
    stack = images.reshape(-1, *images.shape[-2:])
    out = [map_coordinates(image, [v, u], np.float64, order=1, mode="nearest", prefilter=False) for image in stack]
    return np.stack(out).reshape(*images.shape[:-2], *u.shape)


class Spline:
    """A cubic spline through an image [height][width], in the image's precision: fitted once, evaluated often."""

    def __init__(self, image: np.ndarray) -> None:
        self._coefficients = spline_filter(image, 3, np.result_type(image, np.float32), mode="mirror")
        self._low, self._high = image.min(), image.max()

    def __call__(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Returns the values at pixel positions (u, v) of any shape, limited to the image's range."""
        out = map_coordinates(
            self._coefficients, [v, u], self._coefficients.dtype, order=3, mode="mirror", prefilter=False
        )
        return np.clip(out, self._low, self._high, out=out)  # a spline may overshoot next to a dot

    def shifted_sum(self, along_u: _Taps, along_v: _Taps) -> np.ndarray:
        """Returns a sum of shifted images, limited to the image's range. along_u, along_v: the shifts along columns
        and along rows, in samples; each takes the image at (position + shift)."""

        def kernel_of(taps: _Taps) -> np.ndarray:
            reach = int(np.ceil(max(abs(shift) for shift, _ in taps))) + 2
            # Weights of the coefficients around a pixel: cubic B-splines of their distances.
            kernel = np.zeros(2 * reach + 1)
            for shift, weight in taps:
                x = np.abs(np.arange(-reach, reach + 1.0) + shift)
                near, far = 2.0 / 3.0 - x * x + 0.5 * x**3, np.maximum(2.0 - x, 0.0) ** 3 / 6.0
                kernel += weight * np.where(x < 1.0, near, far)
            return kernel

        out = _along_both(self._coefficients, kernel_of(along_u), kernel_of(along_v), "mirror")
        return np.clip(out, self._low, self._high)


class BoxSampler:
    """Computes means of an image over axis-aligned boxes of any fractional size, from its integral image. The image is
    0 outside."""

    def __init__(self, image: np.ndarray) -> None:
        height, width = image.shape
        self._integral = np.zeros((height + 1, width + 1))
        inside = self._integral[1:, 1:]
        np.cumsum(image, axis=1, dtype=np.float64, out=inside)
        for above, row in pairwise(inside):  # five times as fast as cumsum() down the columns
            row += above
        self._limits = (width, height)

    def __call__(self, u: np.ndarray, v: np.ndarray, box_u: np.ndarray, box_v: np.ndarray) -> np.ndarray:
        """Returns the means over boxes of box_u x box_v pixels around (u, v), with pixel centres at integers."""
        # Pixel i spans i - 0.5 .. i + 0.5, so the integral's corner i lies at i - 0.5.
        (left, a), (right, b) = (_place(u + 0.5 + side * box_u, self._limits[0]) for side in (-0.5, 0.5))
        total = 0.0
        for side in (-0.5, 0.5):
            row, share = _place(v + 0.5 + side * box_v, self._limits[1])
            row *= self._limits[0] + 1
            low = self._interpolate(row + right, b) - self._interpolate(row + left, a)
            row += self._limits[0] + 1
            high = self._interpolate(row + right, b) - self._interpolate(row + left, a)
            total = low + share * (high - low) - total
        return total / (box_u * box_v)

    def _interpolate(self, index: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Returns the integral image at a fraction `share` between a flat index and the next one in its row. Adds 1 to
        `index` in place."""
        at = self._integral.ravel()
        low = at.take(index)
        index += 1
        return low + share * (at.take(index) - low)


def _place(x: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Splits positions, limited to 0..size, into (whole part, fraction), as indices into an integral image of `size`
    pixels."""
    x = np.minimum(np.maximum(x, 0.0), size)
    i = np.minimum(x.astype(np.intp), size - 1)
    return i, x - i


def means_of_squares(images: np.ndarray, size: int, dtype: Any) -> np.ndarray:
    """Returns the means [..., height / size][width / size] over squares of size x size pixels, summed in `dtype`."""
    rows = np.add.reduce([images[..., k::size, :] for k in range(size)], dtype=dtype)
    return np.add.reduce([rows[..., k::size] for k in range(size)], dtype=dtype) / np.dtype(dtype).type(size**2)


def blur(images: np.ndarray, sigma_px: float | np.ndarray) -> np.ndarray:
    """Returns images [..., height][width] after a Gaussian blur. sigma_px: pixels, a number or an image
    [height][width].

    The kernel is the discrete analogue of the Gaussian (Lindeberg 1990), whose variance is sigma^2 below a pixel too. A
    varying sigma is interpolated in variance between a few uniform blurs."""
    if np.ndim(sigma_px) == 0:
        if sigma_px == 0:
            return images
        kernel = _kernel(float(sigma_px))
        return _along_both(images, kernel, kernel)
    variance = np.asarray(sigma_px, dtype=np.float64) ** 2
    low, high = variance.min(), variance.max()
    if high - low < 1e-12:
        return blur(images, float(np.sqrt(low)))
    levels = np.linspace(low, high, _MAX_LEVELS)
    position = (variance - low) / (high - low) * (_MAX_LEVELS - 1)
    kernels = [2 * [_kernel(float(np.sqrt(level)))] for level in levels]
    return _between_levels(images, _weights(position, _MAX_LEVELS), kernels)


class BlurAlong:
    """Blurs images along one axis, -1 (along rows, u) or -2 (along columns, v), by a sigma that varies over the image.
    sigma: [height][width], to be multiplied by a number.

    Each pixel is a mixture of two uniform blurs. Their variances have a constant ratio, at most 2 where their number
    allows. At equal steps of variance, narrow blurs mixed with the next wider one would keep a sharp core.
    """

    def __init__(self, sigma: np.ndarray, axis: int) -> None:
        variance = np.maximum(np.asarray(sigma, dtype=np.float64), _LEAST_SHARE * np.max(sigma)) ** 2
        low, high = variance.min(), variance.max()
        levels = np.unique(np.geomspace(low, high, min(2 + int(np.log2(high / low)), _MAX_RATIO_LEVELS)))
        self._sigmas, self._axis = np.sqrt(levels), axis
        self._weights = _weights(np.interp(variance, levels, np.arange(len(levels))), len(levels))

    def __call__(self, images: np.ndarray, times: float) -> np.ndarray:
        """Returns images [..., height][width] after a blur by sigma * times pixels."""
        if times * self._sigmas[-1] < _LEAST_SIGMA_PX:
            return images
        kernels = [[_kernel(times * sigma), np.ones(1)][:: 1 if self._axis == -1 else -1] for sigma in self._sigmas]
        return _between_levels(images, self._weights, kernels)


_Weights = list[tuple[slice, np.ndarray]]


def _weights(position: np.ndarray, levels: int) -> _Weights:
    """Returns, for each blur level, (slice of the rows that use it, its weights in these rows). position: fractional
    level of each pixel, [height][width]. A pixel mixes the two levels next to it."""
    out, position = [], position.astype(np.float32)
    for i in range(levels):
        weight = np.maximum(1.0 - np.abs(position - np.float32(i)), 0.0)
        wanted = np.flatnonzero(weight.any(axis=1))
        rows = slice(wanted[0], wanted[-1] + 1) if wanted.size else slice(0)
        out.append((rows, weight[rows]))
    return out


def _between_levels(images: np.ndarray, weights: _Weights, kernels: Sequence[Sequence[np.ndarray]]) -> np.ndarray:
    """Returns the images mixed from one uniform blur per level. weights: from _weights(). kernels: two 1-D kernels for
    each level. A level's blur is computed only for the rows that use it. Wide blurs often need few rows, since near
    surfaces lie low in the image."""
    out = np.zeros(images.shape, np.result_type(images, np.float32))
    for (rows, weight), (kernel_u, kernel_v) in zip(weights, kernels, strict=True):
        if len(weight):
            reach = len(kernel_v) // 2
            first = max(rows.start - reach, 0)
            blurred = _along_both(images[..., first : rows.stop + reach, :], kernel_u, kernel_v)
            out[..., rows, :] += blurred[..., rows.start - first : rows.stop - first, :] * weight
    return out


def _kernel(sigma_px: float) -> np.ndarray:
    reach = int(np.ceil(_REACH * sigma_px + 1.0))
    kernel = ive(np.abs(np.arange(-reach, reach + 1)), sigma_px**2)
    return kernel / kernel.sum()


def _along_both(
    images: np.ndarray, kernel_u: np.ndarray, kernel_v: np.ndarray, border: Literal["nearest", "mirror"] = "nearest"
) -> np.ndarray:
    """Returns images [..., height][width] convolved along columns (u) and rows (v). Beyond the border, the border's
    value counts, or the images' mirror image."""
    floats = images.astype(np.result_type(images, np.float32), copy=False)
    try:
        import cv2  # five times as fast as SciPy, and the same to rounding; loaded where something is blurred
    except ImportError:
        return convolve1d(convolve1d(floats, kernel_v, axis=-2, mode=border), kernel_u, axis=-1, mode=border)
    stack = floats.reshape(-1, *images.shape[-2:])
    beyond = cv2.BORDER_REPLICATE if border == "nearest" else cv2.BORDER_REFLECT_101
    out = [cv2.sepFilter2D(image, -1, kernel_u[::-1], kernel_v[::-1], borderType=beyond) for image in stack]
    return np.stack(out).reshape(images.shape)


class _Maps(tuple[Any, ...]):
    """Arrays that compare by content, as a cache's key. The hash reads a few values of each: a digest of all would take
    longer than the comparison."""

    def __hash__(self) -> int:
        return hash(tuple(np.ravel(x)[::61].tobytes() for x in self))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Maps) and len(self) == len(other) and all(map(np.array_equal, self, other))


class Pattern:
    """A pattern image that compares by content, so that caches of samplers use it as a key."""

    def __init__(self, image: np.ndarray) -> None:
        self.image = np.ascontiguousarray(image, dtype=np.float32)
        self._digest = hashlib.blake2b(self.image.tobytes(), digest_size=16).digest() + repr(self.image.shape).encode()

    def __hash__(self) -> int:
        return hash(self._digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Pattern) and self._digest == other._digest


@lru_cache(maxsize=8)
def smooth_pattern(pattern: Pattern, sigma_px: float) -> np.ndarray:
    """Returns a Pattern's image after a Gaussian blur, float64; the pattern is 0 outside."""
    return gaussian_filter(pattern.image.astype(np.float64), sigma_px, mode="constant")


@lru_cache(maxsize=48)
def disc_sampler(pattern: Pattern, diameter_px: float) -> BoxSampler:
    """Returns a BoxSampler of a Pattern blurred by a disc (diameter 0 = sharp). The disc's edge pixels weigh by
    coverage."""
    if diameter_px == 0.0:
        return BoxSampler(pattern.image)
    radius = diameter_px / 2
    reach, fine = int(np.ceil(radius - 0.5)), 16
    size = 2 * reach + 1
    offsets = (np.arange(size * fine) + 0.5) / fine - reach - 0.5
    inside = (offsets[:, None] ** 2 + offsets[None] ** 2 <= radius**2).astype(np.float64)
    stamp = inside.reshape(size, fine, size, fine).sum(axis=(1, 3))
    height, width = pattern.image.shape
    shape = [next_fast_len(n + size, real=True) for n in (height, width)]
    full = irfft2(rfft2(pattern.image, shape) * rfft2((stamp / stamp.sum()).astype(np.float32), shape), shape)
    return BoxSampler(full[reach : reach + height, reach : reach + width])


@dataclass(frozen=True)
class SupersampledImages(Remembering):
    """Images that have `scale` samples per camera pixel along each axis, and extend margin_px camera pixels beyond the
    frame.

    samples, images(): float32 [n][(height + 2 margin_px) scale][(width + 2 margin_px) scale]."""

    samples: np.ndarray
    scale: int
    margin_px: int

    def images(self) -> np.ndarray:
        return self.samples

    @computed_once
    def pixels(self) -> np.ndarray:
        """Returns the means over the camera pixels' squares, float64 [n][height][width]."""
        images, edge = self.images(), self.margin_px * self.scale
        inside = images[:, edge : images.shape[1] - edge, edge : images.shape[2] - edge]
        return means_of_squares(inside, self.scale, np.float64)

    def pixels_at(self, pick: np.ndarray | slice) -> np.ndarray:
        """Returns the means over the camera pixels at flat indices, [n][pixel]."""
        return self.pixels().reshape(len(self.pixels()), -1)[:, pick]

    def warped(self, u: np.ndarray, v: np.ndarray) -> SupersampledImages:
        """Returns the warped images: each camera pixel takes these images' value at pixel position (u, v),
        [height][width] each. Beyond the frame, the border's displacement holds."""
        return self._shared(u, v, make=lambda: _Warped(self, u, v))

    def _shared(self, *maps: np.ndarray | float, make: Callable[[], SupersampledImages]) -> SupersampledImages:
        """Returns make(), or the images of an earlier call with the same maps while something holds them. A fit's
        slopes by effects before the lens all need the same rendered images behind it."""
        alive, key = self.once("alive", WeakValueDictionary), _Maps(maps)
        images = alive.get(key)
        if images is None:
            images = alive[key] = make()
        return images

    def _warped(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        row, column = np.ogrid[: u.shape[0], : u.shape[1]]
        right, down = self._refined(u - column), self._refined(v - row)
        row, column = np.ogrid[: down.shape[0], : down.shape[1]]
        u, v = column + self.scale * right, row + self.scale * down
        return np.stack([spline(u, v) for spline in self._splines()])

    def blurred(self, sigma_px: float | np.ndarray) -> SupersampledImages:
        """Returns the images after a Gaussian blur. sigma_px: camera pixels, a number or an image [height][width] that
        goes on beyond the frame."""

        def later() -> SupersampledImages:
            sigma = self.scale * (self._refined(np.asarray(sigma_px)) if np.ndim(sigma_px) else sigma_px)
            return _LaterSupersampled(self, lambda images: blur(images.images(), sigma))

        return self._shared(sigma_px, make=later)

    def shifted_sum(self, along_u: _Taps, along_v: _Taps) -> SupersampledImages:
        """Returns sums of the shifted images, see Spline.shifted_sum(); shifts are in camera pixels."""
        u, v = ([(self.scale * shift, weight) for shift, weight in taps] for taps in (along_u, along_v))
        return _LaterSupersampled(self, lambda images: np.stack([s.shifted_sum(u, v) for s in images._splines()]))

    def means_at(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Returns means over squares of one camera pixel's size, centred at camera pixel positions (u, v) of any shape.
        The result is float32 [n][...]."""
        u, v = ((x + self.margin_px) * self.scale for x in (u, v))
        return np.stack([spline(u, v) for spline in self._splines_of_means()])

    def sum_of(self, indices: tuple[int, ...]) -> SupersampledImages:
        """Returns a SupersampledImages with one image: the sum of the images at these indices."""
        some: SupersampledImages = self.once(indices, lambda: self._sum_of(indices))
        return some

    def _sum_of(self, indices: tuple[int, ...]) -> SupersampledImages:
        images = self.images()
        image = images[indices[0]] if len(indices) == 1 else images[list(indices)].sum(axis=0)
        return SupersampledImages(image[None], self.scale, self.margin_px)

    @computed_once
    def _splines(self) -> list[Spline]:
        """Returns one Spline per image, kept because every warp of a fit needs it."""
        return [Spline(image) for image in self.images()]

    @computed_once
    def _splines_of_means(self) -> list[Spline]:
        """Returns one Spline per image, through means over windows as large as a camera pixel. A mean's index is that
        of its window's first sample."""
        means, s = self.images(), self.scale
        for axis in (1, 2):
            count = means.shape[axis] - s + 1
            means = np.mean([means.take(range(i, i + count), axis) for i in range(s)], axis=0)
        return [Spline(image) for image in means]

    def _refined(self, image: np.ndarray) -> np.ndarray:
        """Resamples an image [height][width] from camera pixels to the samples by linear interpolation. Beyond the
        frame, the border's value counts."""
        if self.scale == 1 and self.margin_px == 0:
            return image
        return zoom(np.pad(image, self.margin_px, "edge"), self.scale, order=1, mode="nearest", grid_mode=True)


class _LaterSupersampled(SupersampledImages):
    """SupersampledImages after a linear operation, which is applied only to the images that are asked for. act: returns
    the samples after it."""

    _source: SupersampledImages
    _act: Callable[[SupersampledImages], np.ndarray]

    def __init__(self, source: SupersampledImages, act: Callable[[SupersampledImages], np.ndarray]) -> None:
        self.__dict__.update(scale=source.scale, margin_px=source.margin_px, _source=source, _act=act)

    @computed_once
    def images(self) -> np.ndarray:
        return self._act(self._source)

    def _sum_of(self, indices: tuple[int, ...]) -> SupersampledImages:
        return _LaterSupersampled(self._source.sum_of(indices), self._act)


class _Warped(_LaterSupersampled):
    """SupersampledImages after a warp. A warp shifts one pixel almost as a whole, so a warped pixel's mean is the mean
    over the shifted pixel. Two warps are one, which looks up the first one's places."""

    _u: np.ndarray
    _v: np.ndarray

    def __init__(self, source: SupersampledImages, u: np.ndarray, v: np.ndarray) -> None:
        super().__init__(source, lambda images: images._warped(u, v))
        self.__dict__.update(_u=u, _v=v)

    @computed_once
    def pixels(self) -> np.ndarray:
        return self._source.means_at(self._u, self._v)

    def pixels_at(self, pick: np.ndarray | slice) -> np.ndarray:
        if isinstance(pick, slice):
            return super().pixels_at(pick)
        of_pick: np.ndarray = once_of_picked(
            self.once("picked", list), pick, lambda: self._source.means_at(self._u.ravel()[pick], self._v.ravel()[pick])
        )
        return of_pick

    def warped(self, u: np.ndarray, v: np.ndarray) -> SupersampledImages:
        row, column = np.ogrid[: u.shape[0], : u.shape[1]]
        right, down = interpolated(np.stack([self._u - column, self._v - row]), u, v)
        return self._source.warped(u + right, v + down)

    def _sum_of(self, indices: tuple[int, ...]) -> SupersampledImages:
        return self._source.sum_of(indices).warped(self._u, self._v)
