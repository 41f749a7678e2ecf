# SPDX-License-Identifier: Apache-2.0
"""Refines an explanation by the engine's own images: Gauss-Newton on the effect's parameters, where the image
function only proposed.

An effect's image function is a surrogate. Around its solution the engine renders the effect, and the effect with each
parameter one step further, all poses in one call with the same random numbers: what changes is the effect, not the
noise. The differences from the render without the effect stand for it from then on, linear in its parameters near the
solution; they are rendered anew as the solution moves. The search looks at drafts; what it ends with is rendered whole.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from activestereo.effects import Effect, Light, Model, View
from activestereo.engines.halves import HALVES
from activestereo.lab.diagnose.findings import Explanation
from activestereo.lab.diagnose.refine.fitter import Fitter
from activestereo.lab.diagnose.refine.parameter_space import ParameterSpace
from activestereo.lab.diagnose.score.intervals import intervals
from activestereo.lab.diagnose.score.likelihood import cross_validated

# Rounds of rendering and fitting, and fits' steps in each.
_ROUNDS, _STEPS = 3, 4
# A step of a difference: of a parameter's typical value, or of its own distance from neutral, whichever is more.
_STEP_TYPICAL, _STEP_DISTANCE = 0.2, 0.15
# A round moves a parameter by no more than so many of these steps, keeps the slopes where none moved by more than so
# many, and ends the search where none moves by this part of one.
_TRUSTED, _NEAR, _SETTLED = 6.0, 1.0, 0.3

Key = tuple[int, str]


class RenderedLight(Protocol):
    """Radiance [height][width] of one eye of one frame, as in Light: under the projector at power 1, and under
    ambient radiance 1.
    """

    @property
    def direct(self) -> np.ndarray: ...

    @property
    def indirect(self) -> np.ndarray: ...

    @property
    def ambient(self) -> np.ndarray: ...


class Rendering(Protocol):
    """Renders every frame of a capture under a model, with the same random numbers in every call. half: 0 or 1, one of
    two independent halves of the samples; None: a draft, with fewer samples.
    """

    def __call__(self, model: Model, half: int | None = None) -> Mapping[Key, RenderedLight]: ...


_Images = dict[Key, np.ndarray]


@dataclass(frozen=True)
class _Rendered:
    """An effect's change of light, rendered at theta and one step further along each free parameter:
    [3][height][width] each. halves: the change by either half of the samples; none of a draft.
    """

    effect: Effect
    theta: np.ndarray
    change: _Images
    slopes: tuple[_Images, ...]
    halves: tuple[_Images, ...] = ()

    def emulated(self) -> Effect:
        """The effect with these images for its image function; neutral amplitudes change nothing."""
        return replace(self.effect, apply=self._apply)

    def _apply(self, light: Light, view: View, **values: float) -> Light:
        given = np.array([values[p.name] for p in self.effect.parameters])
        if _is_off(self.effect, given):
            return light
        key = view.frame.id, view.eye
        change = (self.change if view.half is None or not self.halves else self.halves[view.half])[key]
        for away, slope in zip(given - self.theta, self.slopes, strict=True):
            if away and slope:
                change = change + away * slope[key]
        direct, indirect, ambient = (
            np.maximum(old + new, 0.0)
            for old, new in zip((light.direct, light.indirect, light.ambient), change, strict=True)
        )
        return replace(light, direct=direct, indirect=indirect, ambient=ambient)


def _is_off(effect: Effect, values: np.ndarray) -> bool:
    """Whether all amplitudes are neutral: shapes and choices alone change nothing."""
    return all(
        v == p.neutral for p, v in zip(effect.parameters, values, strict=True) if p.neutral == 0.0 and not p.choice
    )


def refined_by_rendering(fitter: Fitter, explanation: Explanation, rendering: Rendering) -> Explanation:
    """The explanation by the engine's images, where that is better; itself where it is not.

    fitter: of the train images.
    """
    effect, start = explanation.effect, explanation.fitted
    own = slice(len(start.theta) - len(effect.parameters), None)
    without = _images(rendering(Model()))
    theta, phi, steps, slopes = start.theta, start.phi, _steps(effect, start.theta[own]), None
    for _ in range(_ROUNDS):
        rendered = _draft(effect, theta[own], steps, rendering, without, slopes)
        space = _with_effect(start.space, rendered.emulated())
        solution = fitter.refine(space, theta, phi, _STEPS)
        reach = np.abs(steps)
        moved = np.clip(solution.theta[own], theta[own] - _TRUSTED * reach, theta[own] + _TRUSTED * reach)
        distance = np.abs(moved - theta[own])
        theta, phi = np.concatenate([solution.theta[: own.start], moved]), solution.phi
        if (distance <= _SETTLED * reach).all():
            break
        steps, slopes = _steps(effect, moved), rendered.slopes if (distance <= _NEAR * reach).all() else None
    final = _whole(effect, theta[own], rendering, rendered.slopes)
    solution = fitter.refine(_with_effect(start.space, final.emulated()), theta, phi, 1)
    chi2 = cross_validated(fitter, solution)
    if chi2 >= explanation.chi2:
        return explanation
    return replace(
        explanation,
        effect=final.emulated(),
        parameters=intervals(fitter, solution, effect),
        chi2=chi2,
        tile_chi2=solution.sums.tile_chi2,
        solution=solution,
    )


def _with_effect(space: ParameterSpace, effect: Effect) -> ParameterSpace:
    """The space with another image function of its last effect."""
    pairs = tuple((effect if e.id == effect.id else e, p) for e, p in space.pairs)
    return replace(space, pairs=pairs)


def _steps(effect: Effect, values: np.ndarray) -> np.ndarray:
    """Steps of differences, 0 for choices and for what the engine does not know; inside the range."""
    out = []
    for p, v in zip(effect.parameters, values, strict=True):
        step = max(_STEP_TYPICAL * p.typical, _STEP_DISTANCE * abs(v - p.neutral))
        is_fixed = p.choice or not p.in_engine
        out.append(0.0 if is_fixed else -step if v + step > p.high else step)
    return np.array(out)


def _whole(effect: Effect, values: np.ndarray, rendering: Rendering, slopes: tuple[_Images, ...]) -> _Rendered:
    """Of all samples. slopes: those of values near by."""
    model = _model_at(effect, values)
    first, second = (_change(_images(rendering(model, half)), _images(rendering(Model(), half))) for half in HALVES)
    mean = {key: 0.5 * (image + second[key]) for key, image in first.items()}
    return _Rendered(effect, values, mean, slopes, (first, second))


def _model_at(effect: Effect, values: np.ndarray) -> Model:
    named = {p.name: float(np.clip(v, p.low, p.high)) for p, v in zip(effect.parameters, values, strict=True)}
    return Model().with_effect(effect, **named)


def _change(images: _Images, without: _Images) -> _Images:
    return {key: image - without[key] for key, image in images.items()}


def _draft(
    effect: Effect,
    values: np.ndarray,
    steps: np.ndarray,
    rendering: Rendering,
    without: _Images,
    slopes: tuple[_Images, ...] | None = None,
) -> _Rendered:
    """slopes: those of values near by, None for new ones."""

    def at(theta: np.ndarray) -> _Images:
        return _change(_images(rendering(_model_at(effect, theta))), without)

    here = at(values)
    if slopes is not None:
        return _Rendered(effect, values, here, slopes)
    found: list[_Images] = []
    for j, step in enumerate(steps):
        if step == 0.0:
            found.append({})
            continue
        there = at(np.where(np.arange(len(values)) == j, values + step, values))
        found.append({key: (there[key] - here[key]) / step for key in here})
    return _Rendered(effect, values, here, tuple(found))


def _images(lights: Mapping[Key, RenderedLight]) -> _Images:
    return {key: np.stack([x.direct, x.indirect, x.ambient]).astype(np.float64) for key, x in lights.items()}
