# SPDX-License-Identifier: Apache-2.0
"""Photon transfer: what an imager is like, from frames of even light and of darkness alone (EMVA Standard 1288, release
4.0, linear).

    result = photon_transfer(take, exposures_s=np.linspace(0.02, 1.0, 50))
    print(result.conversion_gain_dn_per_e, result.read_noise_e)

It needs raw counts, proportional to light, no spatial processing (a resampled image has too little noise), and half a
count of noise or more in the dark, so that steps do not hide it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from activestereo.common.rounding import ROUNDING_VARIANCE

Take = Callable[[float, bool, int], ArrayLike]
_LINEAR_SHARE = 0.7  # of saturation: EMVA 1288's range of the gain fit
_SMALLEST_LEVELS = 6


@dataclass(frozen=True)
class PhotonTransfer:
    """Arrays in the order of exposures_s, and the figures of merit. DN above 0; variances are temporal."""

    exposures_s: np.ndarray
    mean_dn: np.ndarray
    variance_dn2: np.ndarray
    dark_mean_dn: np.ndarray
    dark_variance_dn2: np.ndarray
    conversion_gain_dn_per_e: float  # EMVA's overall system gain K
    read_noise_e: float  # temporal noise of the dark at exposure 0, without quantisation's
    full_well_e: float  # saturation capacity: electrons where the variance is largest
    dark_current_e_per_s: float
    prnu: float  # relative standard deviation
    dsnu_e: float
    black_level_dn: float  # the dark's mean at exposure 0
    linearity_error: float  # largest deviation from a straight line over the mean, 5..95 % of saturation


def photon_transfer(take: Take, exposures_s: ArrayLike, stack_count: int = 32) -> PhotonTransfer:
    """take(exposure_s, is_lit, frame) -> counts [height, width]: a frame of even, constant light or of darkness; frames
    of equal arguments may be equal, others have noise of their own. exposures_s: increasing, from far below saturation
    to beyond it, evenly spaced (EMVA: 50 of them). stack_count: frames that the fixed patterns are averaged over, at
    the exposure nearest half saturation. Raises ValueError where the exposures do not show what is asked for.
    """
    exposures_s = np.asarray(exposures_s, dtype=np.float64)
    if (
        exposures_s.ndim != 1
        or len(exposures_s) < _SMALLEST_LEVELS
        or np.any(np.diff(exposures_s) <= 0)
        or exposures_s[0] < 0
    ):
        raise ValueError(f"exposures_s must be at least {_SMALLEST_LEVELS} increasing times")
    mean, variance = np.transpose([_pair_statistics(take, t, True) for t in exposures_s])
    dark_mean, dark_variance = np.transpose([_pair_statistics(take, t, False) for t in exposures_s])
    saturated = int(np.argmax(variance))
    signal, noise = mean - dark_mean, variance - dark_variance
    if saturated == len(exposures_s) - 1:
        raise ValueError(
            f"the longest exposure, {exposures_s[-1]:g} s, does not saturate: "
            f"the mean is {mean[-1]:.6g} DN and noise still grows"
        )
    linear = signal <= _LINEAR_SHARE * signal[saturated]
    if linear.sum() < 3:
        raise ValueError(
            f"only {linear.sum()} exposures lie below {_LINEAR_SHARE:.0%} of saturation ({mean[saturated]:.6g} DN): "
            "take shorter ones"
        )
    gain = _slope_through_zero(signal[linear], noise[linear])
    dark_slope, black = np.polyfit(exposures_s, dark_mean, 1)
    read_variance = np.polyfit(exposures_s, dark_variance, 1)[1] - ROUNDING_VARIANCE
    half = int(np.argmin(np.abs(signal[: saturated + 1] - 0.5 * signal[saturated])))
    prnu, dsnu_dn = _fixed_patterns(take, exposures_s[half], stack_count)
    return PhotonTransfer(
        exposures_s, mean, variance, dark_mean, dark_variance,
        conversion_gain_dn_per_e=gain,
        read_noise_e=float(np.sqrt(max(read_variance, 0.0)) / gain),
        full_well_e=float(signal[saturated] / gain),
        dark_current_e_per_s=float(dark_slope / gain),
        prnu=prnu,
        dsnu_e=dsnu_dn / gain,
        black_level_dn=float(black),
        linearity_error=_linearity_error(exposures_s, signal, signal[saturated]),
    )  # fmt: skip


def _pair_statistics(take: Take, exposure_s: float, is_lit: bool) -> tuple[float, float]:
    """Mean and temporal variance of two frames; their difference is free of fixed patterns."""
    a, b = (np.asarray(take(exposure_s, is_lit, frame), dtype=np.float64) for frame in (0, 1))
    difference = a - b
    return 0.5 * (a.mean() + b.mean()), 0.5 * ((difference - difference.mean()) ** 2).mean()


def _slope_through_zero(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.sum(x * y) / np.sum(x * x))


def _fixed_patterns(take: Take, exposure_s: float, count: int) -> tuple[float, float]:
    """(PRNU, DSNU in DN): spatial deviations of mean frames, without what temporal noise leaves in the mean."""

    def of(is_lit: bool) -> tuple[float, float]:
        stack = np.stack([np.asarray(take(exposure_s, is_lit, frame), dtype=np.float64) for frame in range(count)])
        average = stack.mean(axis=0)
        return average.mean(), average.var() - stack.var(axis=0, ddof=1).mean() / count

    (mean, variance), (dark_mean, dark_variance) = of(True), of(False)
    prnu = np.sqrt(max(variance - dark_variance, 0.0)) / (mean - dark_mean)
    return float(prnu), float(np.sqrt(max(dark_variance, 0.0)))


def _linearity_error(exposures_s: np.ndarray, signal: np.ndarray, saturation: float) -> float:
    used = (signal >= 0.05 * saturation) & (signal <= 0.95 * saturation)
    if used.sum() < 3:
        return float("nan")
    slope, offset = np.polyfit(exposures_s[used], signal[used], 1, w=1.0 / signal[used])
    return float(np.max(np.abs(signal[used] / (slope * exposures_s[used] + offset) - 1.0)))
