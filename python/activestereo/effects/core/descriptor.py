# SPDX-License-Identifier: Apache-2.0
"""The descriptor of an effect: plain data and one function. A C plug-in brings the same fields.

By stage, in the order of the pipeline, `apply(value, view, **parameters)` gets and returns

    PROJECTOR, MEDIUM, SURFACE, CAMERA   a Light (radiance per light; projector at the frame's power)
    OPTICS                               one image [..., height, width] of radiance; applied to every light
                                         alike, so linear
    CHARGE                               DN above black before the amplifier: proportional to collected light
    READOUT                              DN above black
    DIGITAL                              DN as the sensor gives them, black level included
    DISPARITY                            matched disparity in the left image, pixels, 0 = no match
    DEPTH                                depth in the left image, metres, 0 = none

It must not change its input, and must return the input itself or an equal one where every parameter is neutral.
Random effects draw from view.rng(id) alone. How the lab judges an effect stands in judging.py.

`engine` says what the effect is inside of the engines, see engine.py; an effect without one is `image_only`,
and says why. Where engine fields alone tell the effect, moved.py makes `apply` of them.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Any

from activestereo.effects.core.judging import Channel, CodeSteps, EngineFault, Judgement, RandomTerm, Starts, Unjudged


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
    """NONE: a function of its input. STATIC: drawn once per sensor (or view), the same in repeats. TEMPORAL: drawn per
    frame."""

    NONE = "none"
    STATIC = "static"
    TEMPORAL = "temporal"


@dataclass(frozen=True)
class Parameter:
    """neutral: the value of no effect. low..high: physically possible. typical: one prior deviation from neutral.
    choice: it says where or how, in whole numbers: fits take it as given. in_engine: whether the engines know it, in an
    effect that they simulate. slope_step: the largest step by which a slope of an image may be taken, where the image
    follows the parameter far more finely than `typical` tells."""

    name: str
    unit: str
    neutral: float
    low: float
    high: float
    typical: float
    source: str = ""
    choice: bool = False
    in_engine: bool = True
    slope_step: float = float("inf")

    def __post_init__(self) -> None:
        if not self.low <= self.neutral <= self.high or self.low == self.high:
            raise ValueError(
                f"parameter {self.name}: needs low <= neutral <= high and a range, got {self.low}, {self.neutral}, "
                f"{self.high}"
            )
        if not 0 < self.typical < float("inf"):
            raise ValueError(f"parameter {self.name}: typical is {self.typical}, a prior's deviation is positive")

    @property
    def typical_value(self) -> float:
        """One deviation from neutral, inside the range."""
        up = self.neutral + self.typical
        return min(up, self.high) if self.high > self.neutral else max(self.neutral - self.typical, self.low)


@dataclass(frozen=True)
class Effect:
    """See the head of this file.

    engine(inputs, **parameters): changes EngineInputs, see engine.py; None where no engine field expresses the effect:
    image_only says why. judged: how the lab finds it, where its expected image is not what changes. starts: proposes
    where fits begin, where a coarse scan of the parameters would miss. finding: what a verdict says where it is found,
    a sentence without its full stop. prepare: makes what apply needs for these views; whoever lets threads apply an
    effect calls it before they start, for it may render. remembers: it sees in view.before what it gave for the frame
    before. is_pointwise: a pixel's light depends on that pixel alone, and fits compute the pixels that they look at; at
    READOUT: all pixels follow one curve.
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
    image_only: str = ""
    judged: tuple[Judgement, ...] = ()
    starts: Starts | None = None
    finding: str = ""
    prepare: Callable[[Iterable[Any]], None] | None = None
    remembers: bool = False
    is_pointwise: bool = False

    @property
    def engine_fields(self) -> tuple[str, ...]:
        """Names of the engine fields that it moves; empty where it is image only."""
        return getattr(self.engine, "fields", ("not declared",) if self.engine else ())

    def __post_init__(self) -> None:
        names = {p.name for p in self.parameters}
        for judgement in self.judged:
            for name in (getattr(judgement, "parameter", ""), getattr(judgement, "sparse_share", "")):
                if name and name not in names:
                    raise ValueError(f"effect {self.id}: is judged by a parameter '{name}' that it does not have")

    @property
    def channel(self) -> Channel | None:
        """The channel that the lab judges the effect on; None where unjudged_reason says why there is none."""
        if any(isinstance(j, Unjudged) for j in self.judged):
            return None
        if self.stage > Stage.DIGITAL:
            return Channel.DEPTH_ENGINE if self.randomness is Randomness.NONE else None
        if any(isinstance(j, CodeSteps) for j in self.judged):
            return Channel.NOISE_MODEL
        if self.randomness is Randomness.NONE:
            return Channel.EXPECTED_IMAGE
        if not self.random_terms:
            return None
        return Channel.STATIC_FIELD if self.randomness is Randomness.STATIC else Channel.NOISE_MODEL

    @property
    def unjudged_reason(self) -> str:
        """Why the lab does not rank the effect, where it has no channel."""
        said = (j.reason for j in self.judged if isinstance(j, Unjudged))
        silent = "it is random, and its descriptor does not say how it is judged (see effects/core/judging.py)"
        return next(said, silent)

    @property
    def random_terms(self) -> tuple[RandomTerm, ...]:
        return tuple(j for j in self.judged if isinstance(j, RandomTerm))

    @property
    def engine_fault(self) -> EngineFault:
        return next((j for j in self.judged if isinstance(j, EngineFault)), EngineFault())

    def values(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """{name: value} of every parameter, neutral where not given; ValueError for an unknown name or a value out of
        range."""
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
        """The values where images are averaged over size x size pixels: lengths in pixels are fewer of those."""
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
    id: str, *, stage: Stage, family: str, parameters: list[Parameter], source: str,
    randomness: Randomness = Randomness.NONE,
    engine: Callable[..., None] | None = None, image_only: str = "",
    judged: tuple[Judgement, ...] = (), starts: Starts | None = None, finding: str = "", remembers: bool = False,
    is_pointwise: bool = False,
) -> Callable[[Callable], Effect]:  # fmt: skip
    """Makes an Effect of a function; its docstring is the effect's summary. See Effect."""

    def make(function: Callable) -> Effect:
        summary = (inspect.getdoc(function) or "").strip()
        if not summary:
            raise ValueError(f"effect {id}: the function needs a docstring, it is what users read")
        wanted = list(inspect.signature(function).parameters)[2:]
        if wanted != [p.name for p in parameters]:
            raise ValueError(
                f"effect {id}: the function takes {wanted}, the parameters are {[p.name for p in parameters]}"
            )
        moved = wanted if engine is None else list(inspect.signature(engine).parameters)[1:]
        if moved != wanted:
            raise ValueError(f"effect {id}: its engine function takes {moved}, the parameters are {wanted}")
        return Effect(
            id,
            family,
            stage,
            tuple(parameters),
            function,
            summary,
            source,
            randomness,
            engine,
            image_only,
            tuple(judged),
            starts,
            finding,
            remembers=remembers,
            is_pointwise=is_pointwise,
        )

    return make
