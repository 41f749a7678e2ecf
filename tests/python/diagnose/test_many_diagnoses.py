# SPDX-License-Identifier: Apache-2.0
"""Short diagnoses with 2 to 16 processes, one after the other: none dies, and each gives what one gave."""

import os
from dataclasses import replace

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import render_frames
from activestereo.diagnose.diagnosis import Settings, examine
from activestereo.diagnose.gather import gather
from activestereo.diagnose.kept import FitCache
from activestereo.effects import Model, builtin
from activestereo.effects.engines import CaptureRenderer
from virtual_sensor.world import make_world

TIMES = 200 if os.environ.get("ACTIVESTEREO_FULL") else 2
HAZE = {"extinction_per_m": 0.6, "backscatter": 1.0, "housing_m": 0.05}
EFFECTS = [builtin()[name] for name in ("haze", "vignetting")]


@pytest.fixture(scope="module")
def hazy(tmp_path_factory):
    """Evidence of a small world whose images have haze in them."""
    folder = tmp_path_factory.mktemp("many")
    world = make_world(folder / "world", grid=2)
    capture = read_capture(world.capture_path)
    layers = render_frames(capture, CaptureRenderer(), 32, 2, cache=LayerCache(folder / "cache"))
    clean = gather(capture, layers)
    model = Model().with_effect(builtin()["haze"], **HAZE)
    hazy = CaptureRenderer("auto", 32, 2, seed=1).expected(capture, model, clean.nuisances)

    def exposed(o):
        return replace(o, measured=np.rint(hazy[o.key]).astype(np.float32))

    return replace(clean, train=tuple(map(exposed, clean.train)), test=tuple(map(exposed, clean.test)))


def test_many_diagnoses_with_many_processes_give_one_result(hazy, tmp_path):
    renders = []

    def result(workers):
        renderer = CaptureRenderer("auto", 1, 2, 0)

        def rendering(model, samples=1):
            renders.append(model)
            before, after = (renderer.lights(hazy.capture, m, hazy.capture.split("train")) for m in (Model(), model))
            light = lambda o: np.stack((o.direct, o.indirect, o.ambient))  # noqa: E731
            return {key: light(after[key]) - light(before[key]) for key in after}

        memory = FitCache(LayerCache(tmp_path), hazy.train, workers)
        return examine(hazy, Model(), EFFECTS, Settings(rendering=rendering, memory=memory)).result

    first = result(1)
    assert first["ranking"][0]["effect"] == "haze" and renders
    for number in range(1, TIMES):
        workers = 2 + number % 15
        assert result(workers) == first, f"diagnosis {number}, {workers} processes"
