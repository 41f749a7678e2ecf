# SPDX-License-Identifier: Apache-2.0
"""Measures the imager's temporal noise from frames of static views. Static speckle, fixed patterns and a pixel's own
gain are the same in every frame, so they do not show here.

There are two models; s is a pixel's mean count above black, DN:

    gamma   y = black + s G + N(0, sigma), G ~ Gamma(k, 1/k)     Zhang et al. 2023: speckle's factor and a Gaussian
    shot    y = black + K Poisson(s/K) + N(0, sigma)          photons and read noise, EMVA 1288's linear model

Both are rounded and clipped. A count at an end of the range is censored: its probability is that of all values beyond.
The paper's theta cannot be measured, for (clean, theta) and (c clean, theta / c) give the same counts. It is 1/k here.

The data are each pixel's histogram of counts. The unknown mean s is integrated out over a grid as fine as the standard
error of the mean, so pairs of frames serve as well as many repeats. A pixel of dark frames has an unknown offset in
place of s, normally distributed about the black level, because differences between pixels (DSNU) are no noise.

The fit is maximum a posteriori, with 90 % intervals of the curvature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csr_matrix
from scipy.special import logsumexp

from activestereo.calibrate.least_squares import INTERVAL_90
from activestereo.calibrate.repeats import LEAST_REPEATS, Repeats, bit_depth, check_still, read_repeats, read_steps
from activestereo.common.progress_bar import Progress, silent
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.model import Imager, Quantity, SensorModel

_LEAST_PROBABILITY, _LEAST_LOG = 1e-12, -25.0
# Turns of the characteristic function that are summed; a sigma below 0.2 bins would need more.
_MOST_TURNS = 4
# Counts are grouped so that a table has at most this number of columns.
_LARGEST_BINS = 512
# A pixel's mean is integrated in steps of this many of its standard errors, a dark pixel's offset up to so many.
_STEP, _OFFSETS = 1.5, 4.0
# Means and deviations of the logarithms of k or K, and of sigma; deviation of black.
_PRIOR = {"gamma": (np.log(30.0), 2.5), "shot": (np.log(0.1), 2.5)}
_SIGMA_PRIOR, _BLACK_PRIOR_DN = (np.log(0.6), 1.5), 30.0
_LOW, _HIGH = np.array([-9.0, -1.6]), np.array([12.0, 6.0])
_STEPS = np.array([0.02, 0.04, 0.02])
# Number of counts to use, enough for half a percent of k; with more repeats, fewer pixels are used.
_COUNTS, _FEWEST_PIXELS, _MOST_PIXELS = 150_000, 1500, 16_000
_LARGEST_DARK = 200_000
_LARGEST_CLIPPED = 0.5
_NAMES = ("shape", "sigma_dn", "black_dn")
_NOTE = "Static speckle and fixed patterns are the same in every repeat: they never show in repeats."


@dataclass(frozen=True)
class NoiseModel:
    """A noise model with its parameters. kind: "gamma" or "shot". shape: k of the gamma model, or K of the shot model
    in DN per electron. sigma_dn: the Gaussian's standard deviation. black_dn: the black level."""

    kind: str
    shape: float
    sigma_dn: float
    black_dn: float

    def variance(self, signal: Any) -> Any:
        """Returns the variance in DN^2, before rounding, of counts whose mean is `signal` DN above black."""
        return self.sigma_dn**2 + (signal**2 / self.shape if self.kind == "gamma" else self.shape * signal)

    def log_probabilities(
        self, signal: np.ndarray, max_dn: int, bin_dn: int = 1, offset_dn: float | np.ndarray = 0.0
    ) -> np.ndarray:
        """Returns log probabilities [signal, bin] of counts 0..max_dn in bins of bin_dn. The first and the last bin
        include all values beyond. offset_dn: added to black, a number or an array [signal]."""
        # In bins. The sum of the characteristic function's turns is the transform of the bins' shares.
        bins = max_dn // bin_dn + 1
        length, sigma, gain = 6 * bins, self.sigma_dn / bin_dn, self.shape / bin_dn
        s, black = (
            signal[:, None] / bin_dn,
            np.reshape(self.black_dn + offset_dn - 0.5 * (bin_dn - 1), (-1, 1)) / bin_dn,
        )
        turns, total = min(int(np.ceil(0.9 / sigma)), _MOST_TURNS), np.zeros((len(s), length // 2 + 1), complex)
        for turn in range(-turns, turns + 1):
            t = 2.0 * np.pi * (np.arange(length // 2 + 1) / length + turn)
            if self.kind == "gamma":
                log, angle = -0.5 * self.shape * np.log1p((t * s / self.shape) ** 2), np.arctan(t * s / self.shape)
                angle *= self.shape
            else:
                log, angle = s / gain * (np.cos(gain * t) - 1.0), s / gain * np.sin(gain * t)
            log, angle = log - 0.5 * (sigma * t) ** 2, angle + t * black
            kept = log > _LEAST_LOG
            total[kept] += (
                np.exp(log[kept] + 1j * angle[kept]) * np.broadcast_to(np.sinc(0.5 * t / np.pi), kept.shape)[kept]
            )
        shares = np.fft.irfft(np.conj(total), length)
        shares[:, 0] += shares[:, -bins:].sum(axis=1)  # values below 0 wrap around to the end
        shares = shares[:, :bins]
        shares[:, -1] = 1.0 - shares[:, :-1].sum(axis=1)
        return np.asarray(np.log(np.maximum(shares, _LEAST_PROBABILITY)))


@dataclass(frozen=True)
class _Evidence:
    """The data to fit. histograms: of each pixel's counts, sparse [pixel, bin]. means, variances: of the pixels'
    counts. dark: histograms of the dark frames' pixels, or None. dsnu_dn: standard deviation of the dark pixels'
    offsets. dark_dn: mean and deviation of dark counts, or of the darkest pixels'. black_dn: the known black level;
    None = fitted."""

    histograms: csr_matrix
    means: np.ndarray
    variances: np.ndarray
    dark: csr_matrix | None
    dsnu_dn: float
    dark_dn: tuple[float, float]
    max_dn: int
    black_dn: float | None

    @property
    def bin_dn(self) -> int:
        return -(-(self.max_dn + 1) // _LARGEST_BINS)

    def density(self, model: NoiseModel) -> np.ndarray:
        """Returns each pixel's log probability (nats) [pixel] under a model, plus an equal part of the dark pixels'."""
        repeats = self.histograms.sum(axis=1).max()
        top = 1.1 * max(float(self.means.max()) - model.black_dn, 1.0)
        top += 6.0 * np.sqrt(model.variance(self.means.max()) / repeats)
        grid, at = list[float](), 0.0
        while at < top or len(grid) < 2:
            step = _STEP * np.sqrt((model.variance(at) + self.bin_dn**2 / 12.0) / repeats)
            grid.append(at + 0.5 * step)
            at += step
        table = model.log_probabilities(np.array(grid), self.max_dn, self.bin_dn)
        own = logsumexp(self.histograms @ table.T + np.log(np.gradient(grid)), axis=1)
        if self.dark is None:
            return np.asarray(own)
        step = np.sqrt((model.sigma_dn**2 + self.bin_dn**2 / 12.0) / self.dark.sum(axis=1).max())
        steps = int(np.ceil(_OFFSETS * self.dsnu_dn / min(step, self.dsnu_dn))) if self.dsnu_dn else 0
        offsets = np.linspace(-_OFFSETS, _OFFSETS, 2 * steps + 1) if steps else np.zeros(1)
        weight = -0.5 * offsets**2
        table = model.log_probabilities(0.0 * offsets, self.max_dn, self.bin_dn, self.dsnu_dn * offsets)
        dark = logsumexp(self.dark @ table.T + weight - logsumexp(weight), axis=1).sum()
        return np.asarray(own + dark / len(own))

    def fit(self, kind: str) -> tuple[NoiseModel, np.ndarray, Callable[[np.ndarray], float]]:
        """Finds the most probable noise model of a kind. Returns (the model, unknowns, cost). The unknowns are log
        shape, log sigma and, unless it is known, black. cost(unknowns) is in nats."""

        def model_of(x: np.ndarray) -> NoiseModel:
            shape, sigma = np.exp(np.clip(x[:2], _LOW, _HIGH))
            return NoiseModel(kind, float(shape), float(sigma), float(x[2]) if self.black_dn is None else self.black_dn)

        def cost(x: np.ndarray) -> float:
            (centre, spread), model = _PRIOR[kind], model_of(x)
            off = (x[0] - centre) / spread, (x[1] - _SIGMA_PRIOR[0]) / _SIGMA_PRIOR[1], model.black_dn / _BLACK_PRIOR_DN
            return 0.5 * float(np.dot(off, off)) - float(self.density(model).sum())

        # The start: the brighter pixels' variances over their signals.
        black = self.dark_dn[0] if self.black_dn is None else self.black_dn
        bright = (self.means > np.median(self.means)) & (self.means + 3.0 * np.sqrt(self.variances) < self.max_dn)
        signal, variance = np.maximum(self.means - black, 0.1)[bright], np.maximum(self.variances[bright], 0.1)
        shape = np.median(signal**2 / variance if kind == "gamma" else variance / signal) if bright.any() else 1.0
        first = np.array([np.log(shape), np.log(self.dark_dn[1]), black])[: 3 if self.black_dn is None else 2]
        scale = 1.0 / float(self.histograms.sum())
        options = {"eps": 1e-3, "ftol": 1e-8, "gtol": 1e-5, "maxiter": 40}
        x = minimize(lambda x: scale * cost(x), first, method="L-BFGS-B", options=options).x
        return model_of(x), x, cost


@dataclass(frozen=True)
class Noise:
    """The measured noise. noise_model: the more probable one. error: standard deviations of log shape, log sigma and
    black. margin_nats: mean over pixels of its log probability less the other model's, and the standard error (Vuong
    1989). clipped_share: share of all counts that clip. black_from: source of the black level. dsnu_dn: standard
    deviation of the dark pixels' offsets, None without dark frames. transfer: (exposure x gain, mean, variance in DN^2)
    of unclipped pixels at each exposure, if there are several."""

    noise_model: NoiseModel
    error: np.ndarray
    margin_nats: tuple[float, float]
    pixels: int
    repeats: int
    clipped_share: float
    black_from: str
    dsnu_dn: float | None
    transfer: tuple[tuple[float, float, float], ...] = ()

    @property
    def chosen(self) -> str:
        return self.noise_model.kind

    def interval(self, name: str) -> tuple[float, float, float]:
        """Returns shape, sigma_dn or black_dn and the ends of its 90 % interval."""
        value, half = getattr(self.noise_model, name), INTERVAL_90 * float(self.error[_NAMES.index(name)])
        if name == "black_dn":
            return value, value - half, value + half
        return value, value * float(np.exp(-half)), value * float(np.exp(half))

    def model(self) -> SensorModel:
        """Makes a SensorModel of the imager, with the black level among its nuisances, for model.json. Rounding's
        variance is part of the offset."""
        source = f"calibrate noise: {self.chosen} noise model, {self.pixels} pixels, {self.repeats} repeats"
        source += "; static speckle does not show in repeats"
        value, low, high = (v**2 + ROUNDING_VARIANCE for v in self.interval("sigma_dn"))
        offset, (value, low, high) = Quantity(value, low, high, "DN^2", source), self.interval("shape")
        if self.chosen == "gamma":
            relative = Quantity(1.0 / value, 1.0 / high, 1.0 / low, "1", source)
            imager = Imager(offset, Quantity(0.0, unit="DN"), relative)
        else:
            imager = Imager(offset, Quantity(value, low, high, "DN", source), Quantity(0.0, unit="1"))
        black = Quantity(*self.interval("black_dn"), "DN", f"calibrate noise: from {self.black_from}")
        return SensorModel(imager=imager, nuisances={"black_dn": black})

    def summary(self) -> str:
        """Describes the noise as text, which the command prints."""
        margin, error = self.margin_nats
        other = "shot" if self.chosen == "gamma" else "gamma"
        sure = "" if margin > 2.0 * error else "; the two are alike on this data: record brighter and darker views"
        lines = [f"noise model: {self.chosen}, by {margin:.3g} ± {error:.2g} nats per pixel over {other}{sure}"]
        shape = ("k", "shape", "") if self.chosen == "gamma" else ("K", "shape", " DN/e-")
        for word, name, unit in (shape, ("sigma", "sigma_dn", " DN"), ("black", "black_dn", " DN")):
            value, low, high = self.interval(name)
            lines.append(f"{word:6} {value:.4g} ({low:.4g} to {high:.4g}){unit}")
        if self.chosen == "gamma":
            theta = f"{1.0 / self.noise_model.shape:.4g} = 1/k: a gauge, for the clean image is the frames' mean"
            lines.append(f"theta  {theta}")
        if self.dsnu_dn is not None:
            lines.append(f"DSNU   {self.dsnu_dn:.3g} DN, of columns, rows and waves, too")
        lines += [
            f"exposure x gain {exposure:.4g} s: mean {mean:.2f} DN, variance {variance:.3f} DN²"
            for exposure, mean, variance in self.transfer
        ]
        counted = f"{100 * self.clipped_share:.2f} % of the counts clipped, censored"
        lines.append(f"black from {self.black_from}; {counted}; {self.pixels} pixels, {self.repeats} repeats")
        return "\n".join([*lines, _NOTE])


def calibrate_noise(
    frames: Path | list[Repeats], dark: Path | list[Repeats] | None = None, seed: int = 0,
    progress: Progress = silent,
) -> Noise:  # fmt: skip
    """Measures the Noise. frames: repeats, or the path of a folder, stack, capture or EMVA 1288 descriptor file (.txt),
    which lists dark frames, too. dark: repeats without any light, or their path. seed: of the random choice of pixels.
    Raises ValueError with file, number and remedy for fewer than 10 frames, repeats that move, clipped views, and dark
    frames that are not dark."""
    darks = list[Repeats]()
    if isinstance(frames, list):
        views = frames
    elif frames.suffix == ".txt":
        views, darks = read_steps(frames)
    else:
        views = read_repeats(frames)
    if dark is not None:
        darks = dark if isinstance(dark, list) else read_repeats(dark)
    if (count := sum(len(view.counts) for view in views)) < LEAST_REPEATS:
        told = f"{count} repeats in {len(views)} views of one camera, at least {LEAST_REPEATS} are needed"
        where = views[0].name if len(views) == 1 else f"{views[0].name} to {views[-1].name}"
        raise ValueError(f"{where}: {told}: record more frames of the same static view")
    sizes = dict.fromkeys(view.counts.shape[:0:-1] for view in views)
    for own in darks:
        if (size := own.counts.shape[:0:-1]) not in sizes:
            others = ", ".join(f"{width}x{height}" for width, height in sizes)
            raise ValueError(f"{own.name}: dark frames have {size[0]}x{size[1]} pixels, the lit ones {others}")
    for view in views:
        check_still(view)
    max_dn = 2 ** bit_depth([*views, *darks]) - 1
    black = None if darks else _black_of_exposures(views, max_dn)
    rng = np.random.default_rng(seed)
    evidence = _gather(views, darks, max_dn, black, rng)
    progress(0.1)
    fits, density = {}, {}
    for kind in _PRIOR:
        fits[kind] = evidence.fit(kind)
        density[kind] = evidence.density(fits[kind][0])
        progress(0.4 * len(fits) + 0.1)
    chosen, other = sorted(density, key=lambda kind: -float(density[kind].sum()))
    # The errors follow from the cost's curvature, by central differences.
    noise_model, x, cost = fits[chosen]
    free, error = len(x), np.zeros(3)
    hessian, steps = np.zeros((free, free)), np.diag(_STEPS[:free])
    for i, a in enumerate(steps):
        for j, b in enumerate(steps[: i + 1]):
            rise = cost(x + a + b) - cost(x + a - b) - cost(x - a + b) + cost(x - a - b)
            hessian[i, j] = hessian[j, i] = rise / (4.0 * a[i] * b[j])
    error[:free] = np.sqrt(np.maximum(np.diag(np.linalg.pinv(hessian, hermitian=True)), 0.0))
    difference = density[chosen] - density[other]
    transfer = []
    exposures = {view.exposure_gain for view in views} - {None}
    for view in sorted(views, key=lambda view: view.exposure_gain or 0.0) if len(exposures) > 1 else ():
        if view.exposure_gain is not None:
            clear = ((view.counts > 0) & (view.counts < max_dn)).all(axis=0)
            counts = view.counts[:, clear].astype(np.float64)
            transfer.append((view.exposure_gain, float(counts.mean()), float(counts.var(axis=0, ddof=1).mean())))
    return Noise(
        noise_model, error, (float(difference.mean()), float(difference.std(ddof=1) / np.sqrt(len(difference)))),
        len(difference), max(len(view.counts) for view in views),
        float(np.mean([np.mean((v.counts == 0) | (v.counts == max_dn)) for v in views])),
        "dark frames" if darks else "the exposures' intercept" if black is not None else "the views' darkest pixels",
        evidence.dsnu_dn if darks else None, tuple(transfer),
    )  # fmt: skip


def _gather(
    views: list[Repeats], darks: list[Repeats], max_dn: int, black_dn: float | None, rng: np.random.Generator
) -> _Evidence:
    """Picks pixels of each view, evenly over the logarithm of their mean count, and random pixels of the dark frames.
    Pixels that mostly clip are left out. Raises ValueError if most of a view's do, or if dark frames are not dark."""
    wanted = int(np.clip(_COUNTS / max(len(view.counts) for view in views), _FEWEST_PIXELS, _MOST_PIXELS))
    lit, dark = list[np.ndarray](), list[np.ndarray]()  # [pixel][repeat] of each view
    for view in views:
        flat = view.counts.reshape(len(view.counts), -1)
        level, middle = flat.mean(axis=0), np.median(flat, axis=0)
        usable = np.flatnonzero((middle > 0) & (middle < max_dn))
        if len(usable) < _LARGEST_CLIPPED * flat.shape[1]:
            clipped = f"{100.0 * (1.0 - len(usable) / flat.shape[1]):.0f} % of the pixels clip at 0 or {max_dn} DN"
            raise ValueError(f"{view.name}: {clipped}: change the exposure so that most lie between")
        group = np.floor(4.0 * np.log2(level[usable] - level[usable].min() + 2.0)).astype(int)
        weight = 1.0 / np.bincount(group)[group]
        number = min(-(-wanted // len(views)), len(usable))
        lit.append(flat[:, rng.choice(usable, number, replace=False, p=weight / weight.sum())].T)
    for view in darks:
        flat = view.counts.reshape(len(view.counts), -1)
        most = min(_LARGEST_DARK // sum(len(own.counts) for own in darks), flat.shape[1])
        dark.append(flat[:, rng.choice(flat.shape[1], most, replace=False)].T)
    if darks:
        brightest, darkest = max(float(d.counts.mean()) for d in darks), min(float(v.counts.mean()) for v in views)
        if brightest >= darkest:
            told = f"its mean is {brightest:.2f} DN, the lit frames' {darkest:.2f}"
            raise ValueError(f"{darks[0].name}: {told}: give frames without any light to --dark")
    bin_dn = -(-(max_dn + 1) // _LARGEST_BINS)

    def histograms(stacks: list[np.ndarray]) -> csr_matrix:
        rows = np.concatenate([np.full(len(own), own.shape[1]) for own in stacks])
        at = np.repeat(np.arange(len(rows)), rows), np.concatenate([own.ravel() // bin_dn for own in stacks])
        return csr_matrix((np.ones(len(at[0])), at), shape=(len(rows), max_dn // bin_dn + 1))

    spread = [own.mean(axis=1).var(ddof=1) - own.var(axis=1, ddof=1).mean() / own.shape[1] for own in dark]
    dsnu_dn = float(np.sqrt(max(np.average(spread, weights=list(map(len, dark))), 0.0))) if dark else 0.0
    means = np.concatenate([own.mean(axis=1) for own in lit])
    variances = np.concatenate([own.var(axis=1, ddof=1) for own in lit])
    darkest = means <= np.quantile(means, 0.02)
    black, square = means[darkest].mean(), variances[darkest].mean()
    if dark:
        black, square = dark[0].mean(), dark[0].var(axis=1, ddof=1).mean()
    dark_dn = float(black), float(np.sqrt(max(square - ROUNDING_VARIANCE, 0.1)))
    of_dark = histograms(dark) if dark else None
    return _Evidence(histograms(lit), means, variances, of_dark, dsnu_dn, dark_dn, max_dn, black_dn)


def _black_of_exposures(views: list[Repeats], max_dn: int) -> float | None:
    """Returns the black level in DN: a view's mean over unclipped pixels, extrapolated to exposure 0 by a line; the
    median over views. Returns None if no view has several exposures."""
    of: dict[str, list[Repeats]] = {}
    for view in views:
        if view.exposure_gain is not None:
            of.setdefault(view.view, []).append(view)
    blacks = []
    for same in of.values():
        times = [view.exposure_gain or 0.0 for view in same]
        clear = np.all([((v.counts > 0) & (v.counts < max_dn)).all(axis=0) for v in same], axis=0)
        if len(set(times)) > 1 and clear.sum() > 100:
            blacks.append(np.polyfit(times, [view.counts[:, clear].mean() for view in same], 1)[1])
    return float(np.median(blacks)) if blacks else None
