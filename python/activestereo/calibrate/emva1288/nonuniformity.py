# SPDX-License-Identifier: Apache-2.0
"""Measures DSNU and PRNU, the fixed pattern of all frames, as a model's terms.

EMVA 1288 (Release 4.0 Linear, sections 4 and 8) states variances of averaged frames, which include the lamp's
unevenness, waves and defect pixels. The split here removes these in turn,

    field     a polynomial of the fourth degree: lamp, lens and glow
    waves     sinusoids that stand out from the spectrum around them
    defects   pixels farther than five standard deviations from the others

and states the variances of columns, rows and pixels of the rest, less the temporal noise's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import chi2

from activestereo.calibrate.emva1288.recording import LARGEST_CLIPPED, Recording
from activestereo.calibrate.emva1288.transfer import DEVIATIONS
from activestereo.model import Quantity

Array = NDArray[np.float64]

_DEGREE, _LEAST_SIDE = 4, 16
_DEFECT = 5.0
# A peak is a wave if noise alone would show it, anywhere in the spectrum, with less than this chance. Noise power is
# exponentially distributed.
_CHANCE, _MOST_WAVES, _BLOCK = 1e-4, 6, 16
# Waves with fewer cycles across the image belong to the field.
_SLOWEST = 8
_ROUNDS = 2
_MEDIAN_TO_SIGMA = 1.4826
_SOURCE = "EMVA 1288 nonuniformity"


@dataclass(frozen=True)
class Wave:
    """A sinusoid in the image: amplitude sin(2 pi (u x + v y) + phase). u, v: cycles per pixel."""

    amplitude: Quantity
    u: float
    v: float


@dataclass(frozen=True)
class Split:
    """The parts into which split() separates an averaged image. mean: over all pixels but defects, without waves.
    pixel, column, row: standard deviations of the offsets of pixels, columns and rows. excess: each defect's difference
    from its surroundings."""

    mean: Quantity
    pixel: Quantity
    column: Quantity
    row: Quantity
    waves: tuple[Wave, ...]
    excess: Array


@dataclass(frozen=True)
class Nonuniformity:
    """The fixed pattern's figures. dark: split of the dark frames, DN. light: split of the light, as shares. field:
    lowest and highest light over the mean. pixels: number in a frame. photons, exposure_s: of the lit frames."""

    dark: Split
    light: Split
    field: tuple[float, float]
    pixels: int
    photons: float | None
    exposure_s: float


def nonuniformity(recording: Recording) -> Nonuniformity | None:
    """Computes the figures from a lit and a dark step of three or more frames each; None without them. Of several lit
    steps it takes the one nearest to half of the range. Raises ValueError if the counts clip or no dark step has its
    exposure."""
    stacks = [step for step in recording.steps if step.average is not None]
    lit, darks = [s for s in stacks if not s.is_dark], [s for s in stacks if s.is_dark]
    if not lit or not darks:
        return None
    bright = min(lit, key=lambda step: abs(step.mean_dn - 0.5 * recording.max_dn))
    dark = next((step for step in darks if step.exposure_s == bright.exposure_s), None)
    if dark is None:
        raise ValueError(
            f"{bright.place}: no {bright.frames} dark frames of its exposure time, {bright.exposure_s:g} s: cover the "
            "lens and record as many"
        )
    if bright.clipped > LARGEST_CLIPPED:
        raise ValueError(
            f"{bright.place}: {100 * bright.clipped:.1f} % of the counts clip: record these frames at half of "
            "saturation"
        )
    of_light, of_dark = bright.average, dark.average
    assert of_light is not None and of_dark is not None
    signal, size = bright.mean_dn - dark.mean_dn, of_light.shape
    if signal <= 0.0 or min(size) < _LEAST_SIDE:
        raise ValueError(
            f"{bright.place}: {size[1]}x{size[0]} pixels, {signal:+.2f} DN over the dark: DSNU and PRNU need frames of "
            f"{_LEAST_SIDE}x{_LEAST_SIDE} or more, and light"
        )
    noise = [step.variance_dn2 / step.frames for step in (bright, dark)]
    difference = of_light - of_dark
    field = _field(difference, np.ones(difference.shape, bool))
    light = split(difference / field, sum(noise) / signal**2, "1")
    # Ends of the field over its mean, each farther out by its error. Defects change the mean, not the light.
    degrees = np.arange(_DEGREE + 1)
    relative, ends = field / field.mean(), []
    for place, sign in ((int(np.argmin(relative)), -1.0), (int(np.argmax(relative)), 1.0)):
        at = 2.0 * np.array(np.unravel_index(place, field.shape)) / (np.array(field.shape) - 1.0) - 1.0
        down, across = np.polynomial.legendre.legvander(at, _DEGREE) ** 2 * (2.0 * degrees + 1.0)
        terms = np.outer(down, across)[np.add.outer(degrees, degrees) <= _DEGREE]
        error = light.pixel.value * float(np.sqrt(terms.sum() / field.size))
        end = float(relative.flat[place]) + sign * DEVIATIONS * error
        ends.append(end / (1.0 + light.excess.sum() / bright.pixels))
    dark_split = split(of_dark, noise[1], "DN")
    return Nonuniformity(dark_split, light, (ends[0], ends[1]), bright.pixels, bright.photons, bright.exposure_s)


def split(image: Array, noise: float, unit: str) -> Split:
    """Splits an averaged image [height, width] into mean, waves, defects and the spreads of columns, rows and pixels,
    in the image's unit. noise: variance that temporal noise leaves in a pixel."""
    m, n = image.shape
    good, waves, drawn = np.ones(image.shape, bool), [], np.zeros(image.shape)
    for _ in range(_ROUNDS):  # each part is found better without the others
        field = _field(image - drawn, good)
        pixels = _without_lines(image - drawn - field, good)
        sigma = _MEDIAN_TO_SIGMA * float(np.median(np.abs(pixels - np.median(pixels))))
        good = np.abs(pixels) <= _DEFECT * max(sigma, 1e-12)
        waves = _waves(np.where(good, image - field, 0.0), unit)
        drawn = sum((part for _, part in waves), np.zeros(image.shape))
    field = _field(image - drawn, good)
    rest = image - drawn - field
    pixels = _without_lines(rest, good)
    degrees = int(good.sum()) - m - n + 1
    variance = float((pixels[good] ** 2).sum() / degrees)
    taken = 1 + _DEGREE  # the field's share of the lines' freedom
    of_columns, of_rows = (
        float((np.where(good, rest, 0.0).sum(axis=axis) / np.maximum(good.sum(axis=axis), 1)).var(ddof=taken))
        for axis in (0, 1)
    )
    column = _deviation(of_columns, n - taken, variance / m, unit)
    row = _deviation(of_rows, m - taken, variance / n, unit)
    level = float((image - drawn)[good].mean())
    half = DEVIATIONS * float(np.sqrt(variance / (m * n) + column.value**2 / n + row.value**2 / m))
    return Split(
        Quantity(level, level - half, level + half, unit, _SOURCE),
        _deviation(variance, degrees, noise, unit), column, row,
        tuple(wave for wave, _ in waves), pixels[~good],
    )  # fmt: skip


def _deviation(variance: float, degrees: int, noise: float, unit: str) -> Quantity:
    """Computes the standard deviation sqrt(variance - noise) with its 90 % interval. degrees: the variance's degrees of
    freedom. If the variance is below the noise, the interval reaches at least the square root of that deficit."""
    low, high = (variance * degrees / chi2.ppf(p, degrees) - noise for p in (0.95, 0.05))
    value, low, high = (float(np.sqrt(max(v, 0.0))) for v in (variance - noise, low, max(high, noise - variance)))
    return Quantity(value, low, high, unit, _SOURCE)


def _field(image: Array, good: NDArray[np.bool_]) -> Array:
    """Fits a polynomial of x and y to the good pixels by least squares and returns its image."""
    down, across = (np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, size), _DEGREE) for size in image.shape)
    beyond = np.add.outer(np.arange(_DEGREE + 1), np.arange(_DEGREE + 1)) > _DEGREE
    field = np.full(image.shape, image[good].mean())
    for _ in range(2):  # other pixels take the fit's own value
        weights = np.linalg.pinv(down) @ np.where(good, image, field) @ np.linalg.pinv(across).T
        weights[beyond] = 0.0
        field = down @ weights @ across.T
    return np.asarray(field)


def _without_lines(rest: Array, good: NDArray[np.bool_]) -> Array:
    """Subtracts from each pixel the means of its column and row, which are taken over good pixels."""
    for axis in (0, 1):
        count = np.maximum(good.sum(axis=axis, keepdims=True), 1)
        rest = rest - np.where(good, rest, 0.0).sum(axis=axis, keepdims=True) / count
    return rest


def _waves(image: Array, unit: str) -> list[tuple[Wave, Array]]:
    """Finds sinusoids in an image and returns each with its image, the most conspicuous peak of the spectrum first. It
    skips those along an axis, which count as rows and columns."""
    m, n = image.shape
    across = np.arange(n // 2 + 1) / n
    down = np.where(np.arange(m) <= m // 2, np.arange(m), np.arange(m) - m) / m
    lines = (np.abs(down * m)[:, None] < 2) | (across * n < 2)
    slow = (np.abs(down * m)[:, None] < _SLOWEST) & (across * n < _SLOWEST)
    rest = image - image.mean()
    found: list[tuple[Wave, Array]] = []
    while len(found) < _MOST_WAVES:
        power = np.where(lines | slow, 0.0, np.abs(np.fft.rfft2(rest)) ** 2 / rest.size)
        # The noise around each bin has a mean power by the median of its block; without any it is infinite.
        around = np.full(power.shape, np.inf)
        for top in range(0, power.shape[0], _BLOCK):
            for left in range(0, power.shape[1], _BLOCK):
                block = (slice(top, top + _BLOCK), slice(left, left + _BLOCK))
                if (inside := power[block][power[block] > 0.0]).size:
                    around[block] = np.median(inside) / np.log(2.0)
        ratio = power / around
        place = np.unravel_index(int(np.argmax(ratio)), power.shape)
        if ratio[place] < np.log(power.size / _CHANCE):
            break
        (u, v), part = _sinusoid(rest, across[place[1]], down[place[0]])
        rest = rest - part
        amplitude, half = float(np.sqrt(2.0) * part.std()), DEVIATIONS * float(np.sqrt(2.0 * rest.var() / rest.size))
        quantity = Quantity(amplitude, max(amplitude - half, 0.0), amplitude + half, unit, _SOURCE)
        found.append((Wave(quantity, u, v), part))
    return found


def _sinusoid(image: Array, u: float, v: float) -> tuple[tuple[float, float], Array]:
    """Refines the frequencies (u, v), in cycles per pixel, by least squares. Returns ((u, v), image of the sinusoid
    that fits best)."""
    m, n = image.shape

    def turns(f: Array) -> tuple[Array, Array]:
        return np.exp(2j * np.pi * f[1] * np.arange(m)), np.exp(2j * np.pi * f[0] * np.arange(n))

    def power(f: Array) -> float:
        down, across = turns(f)
        return float(-abs(down @ (image @ across.real) + 1j * (down @ (image @ across.imag))))

    simplex = np.array([[u, v], [u + 0.3 / n, v], [u, v + 0.3 / m]])
    best = minimize(
        power, simplex[0], method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-3 / max(m, n), "fatol": 0.0, "maxiter": 80},
    ).x  # fmt: skip
    down, across = turns(best)
    turn = np.outer(down, across).ravel()
    # At half a cycle per pixel the sine vanishes: a weight on it would be noise.
    weights = np.linalg.lstsq(np.stack([turn.real, turn.imag], axis=1), image.ravel(), rcond=1e-2)[0]
    return (float(best[0]), float(best[1])), (turn.real * weights[0] + turn.imag * weights[1]).reshape(m, n)
