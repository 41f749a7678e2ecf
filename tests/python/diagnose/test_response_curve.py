# SPDX-License-Identifier: Apache-2.0
"""A response that follows no power law: its formula finds it, a curve of any shape stands for it from then on."""

from dataclasses import replace

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import render_frames
from activestereo.diagnose.gather import gather
from activestereo.diagnose.fitter import Fitter
from activestereo.diagnose.fitter import ParameterSpace
from activestereo.diagnose.refit import refit_free_curve
from activestereo.effects import Light, Model, builtin
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world

CURVATURE = 8.0


@pytest.fixture(scope="module")
def evidence(tmp_path_factory):
    """A world without noise, seen by a sensor whose values grow with the logarithm of light."""
    folder = tmp_path_factory.mktemp("world")
    world = make_world(folder, grid=4)
    clean = gather(capture := read_capture(world.capture_path), render_frames(
        capture, WorldRenderer(world), cache=LayerCache(folder / "cache")))  # fmt: skip

    def exposed(o):
        black, full = clean.nuisances.black_dn, o.view.max_dn
        linear = Model().signal(Light.of(o.layers), o.view, clean.nuisances) - black
        curved = full * np.log1p(CURVATURE * np.maximum(linear, 0.0) / full) / np.log1p(CURVATURE)
        return replace(o, measured=(curved + black).astype(np.float32))

    return replace(clean, train=tuple(map(exposed, clean.train)))


def fitted(evidence, effect):
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    space = ParameterSpace.of(Model(), builtin().get(effect))
    return fitter, fitter.refine(space, space.start + 0.1, fitter.phi0(evidence.nuisances), 8)


def test_a_curve_of_any_shape_takes_what_the_formula_of_the_response_leaves(evidence):
    fitter, formula = fitted(evidence, "response_gamma")
    curve = refit_free_curve(fitter, formula)
    assert curve.sums.total < 0.2 * formula.sums.total
    assert curve.theta == pytest.approx(formula.theta, abs=0.05)
    dark = np.zeros((4, 4))
    (effect, _), view = curve.model.effects[0], evidence.train[0].view
    np.testing.assert_array_equal(effect.apply(dark, view, log_exponent=0.0), dark)


@pytest.mark.parametrize("effect", ["gain_mismatch", "none"])
def test_what_is_no_curve_of_values_keeps_its_fit(evidence, effect):
    fitter, formula = fitted(evidence, effect)
    assert refit_free_curve(fitter, formula) is formula
