# SPDX-License-Identifier: Apache-2.0
"""A parameter's value and 90 % interval from a fit."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.effects import Effect, Parameter

# Normal quantile of a two-sided 90 % interval.
Z90 = 1.645
# Formulas and scene measurement are approximate: to this share of what was found (held-out cases with formulas of their
# own err by 8 % in the median, practice captures by 0.2-5 %; with this share intervals hold the truth in 20 of 22
# cases of generation 1).
_INADEQUACY = 0.10

Limits = tuple[float, float, float]


@dataclass(frozen=True)
class Interval:
    """A parameter as found: value, and the ends of its 90 % interval, in unit. floor: the half width that the interval
    has however well the parameter was fitted."""

    value: float
    low: float
    high: float
    unit: str
    floor: float = 0.0

    def as_json(self) -> dict[str, float | str]:
        return asdict(self)


def is_shape(parameter: Parameter) -> bool:
    """Shape parameters (a focus, a frequency, a doubling temperature) have no neutral value of zero."""
    return parameter.neutral != 0.0


def interval(parameter: Parameter, value: float, deviation: float) -> Limits:
    """(value, low, high) of a 90 % interval: a standard error, and the floor for what was found."""
    half = 0.0 if parameter.choice else float(np.hypot(Z90 * deviation, floor(parameter, value)))
    return value, value - half, value + half


def floor(parameter: Parameter, value: float) -> float:
    """Half of a 90 % interval by the models' own discrepancy alone: of an amplitude's distance from neutral, of a
    shape's whole value, whose neutral one is a usual place and not the absence of anything."""
    size = value if is_shape(parameter) else value - parameter.neutral
    return 0.0 if parameter.choice else Z90 * _INADEQUACY * abs(float(size))


def intervals(fitter: Fitter, solution: Solution, effect: Effect) -> dict[str, Interval]:
    """The 90 % intervals of an effect's parameters in a Solution."""
    deviation = np.sqrt(np.maximum(np.diag(fitter.covariance(solution)), 0.0))[: len(solution.theta)]
    found = zip(solution.space.pairs, solution.theta, deviation, strict=True)
    return within_ranges(effect, {p.name: interval(p, v, d) for (e, p), v, d in found if e.id == effect.id}, True)


def within_ranges(effect: Effect, found: Mapping[str, Limits], has_floor: bool = False) -> dict[str, Interval]:
    """Intervals inside the parameters' ranges; neutral and the whole range where a parameter was not found. has_floor:
    they are of interval()."""
    out = {}
    for p in effect.parameters:
        value, low, high = found.get(p.name, (p.neutral, p.low, p.high))
        low, high = (
            min(max(p.low, low), p.high),
            max(min(p.high, high), p.low),
        )  # an end that is no number is the range's
        least = floor(p, value) if has_floor and p.name in found else 0.0
        out[p.name] = Interval(float(np.clip(value, p.low, p.high)), float(low), float(high), p.unit, least)
    return out
