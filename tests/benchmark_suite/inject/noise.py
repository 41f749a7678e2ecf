# SPDX-License-Identifier: Apache-2.0
"""Models the noise of measured images, variance = floor + slope x light (EMVA 1288). After an effect that reduces noise
it adds the lost noise, because a blurred lens does not quieten an imager."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2

from inject.effects import Light

from activestereo.capture.capture import SIDES, Capture

ROUNDING = 1.0 / 12.0  # variance in DN^2 of rounding to whole DN
_BINS, _FEWEST = 16, 64
_BLOCK = 4  # side of a block, in second differences; the quietest blocks show the noise
_QUIET = 0.1


@dataclass(frozen=True)
class NoiseModel:
    """Noise variance in DN^2 as floor_dn2 + slope_dn x light in DN above black. measured: by which method."""

    floor_dn2: float
    slope_dn: float
    measured: str

    def variance(self, light: np.ndarray) -> np.ndarray:
        return self.floor_dn2 + self.slope_dn * np.maximum(light, 0.0)


def measured_noise_model(capture: Capture, black_dn: float) -> NoiseModel:
    """Fits the noise model to differences of repeats, else to the quietest blocks, where texture makes it too high."""
    pairs = [
        (capture.ir(first, side), capture.ir(second, side))
        for frames in capture.repeats()
        for first, second in zip(frames[:-1], frames[1:], strict=True)
        for side in SIDES
        if first.has_infrared and second.has_infrared
    ]
    if pairs:
        first, second = (np.concatenate([image.ravel() for image in images]) for images in zip(*pairs, strict=True))
        level, variance, how = (first + second) / 2, (first - second) ** 2 / 2, "repeats"
    else:
        each = [_quiet_blocks(capture.ir(f, side)) for f in capture.frames if f.has_infrared for side in SIDES]
        level, variance = (np.concatenate(part) for part in zip(*each, strict=True))
        how = "quietest places"
    floor, slope = _line(level - black_dn, variance, capture.rig.max_dn - black_dn, None if pairs else _QUIET)
    return NoiseModel(floor, slope, how)


def _quiet_blocks(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns (mean, noise variance) of blocks, by second differences (Immerkaer 1996) of separate 3x3 pixels."""
    side = 3 * _BLOCK
    rows, columns = (length // side for length in image.shape)
    blocks = image[: rows * side, : columns * side].reshape(rows, _BLOCK, 3, columns, _BLOCK, 3)
    difference = np.einsum("ribcjd,b,d->ricj", blocks, [1, -2, 1], [1, -2, 1])
    variance = (difference**2 / 36.0).mean(axis=(1, 3))
    return blocks.mean(axis=(1, 2, 4, 5)).ravel(), variance.ravel()


def _line(level: np.ndarray, variance: np.ndarray, full: float, quiet: float | None) -> tuple[float, float]:
    """Fits variance = floor + slope x level, both at least 0, to bins of equal count; returns (floor, slope). quiet:
    the quantile of a bin's variances to use, corrected for pure noise; None for their mean."""
    usable = level < 0.95 * full
    level, variance = level[usable], variance[usable]
    order = np.array_split(np.argsort(level, kind="stable"), max(1, min(_BINS, len(level) // _FEWEST)))
    if not len(level):
        return ROUNDING, 0.0
    centres = np.array([level[part].mean() for part in order])
    if quiet is None:
        heights = np.array([variance[part].mean() for part in order])
    else:
        count = _BLOCK**2
        expected = chi2.ppf(quiet, count) / count
        heights = np.array([np.quantile(variance[part], quiet) for part in order]) / expected
    weights = 1.0 / np.maximum(heights, ROUNDING)
    (floor, slope), _ = nnls(np.stack([weights, weights * np.maximum(centres, 0.0)], 1), weights * heights)
    return max(float(floor), ROUNDING), float(slope)


def with_noise(light: Light, noise_model: NoiseModel, generator: np.random.Generator) -> Light:
    """Adds noise until each level has the noise model's variance, less that of the later rounding."""
    lacking = np.maximum(noise_model.variance(light.value) - light.variance - ROUNDING, 0.0)
    added = np.sqrt(lacking) * generator.standard_normal(light.value.shape)
    return Light(light.value + added, light.variance + lacking)
