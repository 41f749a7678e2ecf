# SPDX-License-Identifier: Apache-2.0
"""An image function only proposes: the engine's images, which follow another formula, decide an effect's parameters."""

import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.effects import Light, Model, Parameter, Stage, effect
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.base_fit import fit_base
from activestereo.diagnose.channels import ExpectedImageChannel
from activestereo.diagnose.evidence import gather
from activestereo.diagnose.thresholds import THRESHOLDS
from activestereo.diagnose.propose.scan import scan_observations
from activestereo.diagnose.refine import Fitters
from activestereo.diagnose.refine.by_rendering import refined_by_rendering
from activestereo.compare.render import render_frames
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world

TRUTH = 0.8


def brightened(light, view, amount, formula):
    """Ambient light that grows to the right."""
    return replace(light, ambient=light.ambient * (1.0 + formula(amount * (1.0 + view.field()[0]))))


@effect(
    "glow",
    stage=Stage.SURFACE,
    family="f",
    source="s",
    parameters=[Parameter("amount", "1", neutral=0.0, low=0.0, high=3.0, typical=0.3)],
)
def glow(light, view, amount):
    """It grows linearly, says the image function."""
    return brightened(light, view, amount, lambda x: x)


def engine_law(x):
    return 1.3 * (np.exp(0.7 * x) - 1.0)


@pytest.fixture(scope="module")
def evidence(tmp_path_factory):
    """A world whose ambient light follows the engine's formula, without noise."""
    folder = tmp_path_factory.mktemp("world")
    world = make_world(folder, grid=4)
    capture = read_capture(world.capture_path)
    clean = gather(capture, render_frames(capture, WorldRenderer(world), cache=LayerCache(folder / "cache")))

    def exposed(o):
        light = brightened(Light.of(o.layers), o.view, TRUTH, engine_law)
        return replace(o, measured=Model().signal(light, o.view, clean.nuisances).astype(np.float32))

    return replace(clean, train=tuple(map(exposed, clean.train)), test=tuple(map(exposed, clean.test)))


def rendering_of(evidence, calls):
    """The engine; calls gets (split, half) of each."""

    def rendering(model, split, half=None):
        amount = model.effects[0][1]["amount"] if model.effects else 0.0
        calls.append((split, half))
        seen = evidence.train if split == "train" else evidence.test
        lights = {o.key: brightened(Light.of(o.layers), o.view, amount, engine_law) for o in seen}
        return {
            key: SimpleNamespace(direct=x.direct, indirect=x.indirect, ambient=x.ambient) for key, x in lights.items()
        }

    return rendering


def test_the_engines_images_find_the_parameter_that_the_formula_misses(evidence):
    calls = []
    rendering = rendering_of(evidence, calls)
    fitters = Fitters.of(evidence, scan_observations(evidence.train))
    base = fit_base(evidence, fitters, Model(), THRESHOLDS)
    [proposed] = ExpectedImageChannel(fitters, base, THRESHOLDS, workers=1).explain([glow])
    refined = refined_by_rendering(fitters.train, proposed, rendering)
    assert abs(proposed.parameters["amount"].value - TRUTH) > 0.1 * TRUTH
    assert refined.parameters["amount"].value == pytest.approx(TRUTH, rel=0.03)
    assert refined.chi2 < 0.2 * proposed.chi2 and refined.effect.id == "glow"
    assert calls.count(("train", None)) <= 7  # the base, then the effect and one step of it in each of three rounds
    assert calls.count(("train", 0)) == calls.count(("train", 1)) == 2  # the base and the last, whole
    assert not any(split == "test" for split, _ in calls)
    neutral = refined.effect(Light.of(evidence.train[0].layers), evidence.train[0].view, amount=0.0)
    assert np.array_equal(neutral.ambient, evidence.train[0].layers.ambient)
    test = fitters.test.residuals(refined.solution)  # where they are asked for, test frames are rendered, too
    assert max(np.abs(row.residual).max() for row in test) < 0.5
    assert calls.count(("test", 0)) == calls.count(("test", 1)) == 2


def test_a_search_by_small_steps_ends_with_what_its_rounds_reached(evidence):
    [amount] = glow.parameters
    careful = replace(glow, parameters=(replace(amount, slope_step=0.01),))
    fitters = Fitters.of(evidence, scan_observations(evidence.train))
    base = fit_base(evidence, fitters, Model(), THRESHOLDS)
    [proposed] = ExpectedImageChannel(fitters, base, THRESHOLDS, workers=1).explain([careful])
    refined = refined_by_rendering(fitters.train, proposed, rendering_of(evidence, []))
    found, start = refined.parameters["amount"].value, proposed.parameters["amount"].value
    assert abs(found - TRUTH) < abs(start - TRUTH) and refined.chi2 < proposed.chi2


def test_a_draft_that_leaves_too_much_is_rendered_no_further(evidence):
    calls = []
    fitters = Fitters.of(evidence, scan_observations(evidence.train))
    base = fit_base(evidence, fitters, Model(), THRESHOLDS)
    [proposed] = ExpectedImageChannel(fitters, base, THRESHOLDS, workers=1).explain([glow])
    drafted = refined_by_rendering(fitters.train, proposed, rendering_of(evidence, calls), worth_chi2=0.0)
    assert calls == [("train", None)] * 3  # without the effect, with it, and one step of it
    assert drafted.chi2 < proposed.chi2


def test_test_frames_are_rendered_before_threads_start(evidence):
    """A cached property has no lock since Python 3.12: threads that render meet inside of the scene."""
    threads = set()
    quiet = rendering_of(evidence, [])

    def rendering(model, split, half=None):
        threads.add(threading.current_thread())
        return quiet(model, split, half)

    fitters = Fitters.of(evidence, scan_observations(evidence.train), threads=4)
    base = fit_base(evidence, fitters, Model(), THRESHOLDS)
    [proposed] = ExpectedImageChannel(fitters, base, THRESHOLDS, workers=1).explain([glow])
    refined = refined_by_rendering(fitters.train, proposed, rendering)
    fitters.test.residuals(refined.solution)
    assert threads == {threading.current_thread()}
