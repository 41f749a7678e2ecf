# SPDX-License-Identifier: Apache-2.0
"""Fits the nuisances of a comparison (projector scale, ambient scale and black level) by least squares on the train
frames.

    DN = black + exposure_s * gain * (projector_scale * power * P + ambient_scale * level * A),  clipped to the sensor's
    range

P is the radiance on the sensor under the projector at power 1, A the radiance under ambient radiance 1. A model's
effects may make this nonlinear; then rounds of Gauss-Newton fit its linearisation. All train pixels of both cameras
have equal weight, so that the fit minimises the RMSE that compare reports. diagnose/fitter.py starts from this fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from activestereo.capture.capture import SIDES, Capture, CaptureError, Frame, ImageKey
from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.effects.core.model import Nuisances, scales
from activestereo.effects.core.view import View

# Pixels predicted nearer to the range's ends than this many residual deviations are left out, as clipping biases them.
_CLIP_MARGIN_SIGMA = 4.0
# Numbers of rounds: for clipped pixels, a nonlinear model, its level, and inexact exposures.
_CLIP_ROUNDS, _BENT_ROUNDS, _LEVEL_ROUNDS, _EXPOSURE_ROUNDS = 4, 20, 12, 3
# A nonlinear fit ends where a step changes no nuisance by more than this share.
_CONVERGED = 1e-5
_STEP = 1e-3
# A step is halved if the residual deviation grows by more than this factor; a little growth is due to clipped pixels.
_WORSE = 1.01
# (Frame or View, light, the nuisances or None at the start) -> (columns [3][n], offset [n] or 0): the expected image is
# offset + nuisances @ columns.
_Line: TypeAlias = Callable[[Any, Any, "np.ndarray | None"], "tuple[np.ndarray, np.ndarray | float]"]


@dataclass(frozen=True)
class Fit:
    """Fitted nuisances with standard errors (independent pixels assumed), the number of pixels used, and the share left
    out as clipped.

    at_bound: names of the scales that would have become negative and are set to 0.
    """

    nuisances: Nuisances
    standard_errors: Nuisances
    pixels: int
    clipped_fraction: float
    at_bound: tuple[str, ...] = ()


def regressors(frame: Frame, light: Any) -> np.ndarray:
    """Returns the derivatives of the expected DN, without clipping, by projector scale, ambient scale and black level,
    float64 [3][height][width]. light: Layers or a Light."""
    projector, ambient = scales(frame)
    images = light.projector.astype(np.float64) * projector, light.ambient.astype(np.float64) * ambient
    return np.stack([*images, np.ones(light.ambient.shape)])


def slopes(image: Callable[..., np.ndarray], nuisances: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Evaluates image(projector scale, ambient scale, black) at the nuisances [3]; returns (image, its three
    derivatives by finite differences)."""
    here, columns = image(*nuisances), []
    for j, value in enumerate(nuisances):
        moved = nuisances.copy()
        moved[j] += _STEP * max(abs(value), 1.0)
        columns.append((image(*moved) - here) / (moved[j] - value))
    return here, columns


def predict(frame: Frame, light: Any, nuisances: Nuisances, max_dn: float) -> np.ndarray:
    """Returns the expected image, DN before rounding, float64 [height][width], clipped to 0..max_dn."""
    return np.clip(np.tensordot(nuisances.vector(), regressors(frame, light), 1), 0.0, max_dn)


def fit_nuisances(
    observations: Sequence[tuple[Frame, Any, np.ndarray]], max_dn: float, black_dn: tuple[float, float] | None = None
) -> Fit:
    """Fits the nuisances without effects. observations: (frame, light, measured DN, NaN for pixels that do not count).
    black_dn: (measured black level, its deviation), which holds the level fixed; None: it is fitted. Raises ValueError
    if there is nothing to fit."""

    def straight(frame: Frame, light: Any, nuisances: np.ndarray | None) -> tuple[np.ndarray, float]:
        return regressors(frame, light).reshape(3, -1), 0.0

    return _fitted(observations, straight, max_dn, black_dn)


def fit_under_model(
    model: Any, observations: Sequence[tuple[View, Any, np.ndarray]], max_dn: float,
    black_dn: tuple[float, float] | None = None,
) -> Fit:  # fmt: skip
    """Fits the nuisances under a model with effects. observations: (View, Light that falls on the sensor, measured DN).
    black_dn: as in fit_nuisances()."""
    linear = fit_nuisances([(view.frame, light, measured) for view, light, measured in observations], max_dn, black_dn)
    if model.is_linear:
        return linear
    # 1. For a strongly nonlinear model, double or halve the scales until it is as bright as the measurement.
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

    # 2. Take Gauss-Newton steps on the model's linearisation at the nuisances.
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
    """Fits the nuisances to the train frames under a model; returns (Fit, views). If the capture states its exposures
    as inexact, the exposures of all frames are fitted, too, and the returned views hold them. lights: {(frame id,
    side): light on the sensor}. Raises CaptureError if there is nothing to fit."""
    capture.check_train()
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
            both = np.zeros(2)  # numerator and denominator of the factor on the frame's light
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


def _fitted(
    observations: Sequence[Any], line: _Line, max_dn: float, black_dn: tuple[float, float] | None,
    solution: np.ndarray | None = None,
) -> Fit:  # fmt: skip
    """Fits the nuisances by least squares, in rounds that leave out clipped pixels. line: linearises the prediction.
    solution: the start for a nonlinear model; None: the model is linear. Raises ValueError if there is nothing to
    fit."""
    if not observations:
        raise ValueError("nothing to fit: there is no infrared image")
    total = sum(np.count_nonzero(np.isfinite(measured)) for _, _, measured in observations)
    is_straight, deviation, best = solution is None, 0.0, None

    def rms(at: np.ndarray) -> float:
        """Returns the RMS residual of the used pixels, DN; infinite without any."""
        rest = np.append(at, -1.0)
        return float(np.sqrt(max(0.0, rest @ squares @ rest) / used)) if used else np.inf

    for _ in range(_CLIP_ROUNDS if is_straight else _BENT_ROUNDS):
        # 1. Normal equations of the pixels that do not clip: at first by the measured values, later by the prediction,
        # which is free of the measurement's noise.
        squares, used = np.zeros((4, 4)), 0  # of the three columns and of what they explain
        with np.errstate(over="ignore", invalid="ignore"):
            for seen, light, measured in observations:
                columns, offset = line(seen, light, solution)
                measured_dn = measured.ravel().astype(np.float64)
                value = measured_dn - offset
                if solution is None:
                    keep = (measured_dn > 0) & (measured_dn < max_dn)  # False for unknown pixels, NaN
                else:
                    predicted, margin = solution @ columns + offset, _CLIP_MARGIN_SIGMA * deviation
                    keep = (predicted < max_dn - margin) & (predicted > min(margin, 0.5 * solution[2]))
                    keep &= np.isfinite(value)
                rows = np.vstack([columns, value])[:, keep]
                squares += rows @ rows.T
                used += rows.shape[1]
        gram, moment = squares[:3, :3], squares[:3, 3]
        if not np.isfinite(gram).all():
            frames = [getattr(seen, "frame", seen) for seen, _, _ in observations]
            most = max(frames, key=lambda frame: frame.exposure_gain)
            text = f"frame {most.id} has an exposure x gain of {most.exposure_gain:.3g} s, beyond all measure"
            raise ValueError(f"nothing to fit: {text}")
        if used == 0 and best is None:
            raise ValueError("nothing to fit: every pixel of the train frames is clipped")
        # 2. The solution. A Gauss-Newton step may overshoot: then it is halved.
        if solution is not None and not is_straight:
            here = rms(solution)
            if best is not None and here > _WORSE * best[1]:
                solution = 0.5 * (solution + best[0])
                continue
            if best is not None and np.allclose(solution, best[0], rtol=_CONVERGED, atol=_CONVERGED):
                break
            best = solution, here
        solution, inverse, at_bound = solve_bounded(gram, moment, black_dn)
        deviation = rms(solution)
        if is_straight and used == total:
            break  # nothing near the ends of the range: the linear fit is final
    assert solution is not None  # there is one round at least
    errors = deviation * np.sqrt(np.maximum(np.diag(inverse), 0.0))
    return Fit(
        Nuisances(*map(float, solution)), Nuisances(*map(float, errors)), int(used), 1.0 - used / total, at_bound
    )


def solve_bounded(
    gram: np.ndarray, moment: np.ndarray, black_dn: tuple[float, float] | None = None
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Solves least squares for (projector scale, ambient scale, black) with both scales at least 0. Returns the
    solution, the inverse of its Gram matrix, and the names of scales at that bound. A light that no train frame shows
    gets scale 0. black_dn: as in fit_nuisances()."""
    if black_dn is not None:
        gram, moment = gram[:2, :2], moment[:2] - gram[:2, 2] * black_dn[0]
    found = []
    for fixed in ((), (0,), (1,), (0, 1)):  # both scales come first
        free = [j for j in range(len(moment)) if j not in fixed]
        inverse = np.zeros(gram.shape)
        inverse[np.ix_(free, free)] = inverse_normal_matrix(gram[np.ix_(free, free)])
        solution = inverse @ moment
        if (solution[:2] >= 0.0).all():
            found.append((float(solution @ moment), solution, inverse, fixed))
    _, solution, inverse, fixed = max(found, key=lambda each: each[0])
    if black_dn is not None:
        solution, inverse = np.append(solution, black_dn[0]), np.pad(inverse, (0, 1))
    return solution, inverse, tuple(("projector_scale", "ambient_scale")[j] for j in fixed)
