# SPDX-License-Identifier: Apache-2.0
"""Makes a first guess before a whole recording is rendered: effects' scores on one view, at its stated pose."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from activestereo.capture.capture import Capture, Frame
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.kept import FitCache
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.search import Search
from activestereo.diagnose.settings import Settings
from activestereo.effects import Effect, Model

_NAMES = 3  # most effects that the clause names


def richest_view(capture: Capture) -> Capture:
    """Returns the capture with the train frames of one pose alone, the one with the most settings."""
    views: dict[tuple[bytes, bool], list[Frame]] = {}
    for f in capture.split("train"):
        views.setdefault((f.camera_to_world.tobytes(), f.is_moving), []).append(f)

    def settings(frames: list[Frame]) -> int:
        return len({(f.exposure_gain, f.projector_power, f.ambient, f.temperature_c) for f in frames})

    richest = max(views.values(), key=settings) if views else []
    return replace(capture, frames=tuple(richest))


def first_words(
    evidence: Evidence, model: Model, effects: Sequence[Effect], workers: int, numbers: Numbers, kept: LayerCache
) -> str:
    """Returns a clause that names the likeliest effects, by their scores on the evidence of one view."""
    if all(np.ptp(o.measured) == 0 for o in evidence.train):
        return "the infrared images of the view looked at first are blank"
    memory = FitCache(kept, evidence.train)
    quick = [effect for effect in effects if not effect.starts_late]
    try:
        likely = Search(evidence, model, quick, Settings(workers, numbers=numbers, memory=memory)).look()
    finally:
        memory.save()
    return f"looks like {', '.join(likely[:_NAMES])}" if likely else "no effect of images fits the view looked at first"
