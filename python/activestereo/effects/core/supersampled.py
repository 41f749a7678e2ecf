# SPDX-License-Identifier: Apache-2.0
"""Light between pixels: images finer than the camera's and wider than its frame, so that a warp has something to look
up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from activestereo.common.computed_once import computed_once
from activestereo.effects.core.resample import Spline, blur, shifted_sum


@dataclass(frozen=True)
class SupersampledImages:
    """samples, images(): float32 [n][(height + 2 margin_px) scale][(width + 2 margin_px) scale]; margin_px in
    pixels of the camera."""

    samples: np.ndarray
    scale: int
    margin_px: int

    def images(self) -> np.ndarray:
        return self.samples

    @computed_once
    def pixels(self) -> np.ndarray:
        """Means over the pixels' squares, float64 [n][height][width]."""
        s, edge = self.scale, self.margin_px * self.scale
        images = self.images()
        inside = images[:, edge : images.shape[1] - edge, edge : images.shape[2] - edge]
        rows = np.add.reduce([inside[:, k::s] for k in range(s)], dtype=np.float64)
        return np.add.reduce([rows[:, :, k::s] for k in range(s)]) / s**2

    def warped(self, u: np.ndarray, v: np.ndarray) -> SupersampledImages:
        """The images of a camera whose pixels show what lies at pixel positions (u, v) [height][width] here.

        The displacement goes on beyond the frame as it is at the border."""
        return _WarpedSupersampled(self, u, v)

    def _warped(self, u: np.ndarray, v: np.ndarray) -> SupersampledImages:
        height, width = u.shape
        columns, rows = self._positions(width), self._positions(height)[:, None]
        moved_u, moved_v = u - np.arange(width), v - np.arange(height)[:, None]
        moved = columns + self._refined(moved_u), rows + self._refined(moved_v)
        return SupersampledImages(self.at(*moved), self.scale, self.margin_px)

    def blurred(self, sigma_px: float | np.ndarray) -> SupersampledImages:
        """The images under a Gaussian blur; sigma_px: a number, or an image of it [height][width] that goes on beyond
        the frame."""
        if np.ndim(sigma_px):
            sigma_px = self._refined(np.asarray(sigma_px, dtype=np.float64))
        return _LaterSupersampled(
            self,
            lambda images: SupersampledImages(blur(images.images(), self.scale * sigma_px), self.scale, self.margin_px),
        )

    def shifted_sum(
        self, along_u: Sequence[tuple[float, float]], along_v: Sequence[tuple[float, float]]
    ) -> SupersampledImages:
        """See resample.shifted_sum; shifts in pixels."""
        u, v = ([(self.scale * shift, weight) for shift, weight in taps] for taps in (along_u, along_v))
        return _LaterSupersampled(
            self, lambda images: SupersampledImages(shifted_sum(images.images(), u, v), self.scale, self.margin_px)
        )

    def at(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Values at pixel positions (u, v) of any shape, float32 [n][...]."""
        u, v = ((x + self.margin_px + 0.5) * self.scale - 0.5 for x in (u, v))
        return np.stack([spline(u, v) for spline in self._splines()])

    def means_at(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Means over squares of a pixel's size around pixel positions (u, v) of any shape, float32 [n][...]."""
        u, v = ((x + self.margin_px) * self.scale for x in (u, v))
        return np.stack([spline(u, v) for spline in self._splines_of_means()])

    def sum_of(self, indices: tuple[int, ...]) -> SupersampledImages:
        """SupersampledImages of one image, the sum of those at the indices."""
        known = self._sums()
        if indices not in known:
            known[indices] = self._sum_of(indices)
        return known[indices]

    def _sum_of(self, indices: tuple[int, ...]) -> SupersampledImages:
        images = self.images()
        image = images[indices[0]] if len(indices) == 1 else images[list(indices)].sum(axis=0)
        return SupersampledImages(image[None], self.scale, self.margin_px)

    @computed_once
    def _sums(self) -> dict[tuple[int, ...], SupersampledImages]:
        return {}

    @computed_once
    def _splines(self) -> list[Spline]:
        """One set serves every warp of a fit."""
        return [Spline(image) for image in self.images()]

    @computed_once
    def _splines_of_means(self) -> list[Spline]:
        """Splines of the means over squares of a pixel's size, by the sample where each square begins."""
        means, s = self.images(), self.scale
        for axis in (1, 2):
            count = means.shape[axis] - s + 1
            means = np.mean([means.take(range(i, i + count), axis) for i in range(s)], axis=0)
        return [Spline(image) for image in means]

    def _refined(self, image: np.ndarray) -> np.ndarray:
        """An image [height][width] at the samples, linear between pixels; beyond the frame as at its border."""
        for axis, size in enumerate(image.shape):
            at = np.clip(self._positions(size), 0.0, size - 1.0)
            low = np.minimum(at.astype(np.intp), max(size - 2, 0))
            share = np.expand_dims(at - low, 1 - axis)
            before, after = image.take(low, axis), image.take(np.minimum(low + 1, size - 1), axis)
            image = before + share * (after - before)
        return image

    def _positions(self, size: int) -> np.ndarray:
        """Pixel coordinates of the samples along an axis of `size` pixels."""
        return (np.arange((size + 2 * self.margin_px) * self.scale) + 0.5) / self.scale - 0.5 - self.margin_px


class _LaterSupersampled(SupersampledImages):
    """SupersampledImages under a linear operation that is done for the images that are asked for."""

    _source: SupersampledImages
    _operation: Callable[[SupersampledImages], SupersampledImages]

    def __init__(
        self, source: SupersampledImages, operation: Callable[[SupersampledImages], SupersampledImages]
    ) -> None:
        self.__dict__.update(scale=source.scale, margin_px=source.margin_px, _source=source, _operation=operation)

    @computed_once
    def images(self) -> np.ndarray:
        return self._operation(self._source).images()

    def _sum_of(self, indices: tuple[int, ...]) -> SupersampledImages:
        return self._operation(self._source.sum_of(indices))


class _WarpedSupersampled(_LaterSupersampled):
    """SupersampledImages under a warp. Within a pixel a warp hardly changes but for its displacement: means over pixels
    are means of the source."""

    _place: tuple[np.ndarray, np.ndarray]

    def __init__(self, source: SupersampledImages, u: np.ndarray, v: np.ndarray) -> None:
        super().__init__(source, lambda images: images._warped(u, v))
        self.__dict__["_place"] = u, v

    @computed_once
    def pixels(self) -> np.ndarray:
        return self._source.means_at(*self._place)

    def _sum_of(self, indices: tuple[int, ...]) -> SupersampledImages:
        return _WarpedSupersampled(self._source.sum_of(indices), *self._place)
