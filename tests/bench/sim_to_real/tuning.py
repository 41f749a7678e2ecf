# SPDX-License-Identifier: Apache-2.0
"""Nine models: each of three methods with the setting that is best in each of three worlds."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_to_real.files import Candidate, RunFolder
from sim_to_real.methods import METHODS
from sim_to_real.pose_error import CRITERIA, successes
from sim_to_real.poses import errors_of
from sim_to_real.settings import BenchmarkSettings
from sim_to_real.worlds import SIMULATED


@dataclass(frozen=True)
class Model:
    """A method with its best setting in a world."""

    method: str
    tuned_on: str
    setting: int

    @property
    def candidate(self) -> Candidate:
        return self.method, self.setting

    @property
    def values(self) -> dict[str, Any]:
        """The values of the setting."""
        return asdict(METHODS[self.method].SETTINGS[self.setting])


def every_candidate() -> list[Candidate]:
    return [(method, number) for method, kind in METHODS.items() for number in range(len(kind.SETTINGS))]


def models_of(folder: RunFolder) -> list[Model]:
    """The models of a tuned run. Raises ValueError if it is not tuned."""
    settings = BenchmarkSettings.read(folder)
    every, rounds = every_candidate(), settings.rounds("tuning")
    return tuned({mode: errors_of(folder, mode, "tuning", rounds, every) for mode in SIMULATED}, every)


def tuned(errors: dict[str, NDArray[np.float64]], candidates: list[Candidate]) -> list[Model]:
    """For each method and each world of {world: errors [candidates, views, 2]} the setting with the most successes over
    both criteria. Ties go to the smallest errors, capped at three times the first criterion's."""
    models = []
    for method in METHODS:
        rows = [row for row, (name, _) in enumerate(candidates) if name == method]
        for world, own in errors.items():
            score = sum(successes(own, c).mean(axis=1) for c in CRITERIA)
            size = np.minimum(own / np.array(CRITERIA[0]), 3.0).mean(axis=(1, 2))
            best = max(rows, key=lambda row: (round(float(score[row]), 9), -float(size[row])))
            models.append(Model(method, world, candidates[best][1]))
    return models


def candidates_of(models: list[Model]) -> list[Candidate]:
    """Candidates without repeats: two worlds may choose the same setting."""
    return sorted({model.candidate for model in models})
