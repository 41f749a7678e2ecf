# SPDX-License-Identifier: Apache-2.0
"""The best materials near a candidate, by Gauss-Newton whose derivatives come from designed sets of renders.

The difference of two renders that stand as near as derivatives want them drowns in the renderer's noise. In a two-level
design with its mirror image (Plackett and Burman 1946; Box and Wilson 1951) every render tells of every parameter:
sixteen renders give the derivatives by eight parameters, each with the noise of all sixteen, and no product of two
parameters is taken for a third one's effect.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import hadamard
from scipy.optimize import lsq_linear

from activestereo.calibrate.material_fit import MaterialFit, Residuals
from activestereo.common.progress_bar import part_of

# Neighbouring pixels err alike, and the model errs beside the noise: so many residuals tell as much as one.
_ALIKE = 12.0
# What lies beside all of that, by trials on balls, boxes and cups whose paints are known: a deviation.
_FLOORS = {"roughness": 0.04, "metallic": 0.02, "specular": 0.06, "transmission": 0.04, "ir_albedo": 0.025}
_COLOR_FLOOR = 0.03
# A direction that is less determined than this counts as not determined at all.
_OPEN = 0.6
# Gloss goes with powers of roughness: below this the design's reach shrinks with it.
_LINEAR_ROUGHNESS = 0.4
# Residuals whose two halves of the samples ever lie this far apart, in deviations, tell of rare bright paths alone (a
# dot by way of gloss): derivatives leave them out, whatever their sign.
_WILD = 6.0
_STEPS = 3  # with the same derivatives
_FARTHEST = 2.0  # they lead, in reaches


@dataclass(frozen=True)
class Refined:
    """theta; its residuals; sigma: standard deviations of theta."""

    theta: NDArray[np.float64]
    residuals: Residuals
    sigma: NDArray[np.float64]


def refine(
    fit: MaterialFit,
    theta: NDArray[np.float64],
    reaches: Sequence[float],
    samples: int,
    tell: Callable[[float], object] = lambda fraction: None,
) -> Refined:
    """One design for each reach, which is how far its renders stand from its middle. samples: of each half of a
    design's render; steps are judged with four times as many."""
    best = fit.residuals(theta, 4 * samples)
    for number, reach in enumerate(reaches):
        part = part_of(tell, number / len(reaches), (number + 1) / len(reaches))
        J1, J2 = _derivatives(fit, theta, reach, samples, best.weights, part)
        # Products of two halves here, too: noise in the derivatives does not shrink the step.
        H = 0.5 * (J1.T @ J2 + J2.T @ J1)
        noise = float(np.mean((best.first - best.second) ** 2)) / 4.0
        unit = _ALIKE * (max(best.loss, 1.0) + noise)
        values, vectors = np.linalg.eigh(H)
        values = np.maximum(values, unit / _OPEN**2)
        A = np.sqrt(values)[:, None] * vectors.T
        low, high = np.maximum(fit.low, theta - _FARTHEST * reach), np.minimum(fit.high, theta + _FARTHEST * reach)
        for _ in range(_STEPS):
            b = -0.5 * (J1.T @ best.second + J2.T @ best.first)
            bounds = (low - theta - 1e-9, high - theta + 1e-9)
            step = lsq_linear(A, vectors.T @ b / np.sqrt(values), bounds).x
            moved = np.clip(theta + step, low, high)
            other = fit.residuals(moved, 4 * samples)
            if other.loss >= best.loss:
                break
            theta, best = moved, other
    # Each half of the samples alone would lead elsewhere: that is what the renderer's noise does.
    apart = J2.T @ best.first - J1.T @ best.second
    rendered = 0.5 * (vectors @ ((vectors.T @ apart) / values))
    floors = np.array([_FLOORS.get(name, _COLOR_FLOOR) for _, name in fit.parameters])
    sigma = np.sqrt(unit * np.sum(vectors**2 / values, axis=1) + rendered**2 + floors**2)
    return Refined(theta, best, sigma)


def _derivatives(
    fit: MaterialFit,
    theta: NDArray[np.float64],
    reach: float,
    samples: int,
    weights: NDArray[np.float64],
    tell: Callable[[float], object],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """[residual][parameter] of each half, around the place nearest to theta whose design lies within the range."""
    size = len(theta)
    half = hadamard(1 << (size - 1).bit_length())[:, :size]
    signs = np.concatenate([half, -half])
    reaches = np.full(size, reach)
    for k, (_, name) in enumerate(fit.parameters):
        if name == "roughness":
            reaches[k] *= min(1.0, theta[k] / _LINEAR_ROUGHNESS)
    middle = np.clip(theta, fit.low + reaches, fit.high - reaches)
    J, apart = np.zeros((2, len(weights), size)), np.zeros(len(weights))
    for number, row in enumerate(signs):
        rendered = fit.residuals(middle + row * reaches, samples, weights)
        J[0] += rendered.first[:, None] * row
        J[1] += rendered.second[:, None] * row
        np.maximum(apart, np.abs(rendered.first - rendered.second), out=apart)
        tell((number + 1) / len(signs))
    J /= len(signs) * reaches
    J[:, apart > _WILD] = 0.0
    return J[0], J[1]
