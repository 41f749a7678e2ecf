# SPDX-License-Identifier: Apache-2.0
"""An image function only proposes: the engine's images, which follow another formula, decide an effect's parameters."""

from dataclasses import replace

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.effects import Light, Model, Parameter, Stage, effect
from activestereo.compare.cache import LayerCache
from activestereo.effects.core.view import Layers
from activestereo.diagnose.gather import gather
from activestereo.diagnose.fitter import Fitter
from activestereo.diagnose.fitter import ParameterSpace
from activestereo.diagnose.refit import fitted_to_renders
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
    """The engine; calls gets the amount of each."""

    def rendering(model):
        amount = model.effects[0][1]["amount"] if model.effects else 0.0
        calls.append(amount)
        lights = {o.key: brightened(Light.of(o.layers), o.view, amount, engine_law) for o in evidence.train}
        return {key: light.images[:3].astype(np.float32) for key, light in lights.items()}

    return rendering


def proposed_by(evidence, effect):
    """(the fitter, the fit of the image function)."""
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    space = ParameterSpace.of(Model(), effect)
    return fitter, fitter.refine(space, np.array([0.3]), fitter.phi0(evidence.nuisances), 6)


def test_the_engines_images_find_the_parameter_that_the_formula_misses(evidence):
    calls = []
    fitter, proposed = proposed_by(evidence, glow)
    refined = fitted_to_renders(fitter, proposed, rendering_of(evidence, calls))
    assert abs(proposed.theta[0] - TRUTH) > 0.5 * TRUTH
    assert refined.theta[0] == pytest.approx(TRUTH, rel=0.1)
    assert refined.sums.total < 0.2 * proposed.sums.total and refined.effects[-1].id == "glow"
    assert len(calls) <= 5  # without it, then it and one step of it in each of two rounds
    o = evidence.train[0]
    neutral = refined.effects[-1](Light.of(o.layers), o.view, amount=0.0)
    assert np.array_equal(neutral.ambient, o.layers.ambient)


def test_a_search_by_small_steps_ends_with_what_its_rounds_reached(evidence):
    [amount] = glow.parameters
    careful = replace(glow, parameters=(replace(amount, slope_step=0.01),))
    fitter, proposed = proposed_by(evidence, careful)
    refined = fitted_to_renders(fitter, proposed, rendering_of(evidence, []))
    assert abs(refined.theta[0] - TRUTH) < abs(proposed.theta[0] - TRUTH)
    assert refined.sums.total < proposed.sums.total


def test_a_fit_to_images_that_are_no_better_is_the_formulas(evidence):
    fitter, proposed = proposed_by(evidence, glow)
    dark = rendering_of(replace(evidence, train=tuple(replace(o, layers=dimmed(o.layers)) for o in evidence.train)), [])
    assert fitted_to_renders(fitter, proposed, dark) is proposed


def dimmed(layers):
    """Layers without ambient light: the engine sees nothing of the effect."""
    return Layers(layers.direct, layers.indirect, 0.0 * layers.ambient, layers.flat, layers.depth_m, layers.normal,
                  layers.material)  # fmt: skip
