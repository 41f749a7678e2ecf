# SPDX-License-Identifier: Apache-2.0
"""Defines the descriptor of an effect: plain data and one function. A C plug-in brings the same fields.

By stage, in the order of the pipeline, `apply(value, view, **parameters)` gets and returns

    PROJECTOR, MEDIUM, SURFACE, CAMERA   a Light (radiance per light; projector at the frame's power)
    OPTICS                               one image [..., height, width] of radiance; applied to every light
                                         alike, so linear
    CHARGE                               DN above black before the amplifier: proportional to collected light
    READOUT                              DN above black
    DIGITAL                              DN as the sensor gives them, black level included
    DISPARITY                            matched disparity in the left image, pixels, 0 = no match
    DEPTH                                depth in the left image, metres, 0 = none

`apply` must not change its input. At neutral parameters it returns the input itself or an equal array. Random effects
draw from view.rng(id) alone.

An effect is defined by one function. If it changes engine fields (engine.py), moved.py makes the effect and derives
`apply`. If it changes images, the decorator `effect` makes it; `image_only` says why no engine field expresses it.

The lab (activestereo.diagnose) judges a deterministic effect up to DIGITAL by the *expected image*, which it changes.
All other effects declare in `judged` how the lab finds them:

    STATIC randomness     RandomTerms: random fields, constant over frames, found by predicting a frame from others
    TEMPORAL randomness   RandomTerms: terms of the noise model, found in the differences of repeats
    CodeSteps             digital numbers come in steps, found in their histogram
    EngineFault           how a fault of the depth engine is judged; other effects on disparity and depth need none
    Unjudged              why no capture shows the effect
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from activestereo.effects.core.light import Light
    from activestereo.effects.core.view import View

# Families of effects that move points of the images.
GEOMETRY_FAMILIES = ("camera geometry", "pattern geometry")


class Channel(Enum):
    """The data on which the lab judges an effect: expected images, random fields that frames share, noise, or depth."""

    EXPECTED_IMAGE = "expected image"
    STATIC_FIELD = "static field"
    NOISE_MODEL = "noise model"
    DEPTH_ENGINE = "depth engine"


class Lever(Enum):
    """The signal that scales a random term: term = parameter x lever x a random number of standard deviation 1.

    ONE: 1 DN. SIGNAL: DN above black. PROJECTOR: DN of the projector's direct light. EXPOSURE: exposure time x gain,
    seconds. PHOTONS: the square root of gain x DN above black; here the parameter scales the variance.
    """

    ONE = "one"
    SIGNAL = "signal"
    PROJECTOR = "projector"
    EXPOSURE = "exposure"
    PHOTONS = "photons"


class SharedBy(Enum):
    """The set of pixels and images to which one random number applies.

    PIXEL: a pixel of one camera, in all frames (in one frame, where the effect is TEMPORAL). VIEW: a pixel of one
    camera while the rig stands still. COLUMN, ROW: all pixels of a column or row of one camera. DOT: all pixels that
    see one dot of the pattern.
    """

    PIXEL = "pixel"
    VIEW = "view"
    COLUMN = "column"
    ROW = "row"
    DOT = "dot"


@dataclass(frozen=True)
class RandomTerm:
    """Declares one random field or one term of the noise model (see Lever). parameter: the name of the parameter that
    scales it. sparse_share: the name of the parameter that gives the share of affected pixels; "" = all of them."""

    parameter: str
    lever: Lever
    shared_by: SharedBy = SharedBy.PIXEL
    sparse_share: str = ""


@dataclass(frozen=True)
class CodeSteps:
    """Declares that digital numbers are rounded to multiples of a step. parameter: the one that is the step, DN."""

    parameter: str


@dataclass(frozen=True)
class EngineFault:
    """Declares how a fault of the depth engine is judged.

    is_matcher_choice: the fault depends on the choice of the matcher (a sub-pixel formula, a rounding, the size of a
    median). It is fitted and reported, but never called a fault of the sensor. displaces: its parameters shift the
    picture by pixels, as errors of the measured poses do.
    """

    is_matcher_choice: bool = False
    displaces: bool = False


@dataclass(frozen=True)
class Unjudged:
    """Declares that the lab never ranks the effect, although it is simulated. reason: why no capture shows it."""

    reason: str


Judgement = RandomTerm | CodeSteps | EngineFault | Unjudged


@dataclass(frozen=True)
class StartImage:
    """A measured image, compared with its prediction by the model without the effect. From such images an effect
    proposes starting values of its fit. Arrays are [height][width].

    weight: inverse variance, 1/DN^2. residual: measured minus expected, DN. ambient: DN of ambient light in the
    expected image, 0 where it is clipped. ambient_dn: DN per unit of ambient radiance. expected: DN above black.
    """

    view: View
    light: Light
    weight: np.ndarray
    residual: np.ndarray
    ambient: np.ndarray
    ambient_dn: float
    expected: np.ndarray


# A function that proposes starting values of a fit: the best few {parameter: value}, best first.
Starts = Callable[[list[StartImage]], list[dict[str, float]]]


class Stage(IntEnum):
    """The step of the pipeline at which an effect acts."""

    PROJECTOR = 1
    MEDIUM = 2
    SURFACE = 3
    CAMERA = 4
    OPTICS = 5
    CHARGE = 6
    READOUT = 7
    DIGITAL = 8
    DISPARITY = 9
    DEPTH = 10


class Randomness(Enum):
    """NONE: the effect is a function of its input. STATIC: random numbers are drawn once per sensor or view, and
    repeat. TEMPORAL: new ones are drawn for every frame."""

    NONE = "none"
    STATIC = "static"
    TEMPORAL = "temporal"


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect. neutral: the value at which the effect changes nothing. low, high: the physically
    possible range. typical: the standard deviation of the prior around neutral. choice: whether it is a whole
    number that selects surfaces or a variant; fits do not change it. in_engine: True: the engines have the parameter.
    False: they simulate the effect only where the parameter is neutral. None: they see the parameter in the scene.
    slope_step: the largest step of a finite difference, in `unit`; set where a share of `typical` is too coarse.
    scales_light: whether the effect's change of the light is proportional to the parameter."""

    name: str
    unit: str
    neutral: float = 0.0
    low: float = 0.0
    high: float = 1.0
    typical: float = 0.0
    source: str = ""
    choice: bool = False
    in_engine: bool | None = True
    slope_step: float = float("inf")
    scales_light: bool = False

    def __post_init__(self) -> None:
        if not self.low <= self.neutral <= self.high or self.low == self.high:
            raise ValueError(
                f"parameter {self.name}: needs low <= neutral <= high and a range, got {self.low}, {self.neutral}, "
                f"{self.high}"
            )
        if not 0 < self.typical < float("inf"):
            raise ValueError(f"parameter {self.name}: typical is {self.typical}, a prior's deviation is positive")

    @property
    def drifts(self) -> bool:
        """Returns whether it is a change per kelvin or second."""
        return "/K" in self.unit or "/s" in self.unit

    @property
    def typical_value(self) -> float:
        """Returns neutral plus `typical`, limited by the range; neutral minus `typical` where neutral is the upper
        limit."""
        up = self.neutral + self.typical
        return min(up, self.high) if self.high > self.neutral else max(self.neutral - self.typical, self.low)


@dataclass(frozen=True)
class Effect:
    """The descriptor of one effect. The head of this file says what `apply` takes and returns.

    engine(inputs, **parameters): changes the fields engine_fields of EngineInputs in place, see engine.py. None: no
    engine field expresses the effect, for the reason in image_only. judged: how the lab finds the effect if it does not
    change the expected image. starts: proposes starting values of a fit, where a coarse scan of the parameters would
    miss the optimum. starts_late: these take so long that a first guess leaves the effect out. finding: the sentence
    that a verdict shows, without its full stop. remembers: the effect gets its result for the frame before in
    view.before. is_pointwise: each pixel's light depends on that pixel alone, so that fits compute only some pixels. At
    READOUT it means that all pixels follow one curve.
    """

    id: str
    family: str
    stage: Stage
    parameters: tuple[Parameter, ...]
    apply: Callable[..., Any]
    summary: str
    source: str
    randomness: Randomness = Randomness.NONE
    engine: Callable[..., None] | None = None
    engine_fields: tuple[str, ...] = ()
    image_only: str = ""
    judged: tuple[Judgement, ...] = ()
    starts: Starts | None = None
    starts_late: bool = False
    finding: str = ""
    remembers: bool = False
    is_pointwise: bool = False

    def is_simulated(self, values: Mapping[str, float]) -> bool:
        """Returns whether engines simulate the effect at these values; else its image function acts."""
        return self.engine is not None and all(
            p.in_engine is not False or values[p.name] == p.neutral for p in self.parameters
        )

    def __post_init__(self) -> None:
        names = {p.name for p in self.parameters}
        for judgement in self.judged:
            for name in (getattr(judgement, "parameter", ""), getattr(judgement, "sparse_share", "")):
                if name and name not in names:
                    raise ValueError(f"effect {self.id}: is judged by a parameter '{name}' that it does not have")

    @property
    def rounds(self) -> bool:
        """Returns whether the effect rounds digital numbers to coarse steps."""
        return any(isinstance(j, CodeSteps) for j in self.judged)

    @property
    def is_in_mean(self) -> bool:
        """Returns whether the effect changes the mean of many exposures. Noise removes the mean error of rounding."""
        return self.randomness is Randomness.NONE and not self.rounds

    @property
    def channel(self) -> Channel | None:
        """Returns the data on which the lab judges the effect. None: it does not, for the reason in unjudged_reason."""
        if any(isinstance(j, Unjudged) for j in self.judged):
            return None
        if self.stage > Stage.DIGITAL:
            return Channel.DEPTH_ENGINE if self.randomness is Randomness.NONE else None
        if self.rounds:
            return Channel.NOISE_MODEL
        if self.randomness is Randomness.NONE:
            return Channel.EXPECTED_IMAGE
        if not self.random_terms:
            return None
        return Channel.STATIC_FIELD if self.randomness is Randomness.STATIC else Channel.NOISE_MODEL

    @property
    def unjudged_reason(self) -> str:
        """Returns why the lab does not rank the effect. It has a meaning only if `channel` is None."""
        said = (j.reason for j in self.judged if isinstance(j, Unjudged))
        silent = "it is random, and its descriptor does not say how it is judged (see effects/core/descriptor.py)"
        return next(said, silent)

    @property
    def random_terms(self) -> tuple[RandomTerm, ...]:
        return tuple(j for j in self.judged if isinstance(j, RandomTerm))

    @property
    def engine_fault(self) -> EngineFault:
        return next((j for j in self.judged if isinstance(j, EngineFault)), EngineFault())

    def values(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """Returns {name: value} of every parameter, neutral where `given` has none. Raises ValueError for an unknown
        name or a value out of range."""
        given = dict(given or {})
        values = {}
        for p in self.parameters:
            value = float(given.pop(p.name, p.neutral))
            if not p.low <= value <= p.high:
                raise ValueError(f"{self.id}.{p.name} is {value} {p.unit}, outside {p.low}..{p.high}")
            values[p.name] = value
        if given:
            known = ", ".join(p.name for p in self.parameters)
            raise ValueError(f"{self.id} has no parameter '{next(iter(given))}' (known: {known})")
        return values

    def on_pixels(self, values: dict[str, float], size: int) -> dict[str, float]:
        """Returns the parameter values for images in which size x size pixels are averaged into one: lengths in px are
        divided by size."""
        if size == 1:
            return values
        lengths = {p.name for p in self.parameters if p.unit.startswith("px")}
        return {name: value / size if name in lengths else value for name, value in values.items()}

    @property
    def neutral_values(self) -> dict[str, float]:
        return {p.name: p.neutral for p in self.parameters}

    @property
    def typical_values(self) -> dict[str, float]:
        return {p.name: p.typical_value for p in self.parameters}

    def __call__(self, value: Any, view: Any, **parameters: float) -> Any:
        return self.apply(value, view, **self.values(parameters))


def effect(
    id: str = "", *, stage: Stage, family: str, parameters: Sequence[Parameter], source: str, **others: Any
) -> Callable[[Callable], Effect]:
    """Returns a decorator that makes an Effect of a function; the function's docstring becomes the summary. Raises
    ValueError where it has no docstring or other arguments than the parameters. The arguments are Effect's; id: by
    default the function's name."""

    def make(function: Callable) -> Effect:
        name, summary = id or function.__name__, (inspect.getdoc(function) or "").strip()
        if not summary:
            raise ValueError(f"effect {name}: the function needs a docstring, it is what users read")
        before = 1 if "engine" in others else 2  # arguments before the parameters: (inputs) or (value, view)
        wanted, names = list(inspect.signature(function).parameters)[before:], [p.name for p in parameters]
        if wanted != names:
            raise ValueError(f"effect {name}: the function takes {wanted}, the parameters are {names}")
        return Effect(name, family, stage, tuple(parameters), function, summary, source, **others)

    return make
