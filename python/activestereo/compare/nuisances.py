# SPDX-License-Identifier: Apache-2.0
"""The nuisances of a comparison: projector scale, ambient scale and black level, by least squares on the train frames.

    DN = black + exposure_s * gain * (projector_scale * power * P + ambient_scale * level * A),  clipped to the sensor's
    range

P and A are the rendered radiance under the projector at power 1 and under ambient radiance 1. All train pixels of both
cameras weigh alike, so that the fit minimises the RMSE that compare reports. diagnose/refine/fitter.py, which weighs
pixels by their variance and fits focal lengths, albedos and effects too, starts from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.common.normal_matrix import inverse_normal_matrix

# Pixels predicted this many residual deviations from the ends of the range are left out: there clipping biases the
# mean.
CLIP_MARGIN_SIGMA = 4.0
_CLIP_ROUNDS = 4


@dataclass(frozen=True)
class Nuisances:
    """projector_scale, ambient_scale: DN per (second x gain x unit of rendered radiance); black_dn: DN without light.
    """

    projector_scale: float
    ambient_scale: float
    black_dn: float

    def vector(self) -> np.ndarray:
        return np.array([self.projector_scale, self.ambient_scale, self.black_dn])


@dataclass(frozen=True)
class Fit:
    """nuisances with standard errors (independent pixels assumed), and the share of pixels left out as clipped.

    at_bound: names of the scales that would have become negative, and are 0: light is never negative.
    """

    nuisances: Nuisances
    standard_errors: Nuisances
    pixels: int
    clipped_fraction: float
    at_bound: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        return asdict(self) | {"at_bound": list(self.at_bound)}


class Images(Protocol):
    """A view's light of the projector and of the room, [height][width]: Layers, or a Light."""

    @property
    def projector(self) -> np.ndarray: ...

    @property
    def ambient(self) -> np.ndarray: ...


def regressors(frame: Frame, layers: Images) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The derivatives of an unclipped prediction by (projector scale, ambient scale, black), each [height][width]."""
    light = frame.exposure_gain
    level = 1.0 if frame.ambient is None else frame.ambient
    projector = layers.projector.astype(np.float64) * (light * frame.projector_power)
    return projector, layers.ambient.astype(np.float64) * (light * level), np.ones(layers.ambient.shape)


def predict(frame: Frame, layers: Images, nuisances: Nuisances, max_dn: float) -> np.ndarray:
    """Expected DN before rounding, float64 [height][width], clipped to 0..max_dn."""
    columns = regressors(frame, layers)
    value = sum(scale * column for scale, column in zip(nuisances.vector(), columns, strict=True))
    return np.clip(value, 0.0, max_dn)


def fit_nuisances(
    observations: Sequence[tuple[Frame, Any, np.ndarray]], max_dn: float, black_dn: tuple[float, float] | None = None
) -> Fit:
    """observations: iterable of (frame, layers, measured DN, NaN where it is not to count). black_dn: the measured
    black level and its deviation, which is then held. Returns a Fit; ValueError where there is nothing to fit."""
    observations = list(observations)
    if not observations:
        raise ValueError("nothing to fit: the capture has no train frames")
    total = sum(np.count_nonzero(np.isfinite(measured)) for _, _, measured in observations)
    solution: np.ndarray | None = None
    deviation = 0.0
    at_bound: tuple[str, ...] = ()
    for _ in range(_CLIP_ROUNDS):
        with np.errstate(over="ignore", invalid="ignore"):
            gram, moment, energy, used = _normal_equations(observations, solution, deviation, max_dn)
        if not np.isfinite(gram).all():
            most = max(observations, key=lambda o: o[0].exposure_gain)[0]
            raise ValueError(
                f"nothing to fit: frame {most.id} has an exposure x gain of {most.exposure_gain:.3g} s, beyond all "
                "measure"
            )
        if used == 0:
            raise ValueError("nothing to fit: every pixel of the train frames is clipped")
        solution, inverse, at_bound = solve_bounded(gram, moment, black_dn)
        deviation = np.sqrt(max(0.0, energy + solution @ (gram @ solution - 2.0 * moment)) / used)
        if used == total:
            break  # nothing near the ends of the range: the linear fit is final
    assert solution is not None  # there is one round at least
    errors = deviation * np.sqrt(np.maximum(np.diag(inverse), 0.0))
    return Fit(
        Nuisances(*map(float, solution)), Nuisances(*map(float, errors)), int(used), 1.0 - used / total, at_bound
    )


def _normal_equations(
    observations: Sequence[Any], solution: np.ndarray | None, deviation: Any, max_dn: float
) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Gram matrix and moments over pixels away from the range's ends: by the measurement at first, then by the
    prediction, which unlike the measurement does not select on its own noise."""
    gram, moment, energy, used = np.zeros((3, 3)), np.zeros(3), 0.0, 0
    for frame, layers, measured in observations:
        columns = np.stack([c.ravel() for c in regressors(frame, layers)])
        value = measured.ravel().astype(np.float64)
        if solution is None:
            keep = (value > 0) & (value < max_dn)  # of what is not known, NaN, neither holds
        else:
            predicted = solution @ columns
            margin = CLIP_MARGIN_SIGMA * deviation
            keep = (predicted < max_dn - margin) & (predicted > min(margin, 0.5 * solution[2])) & np.isfinite(value)
        if not keep.all():
            columns, value = columns[:, keep], value[keep]
        gram += columns @ columns.T
        moment += columns @ value
        energy += value @ value
        used += value.size
    return gram, moment, energy, used


def solve_bounded(
    gram: np.ndarray, moment: np.ndarray, black_dn: tuple[float, float] | None = None
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """(projector scale, ambient scale, black) of least squares with both scales at least 0, the inverse of their Gram
    matrix, and the scales at that bound. A light that no train frame shows gets scale 0. black_dn: as of
    fit_nuisances()."""
    if black_dn is not None:
        scales, inverse, at_bound = _bounded(gram[:2, :2], moment[:2] - gram[:2, 2] * black_dn[0])
        return np.append(scales, black_dn[0]), np.pad(inverse, (0, 1)), at_bound
    return _bounded(gram, moment)


def _bounded(gram: np.ndarray, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """solve_bounded() of all unknowns that there are: both scales come first."""
    size = len(moment)
    best: tuple[float, np.ndarray, np.ndarray, tuple[int, ...]] | None = None
    for fixed in ((), (0,), (1,), (0, 1)):
        free = [j for j in range(size) if j not in fixed]
        solution, inverse = np.zeros(size), np.zeros((size, size))
        inverse[np.ix_(free, free)] = within = inverse_normal_matrix(gram[np.ix_(free, free)])
        solution[free] = within @ moment[free]
        explained = float(solution @ moment)
        if (solution[:2] >= 0.0).all() and (best is None or explained > best[0]):
            best = explained, solution, inverse, fixed
        if not fixed and best is not None:
            break
    assert best is not None  # with both fixed nothing is left that could be negative
    return best[1], best[2], tuple(("projector_scale", "ambient_scale")[j] for j in best[3])
