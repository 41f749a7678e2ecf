# SPDX-License-Identifier: Apache-2.0
"""Implements PCG32 (O'Neill 2014, XSH-RR), one stream per array element, and the distributions that a sensor needs."""

import numpy as np

_MULTIPLIER = np.uint64(6364136223846793005)


class Pcg:
    """Independent random streams, one for each element of `shape`. Every draw advances all streams at least once."""

    def __init__(self, shape, seed, sequence=0):
        count = int(np.prod(shape))
        self.shape = tuple(np.atleast_1d(shape).tolist())
        with np.errstate(over="ignore"):
            streams = np.arange(count, dtype=np.uint64) + (np.uint64(sequence) << np.uint64(32))
            self._increment = (streams << np.uint64(1)) | np.uint64(1)
            self._state = np.zeros(count, dtype=np.uint64)
            self._next()
            self._state += np.uint64(seed)
            self._next()

    def _next(self):
        with np.errstate(over="ignore"):
            old = self._state
            self._state = old * _MULTIPLIER + self._increment
        mixed = (((old >> np.uint64(18)) ^ old) >> np.uint64(27)).astype(np.uint32)
        turn = (old >> np.uint64(59)).astype(np.uint32)
        return (mixed >> turn) | (mixed << ((np.uint32(32) - turn) & np.uint32(31)))

    def uniform(self):
        """Draws uniform numbers in (0, 1), float64."""
        return ((self._next().astype(np.float64) + 0.5) / 2.0**32).reshape(self.shape)

    def normal(self):
        """Draws normal numbers of mean 0 and deviation 1 (Box and Muller 1958)."""
        return np.sqrt(-2.0 * np.log(self.uniform())) * np.cos(2.0 * np.pi * self.uniform())

    def gamma(self, shape_k):
        """Draws gamma numbers of mean 1 and variance 1 / shape_k, for shape_k >= 1 (Marsaglia and Tsang 2000)."""
        d = shape_k - 1.0 / 3.0
        value = np.full(self.shape, np.nan)
        while np.isnan(value).any():
            x = self.normal()
            v = (1.0 + x / np.sqrt(9.0 * d)) ** 3
            with np.errstate(invalid="ignore"):
                good = (v > 0) & (np.log(self.uniform()) < 0.5 * x * x + d - d * v + d * np.log(v))
            value = np.where(np.isnan(value) & good, d * v, value)
        return value / shape_k
