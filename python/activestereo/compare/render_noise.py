# SPDX-License-Identifier: Apache-2.0
"""Squared errors of rendered images without the renderer's own noise.

An image that a renderer expects is the mean x = (a + b) / 2 of two halves of the samples, rendered with independent
random numbers. Where m is the measurement, mean((a - m) (b - m)) has the renderer's noise in neither factor twice, and
so, unlike mean((x - m)^2), is not raised by it: it is the squared error of an image with infinitely many samples. Both
differ by mean((a - b)^2) / 4, whatever m is.
"""

from dataclasses import replace

import numpy as np

from activestereo.compare.layers import Layers, PixelLayers
from activestereo.compare.render import Halves, LayersOfFrames
from activestereo.effects.core.resample import SupersampledImages


def noise_square(first: np.ndarray, second: np.ndarray) -> float:
    """Mean square of the renderer's noise in the mean of two halves, in the square of their unit."""
    return float(np.mean((np.asarray(first, dtype=np.float64) - second) ** 2)) / 4.0


def rmse_without_noise(squares: float, pixels: int, noise_squares: float) -> float:
    """Root mean square error from a sum of squared errors and the part of it that is the renderer's noise."""
    return float(np.sqrt(max(squares - noise_squares, 0.0) / pixels))


def mean_of_halves(halves: Halves) -> LayersOfFrames:
    """The Layers of all samples; frames that share their halves share them."""
    known: dict[tuple[int, int], Layers] = {}

    def mean(first: Layers, second: Layers) -> Layers:
        key = id(first), id(second)
        if key not in known:
            known[key] = mean_layers(first, second)
        return known[key]

    first, second = halves
    return {
        number: {side: mean(x, second[number][side]) for side, x in sides.items()} for number, sides in first.items()
    }


def mean_layers(first: Layers, second: Layers) -> Layers:
    """The mean light of two renders of one view; its geometry is the first one's."""
    names = ("direct", "indirect", "ambient", "flat")
    light = {name: _mean(getattr(first, name), getattr(second, name)) for name in names}
    if first.ambient_direct is not None and second.ambient_direct is not None:
        light["ambient_direct"] = _mean(first.ambient_direct, second.ambient_direct)
    if isinstance(first, PixelLayers) and isinstance(second, PixelLayers):
        supersampled = SupersampledImages(
            _mean(first.supersampled.images(), second.supersampled.images()),
            first.supersampled.scale,
            first.supersampled.margin_px,
        )
        return replace(first, **light, supersampled=supersampled)
    return replace(first, **light)


def _mean(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return (0.5 * (first + second)).astype(np.float32)
