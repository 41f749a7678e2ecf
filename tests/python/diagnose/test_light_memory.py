# SPDX-License-Identifier: Apache-2.0
"""Frames of one pose share the light of an effect that looks at nothing in which they differ."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects.core.view import Layers
from activestereo.diagnose.pixels import LightMemory
from activestereo.effects import Model, builtin
from activestereo.effects.core.laws import example_view


@pytest.fixture()
def observations():
    view = example_view("left")
    image = np.random.default_rng(1).random(view.shape)
    layers = Layers(image, 0.1 * image, image, image, view.depth_m, view.normal, np.zeros(view.shape, np.uint32))
    frames = (replace(view.frame, id=i, timestamp_s=0.0013 * i) for i in range(3))
    views = [replace(view, frame=frame) for frame in frames]
    views[2] = replace(views[2], frame=replace(views[2].frame, temperature_c=70.0))
    return [SimpleNamespace(side=v.side, frame=v.frame, view=v, layers=layers) for v in views]


@pytest.mark.parametrize(
    ("name", "values", "shared"),
    [
        ("vignetting", {"exponent": 2.0}, 3),
        ("chromatic_drift", {"transmission_per_k": -0.01}, 2),  # the third frame is warmer
        ("flicker_banding", {"depth": 0.5, "frequency_hz": 100.0, "line_time_s": 5e-5}, 1),
    ],
)
def test_a_light_is_shared_where_the_effect_looks_at_nothing_else(observations, name, values, shared):
    model, memory = Model().with_effect(builtin()[name], **values), LightMemory(observations)
    lights = [memory(model, i) for i in range(3)]
    assert [light is lights[0] for light in lights] == [i < shared for i in range(3)]
    for light, o in zip(lights, observations, strict=True):
        assert light.images == pytest.approx(model.light(o.layers, o.view).images)


def test_what_comes_after_a_flicker_is_not_shared(observations):
    effects = builtin()
    model = Model().with_effect(effects["flicker_banding"], depth=0.5).with_effect(effects["vignetting"], exponent=2.0)
    memory = LightMemory(observations)
    for i, o in enumerate(observations):
        assert memory(model, i).images == pytest.approx(model.light(o.layers, o.view).images)
