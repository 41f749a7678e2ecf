# SPDX-License-Identifier: Apache-2.0
"""The nuisances under a model with effects, where the prediction may bend: Gauss-Newton on the same least squares as
nuisances.py; and the images that are expected with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.capture.capture import SIDES, Capture, CaptureError, ImageKey
from activestereo.compare.nuisances import CLIP_MARGIN_SIGMA, Fit, Nuisances, fit_nuisances, solve_bounded

if TYPE_CHECKING:
    from activestereo.compare.render import LayersOfFrames
    from activestereo.effects.core.model import Model
    from activestereo.effects.core.view import View

_ROUNDS, _EXPOSURE_ROUNDS = 5, 3
_STEP = 1e-3


def fit_under_model(
    model: Any, observations: Sequence[Any], max_dn: float, black_dn: tuple[float, float] | None = None
) -> Fit:
    """observations: [(View, Light that falls on the sensor, measured DN, NaN where it is not to count)]. black_dn: as
    of fit_nuisances(). Returns a Fit; ValueError where there is nothing to fit."""
    linear = fit_nuisances([(view.frame, light, measured) for view, light, measured in observations], max_dn, black_dn)
    if not model.effects:
        return linear
    theta, deviation = linear.nuisances.vector(), 0.0
    for _ in range(_ROUNDS):
        gram, moment, squares, used = _normal_equations(model, observations, theta, deviation, max_dn)
        if used == 0:
            raise ValueError("nothing to fit: every pixel of the train frames is clipped under this model")
        # In terms of the nuisances themselves, whose bounds are known: a step to where they end, not beyond.
        theta, inverse, at_bound = solve_bounded(gram, moment + gram @ theta, black_dn)
        deviation = np.sqrt(squares / used)
    errors = deviation * np.sqrt(np.maximum(np.diag(inverse), 0.0))
    total = sum(np.count_nonzero(np.isfinite(measured)) for _, _, measured in observations)
    return Fit(Nuisances(*map(float, theta)), Nuisances(*map(float, errors)), int(used), 1.0 - used / total, at_bound)


def fit_train_frames(capture: Capture, model: Any, observations: Sequence[Any]) -> Fit:
    """fit_under_model() of what was observed in the capture. CaptureError names it where there is nothing to fit."""
    try:
        return fit_under_model(model, observations, capture.rig.max_dn, capture.rig.black_dn)
    except ValueError as error:
        raise CaptureError(f"{capture.path}: {error}") from error


def fit_with_exposures(
    capture: Capture, model: Any, lights: Mapping[ImageKey, Any], views: Mapping[ImageKey, View],
    measured: Mapping[ImageKey, np.ndarray],
) -> tuple[Fit, dict[ImageKey, View]]:  # fmt: skip
    """(fit_train_frames(), the views): with the exposures that fit best, of test frames, too, where the capture states
    that they are not exact. lights: {(frame id, side): what falls on the sensor}."""
    keys = [(frame.id, side) for frame in capture.split("train") for side in SIDES]
    seen = dict(views)
    fit = fit_train_frames(capture, model, [(seen[key], lights[key], measured[key]) for key in keys])
    for _ in range(_EXPOSURE_ROUNDS if capture.uncertainty.exposure else 0):
        for frame in capture.frames:
            own = {side: (frame.id, side) for side in SIDES}
            share = _exposure_share(model, [(seen[key], lights[key], measured[key]) for key in own.values()], fit)
            for key in own.values():
                exposed = replace(seen[key].frame, exposure_s=share * seen[key].frame.exposure_s)
                seen[key] = replace(seen[key], frame=exposed)
        fit = fit_train_frames(capture, model, [(seen[key], lights[key], measured[key]) for key in keys])
    return fit, seen


def _exposure_share(model: Any, observations: Sequence[Any], fit: Fit) -> float:
    """By what one frame's light is to be multiplied; 1 where nothing tells it."""
    both = np.zeros(2)
    for view, light, measured in observations:
        expected = model.signal(light, view, fit.nuisances) - fit.nuisances.black_dn
        keep = (expected > 0.0) & (measured < view.max_dn - 1)  # of what is not known, NaN, it does not hold
        both += expected[keep] @ (measured[keep] - fit.nuisances.black_dn), expected[keep] @ expected[keep]
    return float(both[0] / both[1]) if both.min() > 0.0 else 1.0


def predict_under_model(
    capture: Capture,
    model: Model,
    layers: Sequence[LayersOfFrames],
    views: Mapping[ImageKey, View],
    measured: Mapping[ImageKey, np.ndarray],
) -> tuple[Fit, dict[ImageKey, list[np.ndarray]]]:
    """(the Fit of the nuisances on the train frames, {(frame id, side): expected DN, [height][width] each}) under a
    Model.

    layers: those that are fitted, then those whose images are wanted, or the first alone where they are the same;
    views and measured: {(frame id, side): View and DN}. ValueError where there is nothing to fit.
    """
    lights = [{key: model.light(of[key[0]][key[1]], view) for key, view in views.items()} for of in layers]
    fit, seen = fit_with_exposures(capture, model, lights[0], views, measured)
    wanted = lights[1:] or lights
    return fit, {
        key: [model.signal(light[key], view, fit.nuisances) for light in wanted] for key, view in seen.items()
    }


def _normal_equations(
    model: Any, observations: Sequence[Any], theta: np.ndarray, deviation: Any, max_dn: float
) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Gram matrix, moments, sum of squares and count over pixels predicted away from the range's ends."""
    gram, moment, squares, used = np.zeros((3, 3)), np.zeros(3), 0.0, 0
    for view, light, measured in observations:
        image = model.signal(light, view, Nuisances(*theta))
        columns = []
        for j in range(3):
            moved = theta.copy()
            moved[j] += _STEP * max(abs(theta[j]), 1.0)
            columns.append((model.signal(light, view, Nuisances(*moved)) - image) / (moved[j] - theta[j]))
        keep = (image < max_dn - CLIP_MARGIN_SIGMA * deviation) & (image > 0.0) & np.isfinite(measured)
        design, residual = np.stack([c[keep] for c in columns]), (measured - image)[keep]
        gram += design @ design.T
        moment += design @ residual
        squares += float(residual @ residual)
        used += residual.size
    return gram, moment, squares, used
