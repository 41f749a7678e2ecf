# SPDX-License-Identifier: Apache-2.0
"""The nuisances of a comparison: projector scale, ambient scale and black level, by least squares on the train frames;
and the images that a model expects with them.

    DN = black + exposure_s * gain * (projector_scale * power * P + ambient_scale * level * A),  clipped to the sensor's
    range

P and A are the radiance that falls on the sensor under the projector at power 1 and under ambient radiance 1. A model's
effects may bend that line: Gauss-Newton's rounds fit the line that touches it. All train pixels of both cameras weigh
alike, so that the fit minimises the RMSE that compare reports. diagnose/refine/fitter.py, which weighs pixels by their
variance and fits focal lengths, albedos and effects too, starts from it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from activestereo.capture.capture import SIDES, Capture, CaptureError, Frame, ImageKey
from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.effects.core.model import scales

if TYPE_CHECKING:
    from activestereo.effects.core.view import View

# Pixels predicted this many residual deviations from the ends of the range are left out: there clipping biases the
# mean.
_CLIP_MARGIN_SIGMA = 4.0
# Rounds of the clipped pixels, of a bent line, of its level, and of exposures that are not exact.
_CLIP_ROUNDS, _BENT_ROUNDS, _LEVEL_ROUNDS, _EXPOSURE_ROUNDS = 4, 8, 12, 3
_STEP = 1e-3
# A step is halved if the residual deviation grows by more than this factor: clipped pixels make less noise.
_WORSE = 1.01
# (Frame or View, light, the nuisances or None at the start) -> (columns [3][n], offset [n] or 0): the expected image is
# offset + nuisances @ columns.
_Line: TypeAlias = Callable[[Any, Any, "np.ndarray | None"], "tuple[np.ndarray, np.ndarray | float]"]


@dataclass(frozen=True)
class Nuisances:
    """projector_scale, ambient_scale: DN per (second x gain x unit of rendered radiance); black_dn: without light."""

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


def regressors(frame: Frame, light: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The derivatives of an unclipped prediction by (projector scale, ambient scale, black), each [height][width].
    light: Layers, or a Light."""
    projector, ambient = scales(frame)
    images = light.projector.astype(np.float64) * projector, light.ambient.astype(np.float64) * ambient
    return *images, np.ones(light.ambient.shape)


def slopes(image: Callable[..., np.ndarray], nuisances: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """image(projector scale, ambient scale, black), and its derivatives by them, by differences."""
    here, columns = image(*nuisances), []
    for j, value in enumerate(nuisances):
        moved = nuisances.copy()
        moved[j] += _STEP * max(abs(value), 1.0)
        columns.append((image(*moved) - here) / (moved[j] - value))
    return here, columns


def predict(frame: Frame, light: Any, nuisances: Nuisances, max_dn: float) -> np.ndarray:
    """Expected DN before rounding, float64 [height][width], clipped to 0..max_dn."""
    columns = regressors(frame, light)
    value = sum(scale * column for scale, column in zip(nuisances.vector(), columns, strict=True))
    return np.clip(value, 0.0, max_dn)


def fit_nuisances(
    observations: Sequence[tuple[Frame, Any, np.ndarray]], max_dn: float, black_dn: tuple[float, float] | None = None
) -> Fit:
    """observations: (frame, light, measured DN, NaN for pixels that do not count). black_dn: the measured black level
    and its deviation, which is then held. Raises ValueError if there is nothing to fit."""
    return _fitted(observations, _straight, max_dn, black_dn)


def fit_under_model(
    model: Any, observations: Sequence[tuple[View, Any, np.ndarray]], max_dn: float,
    black_dn: tuple[float, float] | None = None,
) -> Fit:  # fmt: skip
    """fit_nuisances() under a model with effects. observations: (View, Light that falls on the sensor, measured DN)."""
    linear = fit_nuisances([(view.frame, light, measured) for view, light, measured in observations], max_dn, black_dn)
    if model.is_linear:
        return linear
    # 1. A model that bends the line much: its scales are doubled or halved until it is as bright as the measurement.
    own = linear.nuisances
    black, target = own.black_dn, sum(float(np.nansum(measured - own.black_dn)) for _, _, measured in observations)
    factor = previous = 1.0
    for _ in range(_LEVEL_ROUNDS):
        scaled = Nuisances(factor * own.projector_scale, factor * own.ambient_scale, black)
        level = sum(
            float(np.sum((model.signal(light, view, scaled) - black)[np.isfinite(measured)]))
            for view, light, measured in observations
        )
        step = 2.0 if level < 0.8 * target else 0.5 if level > 1.25 * target else 1.0
        if step == 1.0 or step * previous == 1.0:
            break
        factor, previous = factor * step, step

    # 2. Steps along the line that touches the model's images at the nuisances.
    def touching(view: View, light: Any, nuisances: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        assert nuisances is not None
        here, columns = slopes(lambda *values: model.signal(light, view, Nuisances(*values)).ravel(), nuisances)
        along = np.stack(columns)
        return along, here - nuisances @ along

    start = np.array([factor * own.projector_scale, factor * own.ambient_scale, black])
    return _fitted(observations, touching, max_dn, black_dn, start)


def fit_with_exposures(
    capture: Capture, model: Any, lights: Mapping[ImageKey, Any], views: Mapping[ImageKey, View],
    measured: Mapping[ImageKey, np.ndarray],
) -> tuple[Fit, dict[ImageKey, View]]:  # fmt: skip
    """(fit_under_model() of the train frames, the views). Also fits exposures (of test frames, too) if the capture
    states them as inexact. lights: {(frame id, side): the light on the sensor}. Raises CaptureError if there is nothing
    to fit."""
    seen = dict(views)

    def fit() -> Fit:
        keys = [(frame.id, side) for frame in capture.split("train") for side in SIDES]
        observations = [(seen[key], lights[key], measured[key]) for key in keys]
        try:
            return fit_under_model(model, observations, capture.rig.max_dn, capture.rig.black_dn)
        except ValueError as error:
            raise CaptureError(f"{capture.path}: {error}") from error

    found = fit()
    for _ in range(_EXPOSURE_ROUNDS if capture.uncertainty.exposure else 0):
        for frame in capture.frames:
            keys = [(frame.id, side) for side in SIDES]
            both = np.zeros(2)  # the factor on the frame's light, if something tells it
            for key in keys:
                view, image, black_dn = seen[key], measured[key], found.nuisances.black_dn
                expected = model.signal(lights[key], view, found.nuisances) - black_dn
                keep = (expected > 0.0) & (image < view.max_dn - 1)  # False for unknown pixels, NaN
                both += expected[keep] @ (image[keep] - black_dn), expected[keep] @ expected[keep]
            share = float(both[0] / both[1]) if both.min() > 0.0 else 1.0
            for key in keys:
                exposed = replace(seen[key].frame, exposure_s=share * seen[key].frame.exposure_s)
                seen[key] = replace(seen[key], frame=exposed)
        found = fit()
    return found, seen


def predict_under_model(
    capture: Capture, model: Any, lights: Sequence[Mapping[ImageKey, Any]], views: Mapping[ImageKey, View],
    measured: Mapping[ImageKey, np.ndarray],
) -> tuple[Fit, dict[ImageKey, list[np.ndarray]]]:  # fmt: skip
    """(the Fit of the nuisances on the train frames, {(frame id, side): expected DN, [height][width] each}) under a
    Model.

    lights: {(frame id, side): the light on the sensor}: those that are fitted, then those whose images are wanted, or
    the first alone if they are the same. views and measured: {(frame id, side): View and DN}. Raises CaptureError if
    there is nothing to fit.
    """
    fit, seen = fit_with_exposures(capture, model, lights[0], views, measured)
    wanted = lights[1:] or lights
    return fit, {key: [model.signal(light[key], view, fit.nuisances) for light in wanted] for key, view in seen.items()}


def _straight(frame: Frame, light: Any, nuisances: np.ndarray | None) -> tuple[np.ndarray, float]:
    """The line of a sensor without effects."""
    return np.stack([column.ravel() for column in regressors(frame, light)]), 0.0


def _fitted(
    observations: Sequence[Any], line: _Line, max_dn: float, black_dn: tuple[float, float] | None,
    solution: np.ndarray | None = None,
) -> Fit:  # fmt: skip
    """solution: the start on a bent line; None for a straight one."""
    if not observations:
        raise ValueError("nothing to fit: the capture has no train frames")
    total = sum(np.count_nonzero(np.isfinite(measured)) for _, _, measured in observations)
    is_straight, deviation, best = solution is None, 0.0, None
    for _ in range(_CLIP_ROUNDS if is_straight else _BENT_ROUNDS):
        with np.errstate(over="ignore", invalid="ignore"):
            gram, moment, energy, used = _normal_equations(observations, line, solution, deviation, max_dn)
        if not np.isfinite(gram).all():
            frames = [getattr(seen, "frame", seen) for seen, _, _ in observations]
            most = max(frames, key=lambda frame: frame.exposure_gain)
            text = f"frame {most.id} has an exposure x gain of {most.exposure_gain:.3g} s, beyond all measure"
            raise ValueError(f"nothing to fit: {text}")
        if used == 0 and best is None:
            raise ValueError("nothing to fit: every pixel of the train frames is clipped")
        if solution is not None and not is_straight:  # a step along a strongly bent line may overshoot: then half of it
            here = _deviation(solution, gram, moment, energy, used)
            if best is not None and here > _WORSE * best[1]:
                solution = 0.5 * (solution + best[0])
                continue
            best = solution, here
        solution, inverse, at_bound = solve_bounded(gram, moment, black_dn)
        deviation = _deviation(solution, gram, moment, energy, used)
        if is_straight and used == total:
            break  # nothing near the ends of the range: the linear fit is final
    assert solution is not None  # there is one round at least
    errors = deviation * np.sqrt(np.maximum(np.diag(inverse), 0.0))
    return Fit(
        Nuisances(*map(float, solution)), Nuisances(*map(float, errors)), int(used), 1.0 - used / total, at_bound
    )


def _deviation(solution: np.ndarray, gram: np.ndarray, moment: np.ndarray, energy: float, used: int) -> float:
    """RMS residual of the used pixels, DN; infinite without any."""
    if used == 0:
        return np.inf
    return float(np.sqrt(max(0.0, energy + solution @ (gram @ solution - 2.0 * moment)) / used))


def _normal_equations(
    observations: Sequence[Any], line: _Line, solution: np.ndarray | None, deviation: float, max_dn: float
) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Gram matrix, moments, sum of squares and count over pixels away from the range's ends: by the measurement at
    first, then by the prediction, which unlike the measurement does not select on its own noise."""
    gram, moment, energy, used = np.zeros((3, 3)), np.zeros(3), 0.0, 0
    for seen, light, measured in observations:
        columns, offset = line(seen, light, solution)
        measured_dn = measured.ravel().astype(np.float64)
        value = measured_dn - offset
        if solution is None:
            keep = (measured_dn > 0) & (measured_dn < max_dn)  # False for unknown pixels, NaN
        else:
            predicted = solution @ columns + offset
            margin = _CLIP_MARGIN_SIGMA * deviation
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
        gram, moment = gram[:2, :2], moment[:2] - gram[:2, 2] * black_dn[0]
    size = len(moment)  # of the unknowns: both scales come first
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
    _, solution, inverse, fixed = best
    if black_dn is not None:
        solution, inverse = np.append(solution, black_dn[0]), np.pad(inverse, (0, 1))
    return solution, inverse, tuple(("projector_scale", "ambient_scale")[j] for j in fixed)
