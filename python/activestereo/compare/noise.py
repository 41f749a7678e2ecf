# SPDX-License-Identifier: Apache-2.0
"""The noise floor of a capture: how far a perfect model would still be from the measurement, in DN.

Repeats of one static view differ by temporal noise alone, so their pixelwise unbiased variance is the floor of their
frames. Frames without repeats get it from a photon-transfer noise model (EMVA 1288 with a quadratic term for speckle)
    variance = q0 + q1 * gain * signal + q2 * signal^2
fitted to the repeats; signal is DN above black. Applied to measured pixels the noise model needs no model of the scene:
the square of a noisy signal exceeds the squared mean by the variance itself, so mean(variance) = mean(q0 + q1 g s + q2
s^2) / (1 + q2). What is static and random (fixed pattern, static speckle) is not in the floor: it is for effects to
explain.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import nnls

from activestereo.capture.capture import SIDES, Capture, Frame
from activestereo.common.rounding import ROUNDING_VARIANCE

_BINS = 40
_LEAST_WIDTH_DN = 2.0
# Bins that tell a bin's variance.
_NEIGHBOURS = 5
_BLACK_LEVELS = 33
_CHI2_MARGIN = 4.0


# The frames of a repeat group, the camera, and the mean and variance over the repeats, [height][width].
Repeats: TypeAlias = tuple[list[Frame], str, np.ndarray, np.ndarray]

_Item = TypeVar("_Item")


def by_repeats(items: Iterable[tuple[Frame, str, _Item]]) -> list[list[_Item]]:
    """The frames of each static view and camera together, in order; frames without repeats are left out.

    items: (frame, camera, what belongs to them).
    """
    groups: dict[tuple[int, str], list[_Item]] = {}
    for frame, side, item in items:
        if frame.repeat_group is not None:
            groups.setdefault((frame.repeat_group, side), []).append(item)
    return list(groups.values())


@dataclass(frozen=True)
class NoiseModel:
    """variance_dn2 = offset + shot * gain * signal + relative * signal^2, signal in DN above black_dn."""

    offset: float
    shot: float
    relative: float
    black_dn: float

    def variance(self, mean_dn: np.ndarray, gain: float | np.ndarray = 1.0) -> np.ndarray:
        """Variance in DN^2 at an expected value."""
        signal = np.maximum(np.asarray(mean_dn, dtype=np.float64) - self.black_dn, 0.0)
        return self.offset + self.shot * gain * signal + self.relative * signal**2

    def mean_variance(self, measured_dn: np.ndarray, gain: float | np.ndarray = 1.0) -> float:
        """Mean variance of one image's pixels, from the noisy image itself."""
        signal = np.asarray(measured_dn, dtype=np.float64) - self.black_dn
        raw = self.offset + self.shot * gain * signal.mean() + self.relative * (signal**2).mean()
        return raw / (1.0 + self.relative)


def repeat_statistics(
    capture: Capture, split: str | None = None, drift: Mapping[tuple[int, str], np.ndarray] | None = None
) -> list[Repeats]:
    """Pixelwise mean and unbiased variance of every repeat group and camera: [(frames, camera, mean, variance)], DN,
    NaN where the scene is not known.

    drift: {(frame id, side): what is known to differ between repeats, DN [height][width]}, taken out of the images.
    """
    known = drift or {}
    statistics = []
    for frames in capture.repeats(split).values():
        for side in SIDES:
            stack = np.stack([capture.ir(frame, side) - known.get((frame.id, side), 0.0) for frame in frames])
            if (scene := capture.known(frames[0], side)) is not None:
                stack[:, ~scene] = np.nan
            statistics.append((frames, side, stack.mean(axis=0), stack.var(axis=0, ddof=1)))
    return statistics


def fit_noise_model(statistics: Sequence[Repeats], black_dn: float, max_dn: float) -> NoiseModel | None:
    """The photon-transfer noise model of repeats, or None without repeats. Clipped pixels are left out.

    black_dn is an upper bound: a quadratic cannot tell shot noise above a high black level from speckle above a low
    one, and a fitted black level is biased while an effect is missing. Of the levels that fit, the lowest is taken: it
    asks for the least shot noise, so the least is extrapolated to gains that no repeat has shown.
    """
    bins = [row for entry in statistics for row in transfer_rows(entry, max_dn)]
    if not bins:
        return None
    gain, mean, square, variance, weight = np.array(bins).T
    noise_models = []
    for black in np.linspace(0.0, max(black_dn, 0.0), _BLACK_LEVELS):
        signal, signal_square = mean - black, square - 2 * black * mean + black**2
        terms = np.stack([np.ones_like(mean), gain * signal, signal_square], axis=1)
        (offset, shot, relative), chi2 = fit_terms(np.maximum(terms, 0.0), variance, weight)
        noise_models.append((chi2, NoiseModel(offset, shot, relative, float(black))))
    limit = 1.05 * min(chi2 for chi2, _ in noise_models) + _CHI2_MARGIN
    return next(noise_model for chi2, noise_model in noise_models if chi2 <= limit)


def fit_terms(terms: np.ndarray, variance: np.ndarray, weight: np.ndarray) -> tuple[list[float], float]:
    """(Coefficients of the noise model's terms [n][term], none below 0; chi square). weight: 1 / standard error."""
    coefficients, misfit = nnls(terms * weight[:, None], variance * weight)
    return [float(value) for value in coefficients], misfit**2


def transfer_points(capture: Capture) -> list[dict[str, float]]:
    """The photon-transfer curve of the repeats: [{gain, mean_dn, variance_dn2}], both cameras, clipped pixels left
    out."""
    bins = [row for entry in repeat_statistics(capture) for row in transfer_rows(entry, capture.rig.max_dn)]
    return [{"gain": float(gain), "mean_dn": float(mean), "variance_dn2": float(v)} for gain, mean, _, v, _ in bins]


def transfer_rows(entry: Repeats, max_dn: float) -> list[tuple[float, ...]]:
    """Rows (gain, mean, mean of squares, variance, 1 / standard error of the variance) over bins of equal pixel count.
    """
    frames, _, mean, variance = entry
    count = len(frames)
    inside = (mean > 0) & (mean < max_dn - 1)
    mean, variance = mean[inside], variance[inside]
    edges = _apart(np.quantile(mean, np.linspace(0, 1, _BINS + 1))) if mean.size else np.zeros(1)
    index = np.clip(np.searchsorted(edges, mean, side="right") - 1, 0, max(len(edges) - 2, 0))
    rows = []
    for b in np.unique(index):
        m, v = mean[index == b], variance[index == b]
        # A mean of n repeats is itself noisy: its square is too large by variance / n.
        rows.append((frames[0].gain, m.mean(), (m**2 - v / count).mean(), v.mean(), m.size))
    return _with_weights(rows, count)


def _apart(edges: np.ndarray) -> np.ndarray:
    """Ascending bin edges without those that lie too close: repeats of whole numbers agree more often at some means
    than at others."""
    kept = [edges[0]]
    for edge in edges[1:]:
        if edge >= kept[-1] + _LEAST_WIDTH_DN:
            kept.append(edge)
    return np.array(kept)


def _with_weights(rows: list[Any], count: Any) -> list[Any]:
    """The rows with weights in place of their pixel counts. A bin's error goes by the variance around it: equal and
    unequal numbers have different means, so that a bin's own variance is large or small by how whole numbers fall into
    it."""
    if not rows:
        return rows
    gain, mean, square, variance, pixels = np.array(rows).T
    around = uniform_filter1d(variance * pixels, _NEIGHBOURS, mode="nearest") / uniform_filter1d(
        pixels, _NEIGHBOURS, mode="nearest"
    )
    # Pixels that vary less than rounding does are clipped somewhere on their way: they must not pass for exact.
    error = np.maximum(around, ROUNDING_VARIANCE) * np.sqrt(2.0 / ((count - 1) * pixels))
    return list(zip(gain, mean, square, variance, 1.0 / error, strict=True))


def frame_noise_variances(
    capture: Capture, black_dn: float, no_noise: Mapping[tuple[int, str], np.ndarray] | None = None
) -> tuple[dict[tuple[int, str], tuple[float, str]], NoiseModel | None]:
    """({(frame id, side): (variance in DN^2, "repeats" or "noise model")}, noise model). Without any repeats: ({},
    None).

    The noise model is fitted on the train repeats where there are any, else on all. no_noise: DN [height][width] that
    are taken out of images: of repeats what is known to differ between them, of others what is no light.
    """
    known = no_noise or {}
    statistics = repeat_statistics(capture, drift=known)
    train = [entry for entry in statistics if entry[0][0].split == "train"]
    noise_model = fit_noise_model(train or statistics, black_dn, capture.rig.max_dn)
    if noise_model is None:
        return {}, None
    noise_variances: dict[tuple[int, str], tuple[float, str]] = {}
    for frames, side, _, variance in statistics:
        for frame in frames:
            noise_variances[frame.id, side] = (float(np.nanmean(variance)), "repeats")
    for frame in capture.frames:
        for side in SIDES:
            if (frame.id, side) not in noise_variances:
                lit = capture.ir(frame, side) - known.get((frame.id, side), 0.0)
                noise_variances[frame.id, side] = (noise_model.mean_variance(lit, frame.gain), "noise model")
    return noise_variances, noise_model
