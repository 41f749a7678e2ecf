# SPDX-License-Identifier: Apache-2.0
"""Makes a first guess before anything is fitted: effects' scores at the stated poses, by one shape of each."""

from collections.abc import Sequence

import numpy as np

from activestereo.diagnose.dictionary import first_dictionary
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.kept import FitCache
from activestereo.diagnose.linear import scores
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.selection import candidates
from activestereo.effects import Effect, Model
from activestereo.effects.core.descriptor import Channel

_NAMES = 3  # most effects that the clause names


def first_words(
    evidence: Evidence, model: Model, effects: Sequence[Effect], workers: int, numbers: Numbers, memory: FitCache
) -> str:
    """Returns a clause that names the likeliest effects. memory: keeps the image changes, which the search scores
    again."""
    if all(np.ptp(o.measured) == 0 for o in evidence.train):
        return "the infrared images are blank"
    images = [e for e in effects if e.channel is Channel.EXPECTED_IMAGE and not e.starts_late]
    first = first_dictionary(evidence, model, images, numbers.prior_reach, workers, memory)
    likely = list(candidates(first.atoms, scores(first.linear, first.columns), evidence.pixels))
    return f"looks like {', '.join(likely[:_NAMES])}" if likely else "no effect of images fits"
