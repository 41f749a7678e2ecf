# SPDX-License-Identifier: Apache-2.0
"""Fits effects of surfaces, air and lamps to images that the engine renders of them.

An effect's image function is a formula. Around its fit the engine renders the effect, then again with each parameter
one step further. The random numbers are the same, so that differences show the effect and not the noise. These
differences then replace the formula, linear in its parameters.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from activestereo.capture.capture import ImageKey
from activestereo.common.computed_once import computed_once
from activestereo.diagnose.refine.fit_cache import content_key
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.effects import Effect, Light, Model, View

# Rounds of rendering and fitting, and steps of each fit. A difference steps by this share of the typical value or of
# the parameter's own distance. A round moves a parameter by at most so many steps, and is the last below a half.
_ROUNDS, _STEPS = 2, 4
_STEP_TYPICAL, _STEP_DISTANCE = 0.2, 0.15
_TRUSTED, _SETTLED = 6.0, 0.5


_Images = Mapping[ImageKey, np.ndarray]


class Rendering(Protocol):
    """Renders a capture's train frames under a model, with the same random numbers in every call: light (direct,
    indirect, ambient), float32 [3][height][width]."""

    def __call__(self, model: Model) -> _Images: ...


@dataclass(frozen=True)
class _Rendered:
    """Replaces an effect's formula by rendered images: its change of the light [3][height][width] at parameters theta,
    and the slopes of that change by each parameter ({} if it has none)."""

    effect: Effect
    theta: np.ndarray
    change: _Images
    slopes: tuple[_Images, ...]

    def emulated(self) -> Effect:
        """Returns the effect with these images as its image function; neutral amplitudes change nothing."""
        return replace(self.effect, apply=self._apply)

    @computed_once
    def content(self) -> str:
        """Returns a hash of the images, for a FitCache."""
        return content_key(self.theta, self.change, self.slopes)

    def _apply(self, light: Light, view: View, **values: float) -> Light:
        given, key = np.array([values[p.name] for p in self.effect.parameters]), (view.frame.id, view.side)
        amplitudes = [v == p.neutral for p, v in zip(self.effect.parameters, given, strict=True) if p.neutral == 0.0]
        if all(amplitudes):
            return light
        change = self.change[key]
        for away, slope in zip(given - self.theta, self.slopes, strict=True):
            if away and slope:
                change = change + away * slope[key]
        images = zip((light.direct, light.indirect, light.ambient), change, strict=True)
        direct, indirect, ambient = (np.maximum(old + new, 0.0) for old, new in images)
        return replace(light, direct=direct, indirect=indirect, ambient=ambient)


def fitted_to_renders(fitter: Fitter, start: Solution, rendering: Rendering) -> Solution:
    """Renders the last effect of a fit, replaces its formula by the rendered changes, and fits again. Returns the new
    fit, or `start` if it is no better."""
    effect, own = start.effects[-1], slice(len(start.theta) - len(start.effects[-1].parameters), None)
    without = rendering(Model())

    def change(values: np.ndarray) -> _Images:
        named = {p.name: float(np.clip(v, p.low, p.high)) for p, v in zip(effect.parameters, values, strict=True)}
        images = rendering(Model().with_effect(effect, **named))
        return {key: image - without[key] for key, image in images.items()}

    best, theta, phi = start, start.theta, start.phi
    for _ in range(_ROUNDS):
        here, steps = change(theta[own]), _steps(effect, theta[own])
        slopes: list[_Images] = []
        for j, step in enumerate(steps):
            there = change(np.where(np.arange(len(steps)) == j, theta[own] + step, theta[own])) if step else {}
            slopes.append({key: (image - here[key]) / step for key, image in there.items()})
        emulated = _Rendered(effect, theta[own].copy(), here, tuple(slopes)).emulated()
        pairs = tuple((emulated if e.id == emulated.id else e, p) for e, p in start.space.pairs)
        solution = fitter.refine(replace(start.space, pairs=pairs), theta, phi, _STEPS)
        best = min(best, solution, key=lambda s: s.sums.total)
        reach = np.abs(steps)
        moved = np.clip(solution.theta[own], theta[own] - _TRUSTED * reach, theta[own] + _TRUSTED * reach)
        is_settled = (np.abs(moved - theta[own]) <= _SETTLED * reach).all()
        theta, phi = np.concatenate([solution.theta[: own.start], moved]), solution.phi
        if is_settled:
            break
    return best


def _steps(effect: Effect, values: np.ndarray) -> np.ndarray:
    """Returns steps of differences inside the range; 0 for choices and for parameters that the engine lacks."""
    out = []
    for p, v in zip(effect.parameters, values, strict=True):
        step = min(max(_STEP_TYPICAL * p.typical, _STEP_DISTANCE * abs(v - p.neutral)), p.slope_step)
        out.append(0.0 if p.choice or not p.in_engine else -step if v + step > p.high else step)
    return np.array(out)
