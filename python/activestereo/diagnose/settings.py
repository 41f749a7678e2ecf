# SPDX-License-Identifier: Apache-2.0
"""How evidence is examined, and the phases that a progress is told of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from activestereo.common.phases import Phases
from activestereo.common.progress_bar import UsualTime
from activestereo.diagnose.answer.figures import ErrorsOfModels
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.numbers import NUMBERS, Numbers
from activestereo.diagnose.refine import Fitter, Solution
from activestereo.diagnose.refine.fit_cache import FitCache
from activestereo.diagnose.search.rendered import Rendering
from activestereo.effects import Model

# The phases, each with seconds and seconds per megapixel of infrared images on two cores: a guess for a first run.
RENDERING, FITTING, DEPTH, BOTH = (
    "rendering the views",
    "scoring and fitting effects",
    "judging the depth engine",
    "rendering what was found",
)
PHASES = {
    RENDERING: UsualTime(2.0, 8.0),
    FITTING: UsualTime(10.0, 15.0),
    DEPTH: UsualTime(0.3, 2.0),
    BOTH: UsualTime(3.0, 15.0),
}


@dataclass(frozen=True)
class Settings:
    """How evidence is examined. phases: told of each of PHASES but the first. rendering: the engine of the evidence.
    memory: where fits are kept, or None. errors: None leaves out the held-out figures of test frames. located: the
    evidence, and its engine, from where the capture stands under a model; None leaves it where it is. with_test: the
    evidence of an outcome with test frames, under a model; None leaves them out. says:
    called with words: the likeliest effects once all are scored, and the verdict before test frames confirm it."""

    workers: int = 2
    phases: Phases | None = None
    numbers: Numbers = NUMBERS
    rendering: Rendering | None = None
    memory: FitCache | None = None
    errors: ErrorsOfModels | None = None
    located: Callable[[Model, Evidence], tuple[Evidence, Rendering | None]] | None = None
    with_test: Callable[[Evidence, Fitter, Solution, Model], Evidence] | None = None
    says: Callable[[str], object] = lambda text: None
