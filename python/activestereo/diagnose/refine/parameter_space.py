# SPDX-License-Identifier: Apache-2.0
"""The parameters that a fit may move, and the result of a fit."""

from dataclasses import dataclass, field

import numpy as np

from activestereo.diagnose.refine.light import SCALES
from activestereo.diagnose.refine.normal_equations import Sums
from activestereo.effects import Effect, Model, Parameter, Randomness, Stage
from activestereo.effects.core.model import Nuisances

# The step of a finite difference: this share of a parameter's typical value, or of a quarter of its distance from
# neutral.
_STEP = 0.02
_DISTANCE_SHARE = 0.25


@dataclass(frozen=True)
class ParameterSpace:
    """The parameters of a model's deterministic effects, and of one candidate after them, as one vector theta.

    pairs: (Effect, Parameter) of each entry of theta. start: theta at the start of fits.
    """

    base: Model
    pairs: tuple[tuple[Effect, Parameter], ...]
    start: np.ndarray

    @classmethod
    def of(cls, model: Model, candidate: Effect | None = None) -> "ParameterSpace":
        """Makes the space of a model's deterministic effects, started at their values, and a candidate's, started at
        neutral."""
        fitted = [(e, values) for e, values in model.effects if e.randomness is Randomness.NONE]
        pairs = [(e, p) for e, _ in fitted for p in e.parameters]
        start = [values[p.name] for e, values in fitted for p in e.parameters]
        if candidate is not None:
            pairs += [(candidate, p) for p in candidate.parameters]
            start += [p.neutral for p in candidate.parameters]
        return cls(model, tuple(pairs), np.array(start, dtype=np.float64))

    def of_parameters(self, name: str) -> np.ndarray:
        """Returns one field of every parameter, [n]."""
        return np.array([getattr(p, name) for _, p in self.pairs])

    @property
    def low(self) -> np.ndarray:
        return self.of_parameters("low")

    @property
    def high(self) -> np.ndarray:
        return self.of_parameters("high")

    @property
    def typical(self) -> np.ndarray:
        return self.of_parameters("typical")

    @property
    def slope_step(self) -> np.ndarray:
        return self.of_parameters("slope_step")

    @property
    def neutral(self) -> np.ndarray:
        return self.of_parameters("neutral")

    @property
    def given(self) -> np.ndarray:
        """Returns which parameters are choices, such as a set of surfaces, which no fit changes, bool [n]."""
        return self.of_parameters("choice").astype(bool)

    @property
    def in_light(self) -> np.ndarray:
        """Returns which parameters belong to effects on the light before the sensor, up to the lens, bool [n]."""
        return np.array([e.stage <= Stage.OPTICS for e, _ in self.pairs], dtype=bool)

    def model(self, theta: np.ndarray) -> Model:
        """Returns the model with the parameters theta."""
        chosen: dict[str, tuple[Effect, dict[str, float]]] = {}
        for (e, p), value in zip(self.pairs, theta, strict=True):
            chosen.setdefault(e.id, (e, {}))[1][p.name] = float(value)
        model = self.base
        for e, values in chosen.values():
            model = model.with_effect(e, **values)
        return model

    def steps(self, theta: np.ndarray) -> np.ndarray:
        """Returns finite-difference steps that stay in range."""
        step = _STEP * np.maximum(self.typical, _DISTANCE_SHARE * np.abs(theta - self.neutral))
        step = np.minimum(step, self.slope_step)
        return np.where(theta + step > self.high, -step, step)


@dataclass(frozen=True)
class Solution:
    """The result of a fit.

    theta: effect parameters. phi: nuisances (see light.py). sums: normal equations at the solution.
    """

    space: ParameterSpace
    theta: np.ndarray
    phi: np.ndarray
    sums: Sums
    model: Model = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", self.space.model(self.theta))

    @property
    def effects(self) -> list[Effect]:
        """The effects whose parameters were fitted."""
        return list({e.id: e for e, _ in self.space.pairs}.values())

    @property
    def nuisances(self) -> Nuisances:
        return Nuisances(*map(float, self.phi[:SCALES]))
