# SPDX-License-Identifier: Apache-2.0
"""Two models of a pixel's temporal noise, as tables of log probabilities. s is the mean count above black, DN.

    gamma   y = black + s G + N(0, sigma), G ~ Gamma(k, 1 / k)     Zhang et al. 2023: speckle's factor and a Gaussian
    shot    y = black + K Poisson(s / K) + N(0, sigma)             photons and read noise, EMVA 1288's linear model

Both are rounded and clipped: a count at an end of the range is censored, its probability is all that lies beyond. The
paper's theta is a gauge: where the clean image is only known as the frames' mean, (clean, theta) and (c clean, theta /
c) give the same counts; here theta = 1 / k, so that s is the mean.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.special import gammainc, gammaln, ndtr, roots_genlaguerre

_LEAST_PROBABILITY = 1e-12
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(21)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()
_FACTORS, _LARGE_SHAPE = 24, 60.0
# The wider of the two noises is integrated exactly, the narrower by its nodes.
_WIDER = 1.2
# Poisson's terms are summed below this mean; above it they are a Gaussian with the Poisson's skewness.
_MANY_ELECTRONS = 16.0
# Counts farther from the mean than so many deviations are impossible.
_REACH = 8.0


@dataclass(frozen=True)
class CountModel:
    """shape: k of the gamma model, K in DN per electron of the shot noise model."""

    shape: float
    sigma_dn: float
    black_dn: float
    name: ClassVar[str] = ""

    def variance(self, signal: np.ndarray) -> np.ndarray:
        """DN^2 before rounding, of a mean count above black."""
        raise NotImplementedError

    def cumulative(self, signal: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """P(y < edge) before rounding, of arrays of one shape [n]; signal > 0."""
        raise NotImplementedError

    def log_probabilities(self, signal: np.ndarray, max_dn: int, bin_dn: int = 1) -> np.ndarray:
        """[signal][bin] of counts 0..max_dn in bins of bin_dn; the first and the last bin hold all that lies beyond."""
        signal = np.maximum(signal, 1e-3)
        edges = np.arange(bin_dn, max_dn + 1, bin_dn) - 0.5
        away = (edges - self.black_dn - signal[:, None]) / np.sqrt(self.variance(signal))[:, None]
        below = (away > 0.0).astype(float)
        row, column = np.nonzero((away > -_REACH) & (away < _REACH + self._upper_tail()))
        below[row, column] = self.cumulative(signal[row], edges[column])
        whole = np.hstack([np.zeros((len(signal), 1)), below, np.ones((len(signal), 1))])
        return np.log(np.maximum(np.diff(whole, axis=1), _LEAST_PROBABILITY))

    def dark_log_probabilities(self, offset: np.ndarray, max_dn: int, bin_dn: int = 1) -> np.ndarray:
        """log_probabilities() without light, [offset][bin], of pixels with offsets of their own."""
        edges = np.arange(bin_dn, max_dn + 1, bin_dn) - 0.5
        below = ndtr((edges - self.black_dn - np.asarray(offset)[:, None]) / self.sigma_dn)
        whole = np.hstack([np.zeros((len(below), 1)), below, np.ones((len(below), 1))])
        return np.log(np.maximum(np.diff(whole, axis=1), _LEAST_PROBABILITY))

    def _upper_tail(self) -> float:
        """By how many deviations the upper tail reaches farther than a Gaussian's."""
        return 8.0


@dataclass(frozen=True)
class GammaModel(CountModel):
    """The paper's speckle factor and Gaussian noise."""

    name: ClassVar[str] = "gamma"

    def variance(self, signal: np.ndarray) -> np.ndarray:
        return self.sigma_dn**2 + signal**2 / self.shape

    def cumulative(self, signal: np.ndarray, edge: np.ndarray) -> np.ndarray:
        out = np.empty(len(signal))
        wide = signal / np.sqrt(self.shape) > _WIDER * self.sigma_dn
        above = edge - self.black_dn
        if wide.any():  # the gamma's cumulative is smooth over sigma: few nodes of the Gaussian do
            # By interpolation: a tenth of the time, to 1e-6.
            end = self.shape + 12.0 * np.sqrt(self.shape) + 40.0
            grid = end * np.linspace(0.0, 1.0, 20001)
            table = gammainc(self.shape, grid)
            x, y = above[wide] * self.shape / signal[wide], self.sigma_dn * self.shape / signal[wide]
            out[wide] = sum(
                weight * np.interp(x - node * y, grid, table) for node, weight in zip(_NODES, _WEIGHTS, strict=True)
            )
        if not wide.all():  # the other way round
            factors, weights = self._factors()
            x, y = above[~wide] / self.sigma_dn, signal[~wide] / self.sigma_dn
            out[~wide] = sum(weight * ndtr(x - y * factor) for factor, weight in zip(factors, weights, strict=True))
        return out

    def _factors(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes and weights of a Gauss quadrature over the factor: Laguerre's, or Hermite's of Wilson and Hilferty's
        cube root."""
        if self.shape < _LARGE_SHAPE:
            nodes, weights = roots_genlaguerre(_FACTORS, self.shape - 1.0)
            return nodes / self.shape, weights / weights.sum()
        spread = 1.0 / (9.0 * self.shape)
        return np.maximum(1.0 - spread + np.sqrt(spread) * _NODES, 0.0) ** 3, _WEIGHTS

    def _upper_tail(self) -> float:
        return 40.0 / np.sqrt(self.shape)


@dataclass(frozen=True)
class ShotModel(CountModel):
    """Photons and read noise."""

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
            out[few] = (poisson[which] * ndtr((above[few][:, None] - self.shape * electrons) / self.sigma_dn)).sum(
                axis=1
            )
        return out
