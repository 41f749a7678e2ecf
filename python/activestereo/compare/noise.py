# SPDX-License-Identifier: Apache-2.0
"""Measures the noise of a capture's images: a photon-transfer noise model, and each image's noise floor, the error in
DN that a perfect model would still have.

Repeats of one static view differ by temporal noise alone, so their pixelwise unbiased variance is the floor of their
frames. Frames without repeats get their floor from a noise model (EMVA 1288 with a quadratic term for speckle)

    variance = q0 + q1 * gain * signal + q2 * signal^2

fitted to the repeats; signal is DN above black. The mean square of a noisy signal contains the variance itself. So the
variance computed from a measured image is divided by (1 + q2). In a capture without repeats, half of the variance of
the difference between both cameras, in smooth parts, bounds the noise: it contains speckle and errors of the depth.

Static random errors (fixed pattern, static speckle) are not in the floor: effects have to explain them. Rounding is in
the floor, even where steps are wider than the noise, so that repeats round alike and do not show it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_gradient_magnitude, uniform_filter1d
from scipy.optimize import linprog, nnls
from scipy.special import ndtr

from activestereo.capture.capture import SIDES, Capture, Frame, ImageKey, repeat_keys
from activestereo.common.grouped import grouped
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.measured_image import MeasuredImage, warp_between
from activestereo.compare.nuisances import regressors

_BINS = 40
_LEAST_WIDTH_STEPS = 2.0
# Number of neighbouring bins that are averaged for a bin's standard error.
_NEIGHBOURS = 5
_BLACK_LEVELS = 33
_CHI2_MARGIN = 4.0


# Steps of a comb, DN. A comb holds _COMB_SHARE of the pixels; fewer than _LEAST_LEVELS used levels, or more than
# _MOST_USED of all levels, are no comb. The levels' spectrum is _FINER than their range needs. A step is tried where it
# exceeds _LEAST_PEAK: rounding to whole numbers leaves sin(pi / step) / (pi / step) of a peak.
_NARROWEST, _WIDEST, _COMB_SHARE, _LEAST_LEVELS, _MOST_USED = 1.5, 32.0, 0.995, 6, 0.7
_FINER, _LEAST_PEAK = 8, 0.3
# The rounding's variance in a bin is uncertain by this share.
_UNEVEN = 0.2
# Multiples of it, modulo 1, fill the unit interval evenly (Weyl 1916).
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
# Noise in steps, and terms of the Fourier series of rounding.
_NOISE_STEPS, _TERMS = np.linspace(0.0, 1.0, 201), np.arange(1, 200)

# The frames of a repeat group, the camera, and the mean and variance over the repeats, [height][width].
Repeats: TypeAlias = tuple[list[Frame], str, np.ndarray, np.ndarray]

_Item = TypeVar("_Item")


def by_repeats(items: Iterable[tuple[Frame, str, _Item]]) -> list[list[_Item]]:
    """Groups (frame, camera, item) by static view and camera; returns the items of each group in order. Frames without
    repeats are left out."""
    every = list(items)
    keys = repeat_keys(frame for frame, _, _ in every)
    groups = grouped(((keys[frame.id], side), item) for frame, side, item in every if frame.id in keys)
    return [group for group in groups if len(group) > 1]


@dataclass(frozen=True)
class NoiseModel:
    """A noise model: variance in DN^2 = offset + shot * gain * signal + relative * signal^2, with signal in DN above
    black_dn."""

    offset: float
    shot: float
    relative: float
    black_dn: float

    def variance(self, mean_dn: np.ndarray, gain: float | np.ndarray = 1.0) -> np.ndarray:
        """Returns the variance, DN^2, at an expected value."""
        signal = np.maximum(np.asarray(mean_dn, dtype=np.float64) - self.black_dn, 0.0)
        return self.offset + self.shot * gain * signal + self.relative * signal**2

    def mean_variance(self, measured_dn: np.ndarray, gain: float | np.ndarray = 1.0) -> float:
        """Estimates the mean variance, DN^2, of one image's pixels from the noisy image itself."""
        signal = np.asarray(measured_dn, dtype=np.float64) - self.black_dn
        raw = self.offset + self.shot * gain * signal.mean() + self.relative * (signal**2).mean()
        return raw / (1.0 + self.relative)

    def image_variance(self, image: MeasuredImage) -> float:
        """Estimates the mean variance of a measured image's pixels, DN^2, rounding included."""
        return max(self.mean_variance(image.measured, image.frame.gain), ROUNDING_VARIANCE)


@dataclass(frozen=True)
class Comb:
    """Describes digital numbers that occur only at multiples of a coarse step. limits_dn: the least and the largest
    step that explain them. levels: the values that occur, ascending. pixels: number of unclipped pixels."""

    limits_dn: tuple[float, float]
    levels: np.ndarray
    pixels: int

    @property
    def step_dn(self) -> float:
        """The middle of limits_dn, DN."""
        return sum(self.limits_dn) / 2.0

    def mean_error(self, image: np.ndarray, variance: np.ndarray) -> np.ndarray:
        """Returns the rounding's bias, DN [height][width]: each pixel's mean rounded value minus its expected value.
        image: expected DN. variance: of noise and rounding, DN^2."""
        sigma = np.sqrt(np.maximum(variance - ROUNDING_VARIANCE * self.step_dn**2, ROUNDING_VARIANCE))
        mean = np.full(image.shape, float(self.levels[0]))
        for low, high in zip(self.levels, self.levels[1:], strict=False):
            mean += (high - low) * ndtr((image - 0.5 * (low + high)) / sigma)
        return mean - image


def comb_of(images: Iterable[np.ndarray], max_dn: float) -> Comb | None:
    """Returns the Comb with the coarsest step that explains nearly all pixels; None without one, or if few levels
    occur."""
    size = int(max_dn) + 1
    counts = np.sum([np.bincount(np.rint(i).astype(int).ravel(), minlength=size) for i in images], axis=0)
    counts[0] = counts[-1] = 0  # clipped
    total, order, occurring = int(counts.sum()), np.argsort(-counts, kind="stable"), np.flatnonzero(counts)
    if len(occurring) < _LEAST_LEVELS:
        return None
    most = max(_LEAST_LEVELS, 1 + int(np.searchsorted(np.cumsum(counts[order]), _COMB_SHARE * total)))
    used = np.sort(order[:most])
    if len(used) > _MOST_USED * (used[-1] - used[0] + 1):
        return None
    spectrum = np.fft.rfft(np.bincount(used, minlength=size) / len(used), _FINER * size)
    peak, frequency = np.abs(spectrum), np.arange(len(spectrum)) / (_FINER * size)
    likely = np.flatnonzero((peak > _LEAST_PEAK) & (peak >= np.roll(peak, 1)) & (peak >= np.roll(peak, -1)))
    # Of whole numbers, 1 - f is the same frequency as f.
    steps = 1.0 / np.maximum(np.concatenate([frequency[likely], 1.0 - frequency[likely]]), 1e-12)
    for step in sorted(steps[(steps >= _NARROWEST) & (steps <= _WIDEST)], reverse=True):
        if (lines := _rounded_lines(used, step)) is not None:
            lines, levels = _with_rare_levels(lines, used, occurring)
            return Comb((lines[0, 0], lines[1, 0]), levels, total)
    return None


def _with_rare_levels(lines: np.ndarray, used: np.ndarray, occurring: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the _rounded_lines() of all occurring levels that some comb between `lines` rounds to, and these levels.
    Rare levels are bright, far from the others: they tell the step best."""
    while True:
        middle, offset = lines.mean(axis=0)
        number = np.rint((occurring - offset) / middle)
        low, high = np.sort(np.outer(lines[:, 0], number) + lines[:, 1:], axis=0)
        near = occurring[(occurring > low - 0.51) & (occurring < high + 0.51) & (high - low < 0.5 * middle)]
        finer = _rounded_lines(near, middle) if len(near) > len(used) else None
        if finer is None:
            return lines, near
        lines, used = finer, near


def _rounded_lines(levels: np.ndarray, step: float) -> np.ndarray | None:
    """Returns the narrowest and the widest of all combs near `step` that round to the levels, [2] (step, offset); None
    if there is none."""
    turn = np.exp(2j * np.pi * levels / step).sum()
    number = np.rint(levels / step - np.angle(turn) / (2.0 * np.pi))
    if (np.diff(number) < 1).any():  # two levels of one number fit where their middle is its value
        return None
    line = np.stack([number, np.ones(len(levels))], axis=1)
    within = {"A_ub": np.concatenate([line, -line]), "b_ub": np.concatenate([levels + 0.5, 0.5 - levels])}
    found = [linprog([sign, 0.0], **within, bounds=(None, None)) for sign in (1.0, -1.0)]
    return np.array([fit.x for fit in found]) if all(fit.success for fit in found) else None


def _all_noise(variance: float | np.ndarray, step_dn: float) -> np.ndarray:
    """Returns the variance of noise and rounding, DN^2, from the mean variance of repeats. If the noise is small,
    repeats round alike and miss a part of the rounding's variance (Widrow and Kollar 2008, Quantization Noise)."""
    waves = np.exp(-((2.0 * np.pi * np.outer(_NOISE_STEPS, _TERMS)) ** 2))
    missed, square = (waves / _TERMS**2).sum(axis=1) / (2.0 * np.pi**2), step_dn**2
    seen = _NOISE_STEPS**2 + ROUNDING_VARIANCE - missed
    return np.asarray(variance + square * np.interp(np.asarray(variance) / square, seen, missed, right=0.0))


def repeat_statistics(
    capture: Capture, split: str | None = None, drift: Mapping[ImageKey, np.ndarray] | None = None
) -> list[Repeats]:
    """Computes the pixelwise mean and unbiased variance of every repeat group and camera: [(frames, camera, mean,
    variance)], DN; NaN where the scene is unknown.

    drift: {(frame id, side): known differences between repeats, DN [height][width]}, which are subtracted from the
    images.
    """
    known = drift or {}
    statistics = []
    for frames in capture.repeats(split):
        for side in SIDES:
            stack = np.stack([capture.ir(frame, side) - known.get((frame.id, side), 0.0) for frame in frames])
            if (scene := capture.known(frames[0], side)) is not None:
                stack[:, ~scene] = np.nan
            statistics.append((frames, side, stack.mean(axis=0), stack.var(axis=0, ddof=1)))
    return statistics


def fit_noise_model(
    statistics: Sequence[Repeats], black_dn: float, max_dn: float, step_dn: float = 1.0
) -> NoiseModel | None:
    """Fits the photon-transfer noise model to repeats; None without repeats. step_dn: step between digital numbers, DN.

    black_dn is an upper bound: a quadratic cannot distinguish shot noise above a high black level from speckle above a
    low one. The lowest level that fits is taken. It needs the least shot noise, so the extrapolation to gains without
    repeats is smallest.
    """
    bins = [row for entry in statistics for row in transfer_rows(entry, max_dn, step_dn)]
    if not bins:
        return None
    gain, mean, square, variance, weight = np.array(bins).T
    rounding = ROUNDING_VARIANCE * step_dn**2  # the same at every gain
    noise_models = []
    for black in np.linspace(0.0, max(black_dn, 0.0), _BLACK_LEVELS):
        signal, signal_square = mean - black, square - 2 * black * mean + black**2
        terms = np.stack([np.ones_like(mean), gain * signal, signal_square], axis=1)
        (offset, shot, relative), chi2 = fit_terms(np.maximum(terms, 0.0), variance - rounding, weight)
        noise_models.append((chi2, NoiseModel(rounding + offset, shot, relative, float(black))))
    limit = 1.05 * min(chi2 for chi2, _ in noise_models) + _CHI2_MARGIN
    return next(noise_model for chi2, noise_model in noise_models if chi2 <= limit)


def fit_terms(terms: np.ndarray, variance: np.ndarray, weight: np.ndarray) -> tuple[list[float], float]:
    """Fits the noise model's coefficients, none below 0, to variances [n]. Returns (coefficients, chi square). terms:
    [n][term]; weight: 1 / standard error."""
    coefficients, misfit = nnls(terms * weight[:, None], variance * weight)
    return [float(value) for value in coefficients], misfit**2


def transfer_points(capture: Capture) -> list[dict[str, float]]:
    """Returns the photon-transfer curve of the repeats, [{gain, mean_dn, variance_dn2}], for both cameras, without
    clipped pixels."""
    bins = [row for entry in repeat_statistics(capture) for row in transfer_rows(entry, capture.rig.max_dn)]
    return [{"gain": float(gain), "mean_dn": float(mean), "variance_dn2": float(v)} for gain, mean, _, v, _ in bins]


def transfer_rows(entry: Repeats, max_dn: float, step_dn: float = 1.0) -> list[tuple[float, ...]]:
    """Returns rows (gain, mean, mean of squares, variance, 1 / standard error of the variance) over bins of equal pixel
    count in one repeat group. step_dn: step between digital numbers, DN."""
    frames, _, mean, variance = entry
    count = len(frames)
    inside = (mean > 0) & (mean < max_dn - 1)
    mean, variance = mean[inside], variance[inside]
    if not mean.size:
        return []
    # Bins must not be too narrow, because repeats of whole numbers agree more often at some means than at others.
    # Means of coarse steps are few. Spread over a step, each bin gets its share of repeats that round alike.
    spread = mean + (step_dn - 1.0) * (np.arange(mean.size) * _GOLDEN % 1.0 - 0.5)
    quantiles = np.quantile(spread, np.linspace(0, 1, _BINS + 1))
    edges = [quantiles[0]]
    for edge in quantiles[1:]:
        if edge >= edges[-1] + _LEAST_WIDTH_STEPS * step_dn:
            edges.append(edge)
    index = np.clip(np.searchsorted(edges, spread, side="right") - 1, 0, max(len(edges) - 2, 0))
    rows = []
    for b in np.unique(index):
        m, v = mean[index == b], variance[index == b]
        # A mean of n repeats is itself noisy: its square is too large by variance / n.
        rows.append((frames[0].gain, m.mean(), (m**2 - v / count).mean(), v.mean(), m.size))
    # A bin's error follows from the variance of the bins around it, since a bin's own variance depends on how whole
    # numbers fall into it.
    gain, means, square, variances, pixels = np.array(rows).T
    variances = _all_noise(variances, step_dn)
    around, size = (uniform_filter1d(x, _NEIGHBOURS, mode="nearest") for x in (variances * pixels, pixels))
    # Pixels that vary less than rounding does are clipped somewhere in the sensor: they must not count as exact.
    error = np.maximum(around / size, ROUNDING_VARIANCE) * np.sqrt(2.0 / ((count - 1) * pixels))
    # Coarse steps round a bin's few means unequally.
    error = np.hypot(error, _UNEVEN * ROUNDING_VARIANCE * (step_dn**2 - 1.0))
    return list(zip(gain, means, square, variances, 1.0 / error, strict=True))


def frame_noise_variances(
    capture: Capture, black_dn: float, no_noise: Mapping[ImageKey, np.ndarray] | None = None
) -> tuple[dict[ImageKey, tuple[float, str]], NoiseModel | None]:
    """Returns ({(frame id, side): (variance in DN^2, "repeats" or "noise model")}, noise model); without any repeats
    ({}, None).

    The noise model is fitted on the train repeats if there are any, else on all. no_noise: {(frame id, side): DN
    [height][width]} that are subtracted from images: known differences between repeats, or DN that are not light.
    """
    known, train_frames = no_noise or {}, capture.split("train")
    comb = comb_of((capture.ir(f, side) for f in train_frames for side in SIDES), capture.rig.max_dn)
    step_dn = comb.step_dn if comb else 1.0  # else the digital numbers are whole
    statistics = repeat_statistics(capture, drift=known)
    train = [entry for entry in statistics if entry[0][0].split == "train"]
    noise_model = fit_noise_model(train or statistics, black_dn, capture.rig.max_dn, step_dn)
    if noise_model is None:
        return {}, None
    noise_variances: dict[ImageKey, tuple[float, str]] = {}
    for frames, side, _, variance in statistics:
        own = float(_all_noise(np.nanmean(variance), step_dn)), "repeats"
        noise_variances |= dict.fromkeys(((frame.id, side) for frame in frames), own)
    for frame in capture.frames:
        for side in SIDES:
            if (frame.id, side) not in noise_variances:
                lit = capture.ir(frame, side) - known.get((frame.id, side), 0.0)
                noise_variances[frame.id, side] = (noise_model.mean_variance(lit, frame.gain), "noise model")
    return noise_variances, noise_model


# The difference of neighbours is noise alone if their expected values differ by less than this share.
_ALIKE = 0.1
# A squared difference of more variances than this is a misplaced dot.
_OUTLIER = 12.0


def noise_at_other_gains(
    noise_model: NoiseModel, images: Sequence[MeasuredImage], predicted: Mapping[ImageKey, np.ndarray]
) -> tuple[NoiseModel, dict[ImageKey, float]]:
    """Returns (noise model, {(frame id, side): variance, DN^2, of the images at gains without repeats}). The noise
    model gets more shot noise if the train frames at such gains need it. This is fitted between neighbouring pixels of
    nearly equal expected value. predicted: expected DN, of the train images at least.

    A missing effect adds a variance that grows with the square of the signal, alike at all gains. It is measured at the
    gains with repeats and subtracted.
    """
    train = [i for i in images if i.frame.split == "train"]
    gains = {frames[0].gain for frames in by_repeats((i.frame, i.side, i.frame) for i in train)}
    shown = [i for i in train if i.frame.gain in gains and i.frame.projector_power > 0]
    others = [i for i in train if i.frame.gain not in gains]
    if shown and others:
        missing = max(_slope(noise_model, shown, predicted, lambda i, signal: signal**2, 0.0), 0.0)
        more = _slope(noise_model, others, predicted, lambda i, signal: i.frame.gain * signal, missing)
        noise_model = replace(noise_model, shot=noise_model.shot + max(more, 0.0))
    return noise_model, {i.key: noise_model.image_variance(i) for i in images if i.frame.gain not in gains}


def _slope(
    noise_model: NoiseModel, observations: Sequence[MeasuredImage], images: Mapping[ImageKey, np.ndarray],
    lever_of: Callable, missing: float,
) -> float:  # fmt: skip
    """Returns the coefficient of an extra variance proportional to lever_of(observation, signal). It is fitted to
    differences of neighbouring pixels of nearly equal expected value, after the noise model and missing x signal^2 are
    subtracted."""
    top = bottom = 0.0
    for o in observations:
        image = images[o.key]
        rest = o.measured - image
        mean = 0.5 * (image[:, 1:] + image[:, :-1])
        signal = np.maximum(mean - noise_model.black_dn, 0.0)
        known = noise_model.variance(mean, o.frame.gain) + missing * signal**2
        alike = (np.abs(image[:, 1:] - image[:, :-1]) < _ALIKE * mean) & (mean < o.view.max_dn - 1)
        known_scene = o.view.known_mask()
        alike &= known_scene[:, 1:] & known_scene[:, :-1]
        pair = np.minimum(0.5 * (rest[:, 1:] - rest[:, :-1]) ** 2, _OUTLIER * known)
        lever, weight = lever_of(o, signal), 1.0 / np.maximum(known, ROUNDING_VARIANCE) ** 2
        top += (weight * lever * (pair - known))[alike].sum()
        bottom += (weight * lever**2)[alike].sum()
    return top / bottom if bottom > 0 else 0.0


_PAIR_NOISE_BINS = 24
_LEAST_PIXELS = 200
_SMOOTHEST = 0.25  # share of a bin's pixels that is taken: those with the least slope
_LOCAL_MEAN_PX = 4.0  # gain and offset between the cameras go with the local mean of the difference
_TRIM = 4.0  # deviations


def pair_noise_model(pairs: Iterable[tuple[MeasuredImage, MeasuredImage]], black_dn: float) -> NoiseModel | None:
    """Fits a NoiseModel without a speckle term to the differences between the two cameras. pairs: for each frame (left
    image, right image). Returns None if too few pixels lie in smooth parts of the image."""
    rows = [row for pair in pairs for row in _rows(*pair)]
    if not rows:
        return None
    gain, mean, variance, weight = np.array(rows).T
    terms = np.stack([np.ones_like(mean), gain * np.maximum(mean - black_dn, 0.0)], axis=1)
    (offset, shot), _ = fit_terms(terms, variance, weight)
    return NoiseModel(max(offset, ROUNDING_VARIANCE), shot, 0.0, float(black_dn))


def _rows(left: MeasuredImage, right: MeasuredImage) -> list[tuple[float, float, float, float]]:
    """Returns rows (gain, mean, variance of one camera, weight), one per bin of brightness, from one frame's pair."""
    warp = warp_between(left.view, right.view)
    image, there = np.asarray(left.measured, np.float64), warp.read(right.measured)
    rest = image - there
    rest = rest - gaussian_filter(rest, _LOCAL_MEAN_PX)
    # Share of the variance that is left without the local mean, to first order.
    kept = 1.0 - 1.0 / (2.0 * np.pi * _LOCAL_MEAN_PX**2)
    # Linear interpolation reduces a pixel's variance by this factor.
    u, v = warp.u - np.floor(warp.u), warp.v - np.floor(warp.v)
    interpolated = (u**2 + (1.0 - u) ** 2) * (v**2 + (1.0 - v) ** 2)
    one_side = rest**2 / (kept * (1.0 + interpolated))
    slope = gaussian_gradient_magnitude(image, 1.0) + gaussian_gradient_magnitude(there, 1.0)
    usable = warp.seen & (image > 0) & (np.maximum(image, there) < left.view.max_dn - 1) & left.view.known_mask()
    level = gaussian_filter(image, 1.0)
    if usable.sum() < _LEAST_PIXELS:
        return []
    edges = np.unique(np.quantile(level[usable], np.linspace(0.0, 1.0, _PAIR_NOISE_BINS + 1)))
    rows = []
    for low, high in zip(edges, edges[1:], strict=False):
        inside = usable & (level >= low) & (level < high)
        if inside.sum() < _LEAST_PIXELS:
            continue
        smooth = inside & (slope <= np.quantile(slope[inside], _SMOOTHEST))
        squares = one_side[smooth]
        limit = _TRIM**2 * max(np.median(squares) / 0.455, ROUNDING_VARIANCE)  # 0.455: median of chi square, 1 dof
        variance = float(squares[squares <= limit].mean())
        rows.append(
            (left.frame.gain, float(level[smooth].mean()), variance, float(np.sqrt(squares.size) / max(variance, 1e-3)))
        )
    return rows


def noise_of_images(
    capture: Capture, images: Sequence[MeasuredImage], predicted: Mapping[ImageKey, np.ndarray], black_dn: float
) -> tuple[dict[ImageKey, tuple[float, str]], NoiseModel | None]:
    """Returns ({(frame id, side): (variance in DN^2, 'repeats', 'noise model' or 'pair')}, noise model); ({}, None) if
    there are no repeats and nothing in the pairs is smooth. predicted: expected DN, of the train images at least."""
    unsteady = unsteady_light(images)
    noise_variances, noise_model = frame_noise_variances(capture, black_dn, unsteady)
    if noise_model is None:
        of_key, frames = {i.key: i for i in images}, capture.split("train") or capture.frames
        noise_model = pair_noise_model([(of_key[f.id, "left"], of_key[f.id, "right"]) for f in frames], black_dn)
        if noise_model is None:
            return {}, None
        return {i.key: (noise_model.image_variance(i), "pair") for i in images}, noise_model
    noise_model, others = noise_at_other_gains(noise_model, images, predicted)
    known = {key: (max(v, ROUNDING_VARIANCE), source) for key, (v, source) in noise_variances.items()}
    return known | {key: (v, "noise model") for key, v in others.items()}, noise_model


# Rows over which a lamp's brightness counts as constant: 0.4 ms at 26 us a row, a twentieth of a period of 120 Hz.
_LAMP_ROWS = 15
# Least share of the rows' squared change that neighbouring rows have in common; independent rows have 1 / _LAMP_ROWS.
_LAMP_SHARE = 0.5


def unsteady_light(images: Sequence[MeasuredImage]) -> dict[ImageKey, np.ndarray]:
    """Returns {(frame id, side): DN [height][width]}, the part of (repeat - mean of its group) that a flickering lamp
    causes. The repeats' variance contains it, although it is no noise. Empty if neighbouring rows do not change
    together, or if a change of the whole level explains more.

    A rolling shutter records flicker as one factor on each row's ambient light, nearly the same in neighbouring rows.
    Row noise is independent from row to row, and stays in the floor.
    """
    found, lamp, level, all_rows = {}, 0.0, 0.0, 0.0

    def common(change: np.ndarray, light: np.ndarray, rows: int = _LAMP_ROWS) -> np.ndarray:
        """Returns the part of an image's change that is a row's factor times the light. A factor is fitted to a
        window of `rows` rows."""
        moment, power = (uniform_filter1d((x * light).sum(axis=1), rows, mode="nearest") for x in (change, light))
        return (moment / np.maximum(power, 1e-12))[:, None] * light

    for repeats in by_repeats((i.frame, i.side, i) for i in images):
        mean = np.mean([i.measured for i in repeats], axis=0)
        for i in repeats:
            ambient = regressors(i.frame, i.layers)[1]
            change = i.measured - mean
            found[i.key] = common(change, ambient)
            lamp += float((found[i.key] ** 2).sum())
            level += float((common(change, np.ones(ambient.shape)) ** 2).sum())
            all_rows += float((common(change, ambient, 1) ** 2).sum())
    return found if lamp > max(_LAMP_SHARE * all_rows, level) else {}
