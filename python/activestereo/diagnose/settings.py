# SPDX-License-Identifier: Apache-2.0
"""How evidence is examined, and the phases that a progress is told of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from activestereo.common.phases import Phases
from activestereo.common.usual_time import UsualTime
from activestereo.diagnose.answer.figures import ErrorsOfModels
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.refine.by_rendering import Rendering
from activestereo.diagnose.refine.fit_cache import FitCache
from activestereo.diagnose.thresholds import THRESHOLDS, Thresholds
from activestereo.effects import Model

# The phases, each with seconds and seconds per megapixel of infrared images on two cores: a guess for a first run.
RENDERING, FITTING, ADDING, DEPTH, BOTH = (
    "rendering the views",
    "fitting effects",
    "checking what was found",
    "judging the depth engine",
    "rendering what was found",
)
PHASES = {
    RENDERING: UsualTime(2.0, 8.0),
    FITTING: UsualTime(10.0, 15.0),
    ADDING: UsualTime(0.5, 1.0),
    DEPTH: UsualTime(0.3, 2.0),
    BOTH: UsualTime(3.0, 15.0),
}


@dataclass(frozen=True)
class Place:
    """Evidence from where a capture stands, with the engine and the fits there."""

    evidence: Evidence
    rendering: Rendering | None
    memory: FitCache


@dataclass(frozen=True)
class Settings:
    """How evidence is examined. steps: "one" or "greedy". phases: told of each of PHASES but the first. rendering:
    the engine of the evidence. memory: where its fits are kept, or None. errors: None leaves the held-out figures out.
    located: the evidence from where the capture stands under a model; None leaves it where it is. scores_first: all
    effects are scored before the few that matter are fitted (by_scores.py); looks_like: called with the likeliest ones
    then."""

    steps: str = "one"
    workers: int = 2
    phases: Phases | None = None
    thresholds: Thresholds = THRESHOLDS
    rendering: Rendering | None = None
    memory: FitCache | None = None
    errors: ErrorsOfModels | None = None
    located: Callable[[Model, Evidence], Place] | None = None
    scores_first: bool = False
    looks_like: Callable[[Sequence[str]], object] = lambda names: None
