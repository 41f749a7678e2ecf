# SPDX-License-Identifier: Apache-2.0
"""Images read between their pixels by Lanczos' windowed sinc of three lobes, which keeps dots sharp."""

from __future__ import annotations

import numpy as np

from activestereo.benchmarks.inject.light import Light

_LOBES = 3


def resampled(light: Light, u: np.ndarray, v: np.ndarray, outside: float | None = None) -> Light:
    """The light at the positions (u, v). outside: value beyond the image; None repeats the border."""
    height, width = light.value.shape
    first_u, weight_u = _taps(u)
    first_v, weight_v = _taps(v)
    value, variance = np.zeros(u.shape), np.zeros(u.shape)
    for i in range(2 * _LOBES):
        row = np.clip(first_v + i, 0, height - 1)
        for j in range(2 * _LOBES):
            column, weight = np.clip(first_u + j, 0, width - 1), weight_v[i] * weight_u[j]
            value += weight * light.value[row, column]
            variance += weight**2 * light.variance[row, column]
    if outside is not None:
        beyond = (u < -0.5) | (u > width - 0.5) | (v < -0.5) | (v > height - 0.5)
        value, variance = np.where(beyond, outside, value), np.where(beyond, 0.0, variance)
    return Light(value, variance)


def _taps(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(first pixel, weights [6][...]), weights of sum 1."""
    first = np.floor(place).astype(np.int64) - _LOBES + 1
    distance = place - first - np.arange(2 * _LOBES).reshape(-1, *[1] * place.ndim)
    weights = np.sinc(distance) * np.sinc(distance / _LOBES) * (np.abs(distance) < _LOBES)
    return first, weights / weights.sum(axis=0)
