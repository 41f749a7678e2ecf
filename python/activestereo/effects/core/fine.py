"""Light between pixels: images finer than the camera's and wider than its frame, so that a warp has something to look up."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from activestereo.effects.core.resample import blur, sample, shifted_sum


@dataclass(frozen=True)
class FineImages:
    """images: float32 [n][(height + 2 margin_px) scale][(width + 2 margin_px) scale]; margin_px in pixels of the camera."""

    images: np.ndarray
    scale: int
    margin_px: int

    @cached_property
    def pixels(self):
        """Means over the pixels' squares, float64 [n][height][width]."""
        s, edge = self.scale, self.margin_px * self.scale
        inside = self.images[:, edge : self.images.shape[1] - edge, edge : self.images.shape[2] - edge]
        count, height, width = inside.shape
        return inside.reshape(count, height // s, s, width // s, s).mean(axis=(2, 4), dtype=np.float64)

    def warped(self, u, v):
        """The images of a camera whose pixels show what lies at pixel positions (u, v) [height][width] here.

        The displacement goes on beyond the frame as it is at the border."""
        height, width = u.shape
        down, right = self._positions(height), self._positions(width)
        rows, columns = np.meshgrid(down, right, indexing="ij")
        column, row = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        moved = sample(np.stack([u - column, v - row]), columns, rows, order=1)
        return FineImages(self.at(columns + moved[0], rows + moved[1]), self.scale, self.margin_px)

    def blurred(self, sigma_px):
        """The images under a Gaussian blur; sigma_px: a number, or an image of it [height][width] that goes on beyond the frame."""
        if np.ndim(sigma_px):
            height, width = np.shape(sigma_px)
            rows, columns = np.meshgrid(self._positions(height), self._positions(width), indexing="ij")
            sigma_px = sample(np.asarray(sigma_px, dtype=np.float64), columns, rows, order=1)
        return FineImages(blur(self.images, self.scale * sigma_px), self.scale, self.margin_px)

    def shifted_sum(self, along_u, along_v):
        """See resample.shifted_sum; shifts in pixels."""
        fine_u, fine_v = ([(self.scale * shift, weight) for shift, weight in taps] for taps in (along_u, along_v))
        return FineImages(shifted_sum(self.images, fine_u, fine_v), self.scale, self.margin_px)

    def at(self, u, v):
        """Values at pixel positions (u, v) of any shape, float32 [n][...]."""
        fine_u, fine_v = ((x + self.margin_px + 0.5) * self.scale - 0.5 for x in (u, v))
        out = np.empty((len(self.images), *np.shape(u)), dtype=np.float32)
        for image, coefficients, into in zip(self.images, self._coefficients, out, strict=True):
            map_coordinates(coefficients, [fine_v, fine_u], into, order=3, mode="mirror", prefilter=False)
            np.clip(into, image.min(), image.max(), out=into)  # a spline may overshoot next to a dot
        return out

    @cached_property
    def _coefficients(self):
        """Of the images' cubic splines: one set serves every warp of a fit."""
        return np.stack([spline_filter(image, 3, np.float32, mode="mirror") for image in self.images])

    def _positions(self, size):
        """Pixel coordinates of the fine samples along an axis of `size` pixels."""
        return (np.arange((size + 2 * self.margin_px) * self.scale) + 0.5) / self.scale - 0.5 - self.margin_px
