# SPDX-License-Identifier: Apache-2.0
"""The settings of a diagnosis, and the phases of its progress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from activestereo.common.phases import Phases
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.figures import ErrorsOfModels
from activestereo.diagnose.fitter import Fitter, Solution
from activestereo.diagnose.kept import FitCache
from activestereo.diagnose.numbers import NUMBERS, Numbers
from activestereo.diagnose.refit import Rendering
from activestereo.effects import Model

# The phases, and how many seconds they take of some four megapixels of infrared images.
RENDERING, FITTING, BOTH, DEPTH = (
    "rendering the views",
    "scoring and fitting effects",
    "rendering what was found",
    "judging the depth engine",
)
PHASES = {RENDERING: 34.0, FITTING: 70.0, BOTH: 63.0, DEPTH: 8.0}


@dataclass(frozen=True)
class Settings:
    """Settings of examine().

    phases: is told when each of PHASES but the first begins. rendering: the render engine for the evidence, or None.
    memory: the cache of fits, or None. errors: computes the errors of held-out test frames; None leaves them out.
    located(model, evidence, at_most): returns (evidence at poses estimated under a model, its render engine), or raises
    GivenUp, as gather_where_it_stands() does; None keeps the poses. with_test(evidence, fitter, solution, model):
    returns the evidence with test frames added; None leaves them out. says: called with the ranks of a user's own
    effects, and with the verdict before test frames confirm it.
    """

    phases: Phases | None = None
    numbers: Numbers = NUMBERS
    rendering: Rendering | None = None
    memory: FitCache | None = None
    errors: ErrorsOfModels | None = None
    located: Callable[[Model, Evidence, float], tuple[Evidence, Rendering | None]] | None = None
    with_test: Callable[[Evidence, Fitter, Solution, Model], Evidence] | None = None
    says: Callable[[str], object] = lambda text: None
