# SPDX-License-Identifier: Apache-2.0
"""Two models of a pixel's temporal noise, as tables of log probabilities, and their fit to repeats by maximum a
posteriori. s is the mean count above black, DN.

    gamma   y = black + s G + N(0, sigma), G ~ Gamma(k, 1/k)     Zhang et al. 2023: speckle's factor and a Gaussian
    shot    y = black + K Poisson(s/K) + N(0, sigma)          photons and read noise, EMVA 1288's linear model

Both are rounded and clipped. A count at an end of the range is censored: its probability is that of all values beyond.
The paper's theta cannot be measured. The clean image is only known as the frames' mean, and (clean, theta) and (c
clean, theta / c) give the same counts. Here theta = 1 / k, so that s is the mean.

Each pixel's mean is integrated out, so that few repeats do not bias the noise model. Its counts y_1..y_n share an
unknown mean s above black: p(pixel | noise model) = integral of p(y_1 | s) ... p(y_n | s) ds, over a grid as fine as
the mean's own error. Pixels of dark frames share an offset of their own in place of s, normally distributed about the
black level, because unequal pixels (DSNU) are no noise."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csr_matrix
from scipy.special import gammainc, gammaln, logsumexp, ndtr, roots_genlaguerre

from activestereo.calibrate.least_squares import INTERVAL_90

_LEAST_PROBABILITY = 1e-12
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(21)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()
_FACTORS, _LARGE_SHAPE = 24, 60.0
# The wider of the two noises is integrated exactly, the narrower by quadrature nodes.
_WIDER = 1.2
# Poisson's terms are summed below this mean; above it they are a Gaussian with the Poisson's skewness.
_MANY_ELECTRONS = 16.0
# Counts farther from the mean than this, in deviations, are taken as impossible.
_REACH = 8.0


@dataclass(frozen=True)
class CountModel:
    """The base of both noise models. shape: k of the gamma model, or K in DN per electron of the shot noise model.
    sigma_dn: the Gaussian's standard deviation."""

    shape: float
    sigma_dn: float
    black_dn: float
    name: ClassVar[str] = ""

    def variance(self, signal: np.ndarray) -> np.ndarray:
        """Returns the variance in DN^2, before rounding, at a mean count above black."""
        raise NotImplementedError

    def cumulative(self, signal: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """Returns P(y < edge) before rounding, for arrays [n] of signal, above 0, and edge."""
        raise NotImplementedError

    def log_probabilities(self, signal: np.ndarray, max_dn: int, bin_dn: int = 1) -> np.ndarray:
        """Returns log probabilities [signal, bin] of counts 0..max_dn in bins of bin_dn. The first and the last bin
        include all values beyond."""
        signal = np.maximum(signal, 1e-3)
        edges = np.arange(bin_dn, max_dn + 1, bin_dn) - 0.5
        away = (edges - self.black_dn - signal[:, None]) / np.sqrt(self.variance(signal))[:, None]
        below = (away > 0.0).astype(float)
        # The upper tail of the counts is longer than a Gaussian's.
        tail = 40.0 / np.sqrt(self.shape) if isinstance(self, GammaModel) else 8.0
        row, column = np.nonzero((away > -_REACH) & (away < _REACH + tail))
        below[row, column] = self.cumulative(signal[row], edges[column])
        return _log_shares(below)


def _log_shares(below: np.ndarray) -> np.ndarray:
    """Computes the log probability of each bin between two edges, [row, bin], from cumulative probabilities P(y <
    edge), [row, edge]."""
    whole = np.hstack([np.zeros((len(below), 1)), below, np.ones((len(below), 1))])
    return np.asarray(np.log(np.maximum(np.diff(whole, axis=1), _LEAST_PROBABILITY)))


@dataclass(frozen=True)
class GammaModel(CountModel):
    """Noise model of the paper: the signal times a gamma-distributed speckle factor, plus Gaussian noise."""

    name: ClassVar[str] = "gamma"

    def variance(self, signal: np.ndarray) -> np.ndarray:
        return self.sigma_dn**2 + signal**2 / self.shape

    def cumulative(self, signal: np.ndarray, edge: np.ndarray) -> np.ndarray:
        out = np.empty(len(signal))
        wide = signal / np.sqrt(self.shape) > _WIDER * self.sigma_dn
        above = edge - self.black_dn
        if wide.any():  # the gamma's cumulative is smooth over sigma: few nodes of the Gaussian do
            # Interpolation takes a tenth of the time and is accurate to 1e-6.
            end = self.shape + 12.0 * np.sqrt(self.shape) + 40.0
            grid = end * np.linspace(0.0, 1.0, 20001)
            table = gammainc(self.shape, grid)
            x, y = above[wide] * self.shape / signal[wide], self.sigma_dn * self.shape / signal[wide]
            weighted = zip(_NODES, _WEIGHTS, strict=True)
            out[wide] = sum(weight * np.interp(x - node * y, grid, table) for node, weight in weighted)
        if not wide.all():  # the Gaussian is wider: use its cumulative, and nodes of the gamma
            # A Gauss quadrature over the factor: Laguerre's, or Hermite's of Wilson and Hilferty's cube root.
            if self.shape < _LARGE_SHAPE:
                nodes, weights = roots_genlaguerre(_FACTORS, self.shape - 1.0)
                factors, weights = nodes / self.shape, weights / weights.sum()
            else:
                spread = 1.0 / (9.0 * self.shape)
                factors, weights = np.maximum(1.0 - spread + np.sqrt(spread) * _NODES, 0.0) ** 3, _WEIGHTS
            x, y = above[~wide] / self.sigma_dn, signal[~wide] / self.sigma_dn
            out[~wide] = sum(weight * ndtr(x - y * factor) for factor, weight in zip(factors, weights, strict=True))
        return out


@dataclass(frozen=True)
class ShotModel(CountModel):
    """Noise model of an ordinary sensor: Poisson noise of the photons plus Gaussian read noise."""

    name: ClassVar[str] = "shot"

    def variance(self, signal: np.ndarray) -> np.ndarray:
        return self.sigma_dn**2 + self.shape * signal

    def cumulative(self, signal: np.ndarray, edge: np.ndarray) -> np.ndarray:
        out = np.empty(len(signal))
        mean, above = signal / self.shape, edge - self.black_dn
        # Steps larger than the read noise show at any mean.
        few = mean < (_MANY_ELECTRONS if self.shape < 1.5 * np.hypot(self.sigma_dn, 0.29) else np.inf)
        deviation = np.sqrt(self.variance(signal[~few]))
        x = (above[~few] - signal[~few]) / deviation
        skewness = self.shape**2 * signal[~few] / deviation**3
        kurtosis = self.shape**3 * signal[~few] / deviation**4
        # Edgeworth's series to the second order.
        first = skewness / 6.0 * (x**2 - 1.0)
        second = kurtosis / 24.0 * (x**3 - 3.0 * x) + skewness**2 / 72.0 * (x**5 - 10.0 * x**3 + 15.0 * x)
        out[~few] = np.clip(ndtr(x) - (first + second) * np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi), 0.0, 1.0)
        if few.any():
            most = float(mean[few].max())
            electrons = np.arange(int(most + 9.0 * np.sqrt(most) + 10.0))
            some, which = np.unique(mean[few], return_inverse=True)
            poisson = np.exp(electrons * np.log(some)[:, None] - some[:, None] - gammaln(electrons + 1.0))
            below = ndtr((above[few][:, None] - self.shape * electrons) / self.sigma_dn)
            out[few] = (poisson[which] * below).sum(axis=1)
        return out


# Counts are grouped so that a table has at most this number of columns.
_LARGEST_BINS = 512
_PRIOR = {"gamma": (np.log(30.0), 2.5), "shot": (np.log(0.1), 2.5)}
_SIGMA_PRIOR = (np.log(0.6), 1.5)
_BLACK_PRIOR_DN = 30.0
_STEPS = np.array([0.02, 0.04, 0.02])
# Offsets of dark pixels are integrated up to this many standard deviations.
_OFFSETS = 4.0


@dataclass(frozen=True)
class Counts:
    """Histograms of each pixel's counts. histograms: sparse [pixel, bin]. means: mean count of each pixel. dark:
    histograms of dark frames, or None. dsnu_dn: standard deviation of the dark pixels' own offsets."""

    histograms: csr_matrix
    means: np.ndarray
    dark: csr_matrix | None
    dsnu_dn: float
    max_dn: int
    bin_dn: int

    @classmethod
    def from_pixels(cls, pixels: list[np.ndarray], dark: list[np.ndarray], max_dn: int) -> "Counts":
        """Makes histograms of counts. pixels, dark: arrays [pixel, repeat], one for each view."""
        bin_dn = -(-(max_dn + 1) // _LARGEST_BINS)
        means = np.concatenate([counts.mean(axis=1) for counts in pixels])
        histograms = _histograms(pixels, max_dn, bin_dn)
        if not dark:
            return cls(histograms, means, None, 0.0, max_dn, bin_dn)
        spread = [c.mean(axis=1).var(ddof=1) - c.var(axis=1, ddof=1).mean() / c.shape[1] for c in dark]
        dsnu_dn = float(np.sqrt(max(np.average(spread, weights=[len(c) for c in dark]), 0.0)))
        return cls(histograms, means, _histograms(dark, max_dn, bin_dn), dsnu_dn, max_dn, bin_dn)

    def part(self, chosen: np.ndarray) -> "Counts":
        return replace(self, histograms=self.histograms[chosen], means=self.means[chosen])


def _histograms(pixels: list[np.ndarray], max_dn: int, bin_dn: int) -> csr_matrix:
    row, column, place = [], [], 0
    for counts in pixels:
        row.append(np.repeat(np.arange(place, place + len(counts)), counts.shape[1]))
        column.append(counts.ravel() // bin_dn)
        place += len(counts)
    at = np.concatenate(row), np.concatenate(column)
    return csr_matrix((np.ones(len(at[0])), at), shape=(place, max_dn // bin_dn + 1))


@dataclass(frozen=True)
class NoiseFit:
    """The most probable noise model. error: standard deviations of log shape, log sigma and black."""

    noise_model: CountModel
    error: np.ndarray

    def interval(self, name: str) -> tuple[float, float]:
        """Returns the 90 % interval of shape, sigma_dn or black_dn."""
        value = getattr(self.noise_model, name)
        error = INTERVAL_90 * self.error[("shape", "sigma_dn", "black_dn").index(name)]
        if name == "black_dn":
            return value - error, value + error
        return value * np.exp(-error), value * np.exp(error)


def log_density(counts: Counts, noise_model: CountModel) -> np.ndarray:
    """Returns each pixel's log probability (nats) [pixel] under a noise model, integrated over the pixel's unknown
    mean."""
    # Means above black as finely spaced as a pixel's mean is known, and the width of each.
    repeats = counts.histograms[0].sum()
    brightest = float(counts.means.max())
    reach = 6.0 * np.sqrt(noise_model.variance(np.array([brightest]))[0] / repeats)
    top = 1.1 * max(brightest - noise_model.black_dn, 1.0) + reach
    middles: list[float] = []
    at = 0.0
    while at < top:
        step = np.sqrt((noise_model.variance(np.array([at]))[0] + counts.bin_dn**2 / 12.0) / repeats)
        middles.append(at + 0.5 * step)
        at += step
    grid = np.array(middles)
    width = np.gradient(grid) if len(grid) > 1 else np.ones(1)
    table = noise_model.log_probabilities(grid, counts.max_dn, counts.bin_dn)
    return np.asarray(logsumexp(counts.histograms @ table.T + np.log(width), axis=1))


def dark_log_density(counts: Counts, noise_model: CountModel) -> float:
    """Returns the log probability (nats) of all dark frames' pixels; 0 without dark frames."""
    if counts.dark is None:
        return 0.0
    repeats = counts.dark[0].sum()
    step = np.sqrt((noise_model.sigma_dn**2 + counts.bin_dn**2 / 12.0) / repeats)
    spacing = min(float(step), counts.dsnu_dn) or 1.0
    steps = int(np.ceil(_OFFSETS * counts.dsnu_dn / spacing))
    offsets = spacing * np.arange(-steps, steps + 1)
    weight = -0.5 * (offsets / (counts.dsnu_dn or 1.0)) ** 2
    edges = np.arange(counts.bin_dn, counts.max_dn + 1, counts.bin_dn) - 0.5
    table = _log_shares(ndtr((edges - noise_model.black_dn - offsets[:, None]) / noise_model.sigma_dn))
    return float(logsumexp(counts.dark @ table.T + weight - logsumexp(weight), axis=1).sum())


def fit_noise_model(
    kind: type[CountModel],
    counts: Counts,
    start: CountModel | None,
    fixed_black_dn: float | None,
    with_error: bool = True,
) -> NoiseFit:
    """Finds the most probable noise model of a kind. start: where the search begins, None: a guess. fixed_black_dn: a
    known black level, or None. with_error=False: leaves errors at 0, in half the time."""
    start = start or _start(kind, counts, fixed_black_dn)
    free = 2 if fixed_black_dn is not None else 3

    def model_of(x: np.ndarray) -> CountModel:
        black = float(x[2]) if fixed_black_dn is None else fixed_black_dn
        return kind(float(np.exp(np.clip(x[0], -9.0, 12.0))), float(np.exp(np.clip(x[1], -4.0, 6.0))), black)

    def cost(x: np.ndarray) -> float:
        noise_model = model_of(x)
        nats = float(log_density(counts, noise_model).sum()) + dark_log_density(counts, noise_model)
        centre, spread = _PRIOR[kind.name]
        prior = ((x[0] - centre) / spread) ** 2 + ((x[1] - _SIGMA_PRIOR[0]) / _SIGMA_PRIOR[1]) ** 2
        return -nats + 0.5 * (prior + (noise_model.black_dn / _BLACK_PRIOR_DN) ** 2)

    first = np.array([np.log(start.shape), np.log(start.sigma_dn), start.black_dn])[:free]
    scale = 1.0 / float(counts.histograms.sum())
    options = {"eps": 1e-3, "ftol": 1e-10, "gtol": 1e-6, "maxiter": 40}
    found = minimize(lambda x: scale * cost(x), first, method="L-BFGS-B", options=options)
    error = np.zeros(3)
    if with_error:
        hessian, steps = np.zeros((free, free)), np.diag(_STEPS[:free])
        for i, a in enumerate(steps):  # by central differences
            for j, b in enumerate(steps[: i + 1]):
                rise = cost(found.x + a + b) - cost(found.x + a - b) - cost(found.x - a + b) + cost(found.x - a - b)
                hessian[i, j] = hessian[j, i] = rise / (4.0 * a[i] * b[j])
        error[:free] = np.sqrt(np.maximum(np.diag(np.linalg.pinv(hessian, hermitian=True)), 0.0))
    return NoiseFit(model_of(found.x), error)


def _start(kind: type[CountModel], counts: Counts, black_dn: float | None) -> CountModel:
    """Guesses a start for the fit. Over the pixels' means, their variance is a quadratic, whose terms give sigma, shot
    noise and gamma noise."""
    values = (np.arange(counts.histograms.shape[1]) + 0.5) * counts.bin_dn - 0.5
    repeats = np.asarray(counts.histograms.sum(axis=1)).ravel()
    mean = counts.histograms @ values / repeats
    variance = (counts.histograms @ values**2 / repeats - mean**2) * repeats / np.maximum(repeats - 1, 1)
    clear = (mean > np.quantile(mean, 0.02)) & (mean + 3.0 * np.sqrt(variance) < counts.max_dn)
    dark_mean, dark_variance = np.inf, 0.0
    if counts.dark is not None:
        repeats = np.asarray(counts.dark.sum(axis=1)).ravel()
        of_pixels = counts.dark @ values / repeats
        dark_mean = float(of_pixels.mean())
        dark_variance = float(np.mean((counts.dark @ values**2 / repeats - of_pixels**2) * repeats / (repeats - 1.0)))
    black = black_dn if black_dn is not None else min(float(np.quantile(mean, 0.01)), dark_mean)
    signal = np.maximum(mean - black, 0.0)[clear]
    column = signal**2 if kind is GammaModel else signal
    weight = 1.0 / (variance[clear].mean() * 0.05 + column + 0.05)
    slope = float(np.sum(weight**2 * column * variance[clear]) / max(np.sum(weight**2 * column**2), 1e-12))
    sigma = 0.5 if counts.dark is None else max(float(np.sqrt(max(dark_variance - 1.0 / 12.0, 0.0))), 0.1)
    shape = 1.0 / max(slope, 1e-5) if kind is GammaModel else max(slope, 1e-3)
    return kind(shape, sigma, black)


NOISE_MODELS: tuple[type[CountModel], ...] = (GammaModel, ShotModel)
