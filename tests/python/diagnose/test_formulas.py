# SPDX-License-Identifier: Apache-2.0
"""The part of a named effect that a formula misses is no other effect's gain."""

from dataclasses import replace

import pytest

from activestereo.capture.capture import read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import render_frames
from activestereo.diagnose.evidence import gather
from activestereo.diagnose.refine import Fitter, ParameterSpace
from activestereo.diagnose.search.formulas import freed, gain_beyond
from activestereo.diagnose.search.linear import linearised
from activestereo.effects import Light, Model, Parameter, Stage, builtin, effect
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world

NAMED = builtin()["vignetting"]


@effect(
    "dark_corners",
    stage=Stage.OPTICS,
    family="f",
    source="s",
    parameters=[Parameter("amount", "1", neutral=0.0, low=0.0, high=0.5, typical=0.1)],
)
def dark_corners(image, view, amount):
    """The corners alone are darker."""
    u, v = view.field()
    return image * (1.0 - amount * ((u**2 + v**2) / 2) ** 2)


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """A world without noise."""
    folder = tmp_path_factory.mktemp("world")
    world = make_world(folder, grid=4)
    capture = read_capture(world.capture_path)
    return gather(capture, render_frames(capture, WorldRenderer(world), cache=LayerCache(folder / "cache")))


def seen(clean, falloff, gain):
    """Images that fall off to their corners by 1 - 0.3 (r^2 + falloff r^4), of a right camera with another gain."""

    def exposed(o):
        u, v = o.view.field()
        square = (u**2 + v**2) / 2
        dn = Model().signal(Light.of(o.layers), o.view, clean.nuisances) - clean.nuisances.black_dn
        dn = dn * (1.0 - 0.3 * (square + falloff * square**2)) * (1.0 + gain * o.view.is_right)
        return replace(o, measured=(dn + clean.nuisances.black_dn).astype("float32"))

    return replace(clean, train=tuple(map(exposed, clean.train)))


@pytest.mark.parametrize(
    "falloff, gain, second, low, high",
    [(0.6, 0.0, dark_corners, 0.0, 0.3), (0.0, 0.1, builtin()["gain_mismatch"], 0.7, 1.1)],
    ids=["the formula's own error", "another effect"],
)
def test_a_further_name_explains_what_the_formula_of_the_first_cannot_look_like(
    clean, falloff, gain, second, low, high
):
    evidence = seen(clean, falloff, gain)
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    first = ParameterSpace.of(Model(), NAMED)
    named = fitter.refine(first, first.start + 0.5, fitter.phi0(evidence.nuisances), 6)
    space = ParameterSpace.of(named.model, second)
    start = space.start.copy()
    start[len(named.theta)] += 0.05
    fit = fitter.refine(space, start, named.phi, 6)
    beyond = gain_beyond(freed(linearised(fitter, named), [NAMED], 0.035), fit)
    assert low <= beyond / (named.sums.total - fit.sums.total) <= high
