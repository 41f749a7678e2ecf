# SPDX-License-Identifier: Apache-2.0
"""A render of a capture that fails leaves neither images nor a changed scene."""

from contextlib import contextmanager

import numpy as np
import pytest

from activestereo.effects import Model, builtin
from activestereo.effects.engines.capture_renderer import CaptureRenderer
from activestereo.effects.engines.capture_inputs import enter_world
from activestereo.compare.effect_trials import trial_capture


def test_after_a_failed_render_the_next_one_is_as_if_it_had_not_been(tmp_path, monkeypatch):
    capture = trial_capture(tmp_path)
    effect = builtin()["specular"]
    model = Model().with_effect(effect, **effect.typical_values)
    renderer = CaptureRenderer("cpu", 1, 1)
    before = {key: light.ambient for key, light in CaptureRenderer("cpu", 1, 1).lights(capture, Model()).items()}

    @contextmanager
    def left_changed(scene, inputs):
        enter_world(scene, inputs)
        yield
        raise RuntimeError("the scene is inside another call")

    with monkeypatch.context() as patch:
        patch.setattr("activestereo.effects.engines.capture_renderer.changed_world", left_changed)
        with pytest.raises(RuntimeError):
            renderer.lights(capture, model)
    for key, light in renderer.lights(capture, Model()).items():
        assert np.array_equal(light.ambient, before[key])
