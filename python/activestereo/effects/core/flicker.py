# SPDX-License-Identifier: Apache-2.0
"""Finds starting values for a fit of flickering light. Its likelihood has a peak every hundredth of a hertz, so all
frequencies are tried.

The residual of a row is linear in the sine and cosine of the flicker's phase at the row's time. Each pair of frequency
and line time is therefore a regression on a few sums per row. The ambient level is fitted as well: a fit without
flicker took the mean of a few phases for it. Light is never negative, so a wave larger than its mean counts as one of
that size. Slow waves, of which frames show a few similar phases, would otherwise pass for the level.
"""

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.effects.core.judging import StartImage

# Lamps flicker at twice the mains' 50 or 60 Hz, which grids and generators keep to 2 %. A few frames would fit
# other frequencies as well.
_FREQUENCIES_HZ = np.arange(98.0, 122.5, 0.02)
_FINE_STEPS = 50
_LINE_TIMES_S = np.arange(0.0, 6.1e-5, 5e-6)
_STARTS = 8

# (frame, sums over each row of w A^2 and w A r), with weight w, ambient light A and residual r.
_RowSums = tuple[Frame, np.ndarray, np.ndarray]


def flicker_starts(images: list[StartImage]) -> list[dict[str, float]]:
    """Returns the best few fits of flicker as {depth, frequency_hz, phase_rad, line_time_s}, best first. Each has
    another frequency, because a few frames hardly tell frequencies apart."""
    rows = []
    for image in images:
        weighted = image.weight * image.ambient
        sums = (weighted * image.ambient).sum(axis=1), (weighted * image.residual).sum(axis=1)
        rows.append((image.view.frame, *sums))
    gains, depths, phases = (np.stack(x) for x in zip(*(_gains(rows, t) for t in _LINE_TIMES_S), strict=True))
    line, best = gains.argmax(axis=0), gains.max(axis=0)
    beside = np.pad(best, 1, constant_values=-np.inf)
    peaks = np.flatnonzero((best >= beside[:-2]) & (best > beside[2:]))
    return [
        {
            "depth": float(depths[line[i], i]),
            "frequency_hz": float(_FREQUENCIES_HZ[i]),
            "phase_rad": float(phases[line[i], i]),
            "line_time_s": float(_LINE_TIMES_S[line[i]]),
        }
        for i in peaks[np.argsort(-best[peaks])][:_STARTS]
    ]


def _gains(images: list[_RowSums], line_time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns (fall of chi2, depth, phase in radians), each an array over all frequencies. line_time: seconds.

    Sums of squares and products of sine and cosine follow from twice the angle: from a row's wave exp(i angle) and its
    square.
    """
    total, square, product, level = 0.0, 0.0, 0.0, 0.0
    waves = {len(strength): _row_waves(len(strength), line_time) for _, strength, _ in images}
    for frame, strength, moment in images:
        rows, start = waves[len(strength)], np.exp(2j * np.pi * _FREQUENCIES_HZ * frame.timestamp_s)
        averaged = np.sinc(_FREQUENCIES_HZ * frame.exposure_s)
        total = total + averaged**2 * strength.sum()
        square = square + (averaged * start) ** 2 * ((rows * rows) @ strength)
        product = product + averaged * start * (rows @ moment)
        level = level + averaged * start * (rows @ strength)
    # Normal equations of sine and cosine after the level's share (Schur's complement).
    light = sum(strength.sum() for _, strength, _ in images) + 1e-30
    rest = sum(moment.sum() for *_, moment in images)
    product = product - level * (rest / light)
    ss, cc, sc = 0.5 * (total - square.real), 0.5 * (total + square.real), 0.5 * square.imag
    ss, cc, sc = ss - level.imag**2 / light, cc - level.real**2 / light, sc - level.real * level.imag / light
    determinant = np.maximum(ss * cc - sc * sc, 1e-12 * (ss * cc + 1e-30))
    sine = (cc * product.imag - sc * product.real) / determinant
    cosine = (ss * product.real - sc * product.imag) / determinant
    mean = np.maximum(1.0 + (rest - sine * level.imag - cosine * level.real) / light, 0.0)
    amplitude = np.hypot(sine, cosine) + 1e-30
    taken = np.minimum(mean / amplitude, 1.0)
    fall = taken * (2.0 - taken) * (sine * product.imag + cosine * product.real)
    return fall, np.minimum(amplitude / (mean + 1e-30), 1.0), np.arctan2(cosine, sine)


def _row_waves(height: int, line_time: float) -> np.ndarray:
    """Returns exp(i angle) of rows counted from the middle, [frequencies][height]. Products of coarse and fine steps of
    frequency make it cheap."""
    lag = 2j * np.pi * line_time * (np.arange(height) - (height - 1) / 2)
    coarse = np.exp(np.outer(_FREQUENCIES_HZ[::_FINE_STEPS], lag))
    fine = np.exp(np.outer(_FREQUENCIES_HZ[:_FINE_STEPS] - _FREQUENCIES_HZ[0], lag))
    return (coarse[:, None] * fine).reshape(-1, height)[: len(_FREQUENCIES_HZ)]
