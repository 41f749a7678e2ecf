# SPDX-License-Identifier: Apache-2.0
"""Refines an explanation by the engine's own images: Gauss-Newton on the effect's parameters, where the image
function only proposed.

An effect's image function is a surrogate. Around its solution the engine renders the effect, and the effect with each
parameter one step further, all poses in one call with the same random numbers: what changes is the effect, not the
noise. The differences from the render without the effect stand for it from then on, linear in its parameters near the
solution; they are rendered again as the solution moves. The search looks at drafts of the train frames; what it ends
with is rendered whole. Test frames are rendered where they are asked for, which is for what is added to a model alone.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from activestereo.capture.capture import ImageKey
from activestereo.common.computed_once import computed_once
from activestereo.diagnose.findings import Explanation
from activestereo.diagnose.refine.fit_cache import content_key
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.parameter_space import ParameterSpace, Solution
from activestereo.diagnose.score.intervals import intervals
from activestereo.diagnose.score.likelihood import cross_validated
from activestereo.effects import Effect, Light, Model, View
from activestereo.effects.core.light import RenderedLight
from activestereo.effects.engines.halves import HALVES

# Rounds of rendering and fitting, and fits' steps in each.
_ROUNDS, _STEPS = 3, 4
# A step of a difference: of a parameter's typical value, or of its own distance from neutral, whichever is more.
_STEP_TYPICAL, _STEP_DISTANCE = 0.2, 0.15
# A round moves a parameter by no more than so many of these steps, keeps the slopes where none moved by more than so
# many, and ends the search where none moves by this part of one.
_TRUSTED, _NEAR, _SETTLED = 6.0, 1.0, 0.3


class Rendering(Protocol):
    """Renders the frames of a capture's split, "train" or "test", under a model, with the same random numbers in every
    call. half: 0 or 1, one of two independent halves of the samples; None: a draft, with fewer samples.
    """

    def __call__(self, model: Model, split: str, half: int | None = None) -> Mapping[ImageKey, RenderedLight]: ...


_Images = dict[ImageKey, np.ndarray]
_TRAIN, _TEST = "train", "test"


@dataclass(frozen=True)
class _Change:
    """An effect's changes of the light, [3][height][width] of each image. without: images without it, as far as
    they were asked for.
    """

    effect: Effect
    rendering: Rendering
    without: dict[tuple[str, int | None], _Images] = field(default_factory=dict)

    def at(self, theta: np.ndarray, split: str, half: int | None = None) -> _Images:
        """The change by one half of the samples, or of a draft."""
        named = {p.name: float(np.clip(v, p.low, p.high)) for p, v in zip(self.effect.parameters, theta, strict=True)}
        images = _images(self.rendering(Model().with_effect(self.effect, **named), split, half))
        if (split, half) not in self.without:
            self.without[split, half] = _images(self.rendering(Model(), split, half))
        return {key: image - self.without[split, half][key] for key, image in images.items()}

    def whole(self, theta: np.ndarray, split: str) -> _Images:
        """The change by all samples."""
        first, second = (self.at(theta, split, half) for half in HALVES)
        return {key: 0.5 * (image + second[key]) for key, image in first.items()}

    def slopes(self, theta: np.ndarray, steps: np.ndarray, split: str, here: _Images) -> tuple[_Images, ...]:
        """How drafts change by step along each parameter, 0: along none. here: the change at theta."""
        found: list[_Images] = []
        for j, step in enumerate(steps):
            there = self.at(np.where(np.arange(len(theta)) == j, theta + step, theta), split) if step else {}
            found.append({key: (image - here[key]) / step for key, image in there.items()})
        return tuple(found)


@dataclass(frozen=True)
class _Rendered:
    """An effect whose image function is its change as rendered at theta, with slopes: of the train frames. steps: of
    the slopes, for the test frames'. test: (the change of the test frames, its slopes), once prepare() has been asked
    for one of them.
    """

    rendered: _Change
    theta: np.ndarray
    steps: np.ndarray
    change: _Images
    slopes: tuple[_Images, ...]
    test: list[tuple[_Images, tuple[_Images, ...]]] = field(default_factory=list)

    def emulated(self) -> Effect:
        """The effect with these images for its image function; neutral amplitudes change nothing."""
        return replace(self.rendered.effect, apply=self._apply, prepare=self._prepare)

    @computed_once
    def content(self) -> str:
        """Hash of what decides the train frames."""
        return content_key(self.theta, self.change, self.slopes)

    def _prepare(self, views: Iterable[View]) -> None:
        """Renders the test frames where one of the views is of them."""
        if self.test or all((view.frame.id, view.side) in self.change for view in views):
            return
        slopes = self.rendered.slopes(self.theta, self.steps, _TEST, self.rendered.at(self.theta, _TEST))
        self.test.append((self.rendered.whole(self.theta, _TEST), slopes))

    def _of_view(self, view: View) -> tuple[np.ndarray, list[np.ndarray | None]]:
        """(the change at theta, its slopes) of one image."""
        key = view.frame.id, view.side
        if key in self.change:
            return self.change[key], [slope.get(key) for slope in self.slopes]
        if not self.test:
            raise RuntimeError(f"effect {self.rendered.effect.id}: frame {key[0]} is asked for before prepare()")
        change, slopes = self.test[0]
        return change[key], [slope.get(key) for slope in slopes]

    def _apply(self, light: Light, view: View, **values: float) -> Light:
        given = np.array([values[p.name] for p in self.rendered.effect.parameters])
        if _is_off(self.rendered.effect, given):
            return light
        change, slopes = self._of_view(view)
        for away, slope in zip(given - self.theta, slopes, strict=True):
            if away and slope is not None:
                change = change + away * slope
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


def refined_by_rendering(
    fitter: Fitter, explanation: Explanation, rendering: Rendering, worth_chi2: float = np.inf
) -> Explanation:
    """The explanation by the engine's images, where that is better; itself where it is not.

    fitter: of the train images. worth_chi2: what leaves more in a draft is not rendered further.
    """
    effect, start = explanation.effect, explanation.fitted
    own = slice(len(start.theta) - len(effect.parameters), None)
    change = _Change(effect, rendering)
    theta, phi, steps = start.theta, start.phi, _steps(effect, start.theta[own])
    slopes: tuple[_Images, ...] = ()
    for _ in range(_ROUNDS):
        draft = change.at(theta[own], _TRAIN)
        slopes = slopes or change.slopes(theta[own], steps, _TRAIN, draft)
        space = _with_effect(start.space, _Rendered(change, theta[own], steps, draft, slopes).emulated())
        solution = fitter.refine(space, theta, phi, _STEPS)
        if np.isfinite(worth_chi2) and (drafted := _better(explanation, fitter, solution)).chi2 > worth_chi2:
            return drafted
        reach = np.abs(steps)
        moved = np.clip(solution.theta[own], theta[own] - _TRUSTED * reach, theta[own] + _TRUSTED * reach)
        distance = np.abs(moved - theta[own])
        theta, phi = np.concatenate([solution.theta[: own.start], moved]), solution.phi
        if (distance <= _SETTLED * reach).all():
            break
        steps, slopes = _steps(effect, moved), slopes if (distance <= _NEAR * reach).all() else ()
    slopes = slopes or change.slopes(theta[own], steps, _TRAIN, change.at(theta[own], _TRAIN))
    final = _Rendered(change, theta[own], steps, change.whole(theta[own], _TRAIN), slopes)
    return _better(explanation, fitter, fitter.refine(_with_effect(start.space, final.emulated()), theta, phi, 1))


def _better(explanation: Explanation, fitter: Fitter, solution: Solution) -> Explanation:
    """The explanation by a solution with rendered images, or itself where it leaves less."""
    chi2, rendered = cross_validated(fitter, solution), solution.effects[-1]
    if chi2 >= explanation.chi2:
        return explanation
    return replace(
        explanation,
        effect=rendered,
        parameters=intervals(fitter, solution, explanation.effect),
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
        step = min(max(_STEP_TYPICAL * p.typical, _STEP_DISTANCE * abs(v - p.neutral)), p.slope_step)
        is_fixed = p.choice or not p.in_engine
        out.append(0.0 if is_fixed else -step if v + step > p.high else step)
    return np.array(out)


def _images(lights: Mapping[ImageKey, RenderedLight]) -> _Images:
    return {key: np.stack([x.direct, x.indirect, x.ambient]).astype(np.float64) for key, x in lights.items()}
