# SPDX-License-Identifier: Apache-2.0
"""The next measurement: an exposure for which a rival's parameters can make up separates nothing."""

from dataclasses import replace

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import WARP_SCALE, render_frames
from activestereo.diagnose.evidence import one_of_each_situation
from activestereo.diagnose.fitter import Fitter, ParameterSpace
from activestereo.diagnose.gather import gather
from activestereo.diagnose.linear import fitted_model
from activestereo.diagnose.next_measurement import _MENU, _changed, left_between
from activestereo.effects import Model, builtin
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """Evidence of a world that hides nothing, and a fit of lens shading to it."""
    folder = tmp_path_factory.mktemp("world")
    world = make_world(folder, grid=4)
    capture = read_capture(world.capture_path)
    evidence = gather(
        capture, render_frames(capture, WorldRenderer(world), 32, 8, 0, LayerCache(folder / "cache"), None, WARP_SCALE)
    )
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    phi = fitted_model(fitter, Model(), fitter.phi0(evidence.nuisances)).phi
    return evidence, fitter.refine(ParameterSpace.of(Model(), builtin()["vignetting"]), np.array([0.5]), phi, 0)


def test_a_rival_that_can_be_refitted_is_no_rival(fitted):
    evidence, rival = fitted
    frames = one_of_each_situation(evidence.train)
    truth = replace(rival, theta=rival.theta + 0.2)
    nothing = replace(rival.sums, gram=np.zeros_like(rival.sums.gram))
    far = replace(rival.sums, gram=1e9 * rival.sums.gram)
    left = [
        left_between(evidence, frames, truth, replace(rival, sums=sums), 1.0) for sums in (nothing, rival.sums, far)
    ]
    assert left[0] < 0.05 * left[2]
    assert left[0] < left[1] < left[2]
    assert left_between(evidence, frames, rival, rival, 1.0) == pytest.approx(0.0, abs=1e-6)


def test_the_menu_tells_a_laser_from_a_filter_that_dim_alike_where_it_is_warmer(fitted):
    """A filter passes less on either side of its wavelength; a laser brightens where it is cooler."""
    evidence, _ = fitted
    o, effects = evidence.train[0], builtin()
    laser = Model().with_effect(effects["laser_power_drift"], per_k=-0.01)
    filtered = Model().with_effect(effects["chromatic_drift"], transmission_per_k=np.expm1(-0.2) / 20.0)

    def apart(change):
        view = replace(o.view, frame=_changed(o.frame, change))
        a, b = (model.light(o.layers, view, supersampled=False).direct.sum() for model in (laser, filtered))
        return abs(a / b - 1.0)

    assert apart({"warming_k": 20.0}) < 0.01
    assert max(apart(change) for change in _MENU.values()) > 0.1
