# SPDX-License-Identifier: Apache-2.0
"""Parameters that a diagnosis reports: no bias by weights that have seen the noise, no value where it costs nothing to
leave it out."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from lab_worlds import WorldRenderer
from activestereo.capture.capture import SIDES, Capture, read_capture
from activestereo.effects import Model, View, builtin
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.base_fit import fit_base
from activestereo.diagnose.evidence import gather
from activestereo.diagnose.thresholds import THRESHOLDS
from activestereo.diagnose.propose.scan import scan_observations, starts
from activestereo.diagnose.rank import DiagnosisContext, rank, settled_first
from activestereo.diagnose.refine import Fitter, Fitters, ParameterSpace
from activestereo.compare.nuisances import Nuisances
from activestereo.compare.render import render_frames
from virtual_sensor.world import make_world

SCALES = Nuisances(9.0e4, 3.0e3, 4.0)
SPECKLE, READ_DN = 0.15, 1.0
PER_K = -0.01
DRIFT = builtin()["laser_power_drift"]


@dataclass(frozen=True)
class Exposed(Capture):
    """A capture whose images were never written."""

    images: dict = field(default_factory=dict)

    def ir(self, frame, side):
        return self.images[frame.id, side]


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """(capture, layers): one pose, two frames repeat, the others do not; without projector, and warm."""
    world = make_world(tmp_path_factory.mktemp("world"))
    capture = read_capture(world.capture_path)
    base = replace(capture.frames[0], repeat_group=None, temperature_c=25.0, split="train", depth_path=None)
    plan = [
        {"repeat_group": 0},
        {"repeat_group": 0},
        {"projector_power": 0.0},
        {"temperature_c": 45.0},
        {"temperature_c": 35.0},
        {},
    ]
    capture = replace(
        capture, frames=tuple(replace(base, id=i, timestamp_s=2.0 * i, **changes) for i, changes in enumerate(plan))
    )
    return capture, render_frames(capture, WorldRenderer(world), cache=LayerCache(tmp_path_factory.mktemp("cache")))


def evidence_of(table, hidden):
    """Evidence of the table seen by a hidden model, under speckle that boils."""
    capture, layers = table
    rng, images = np.random.default_rng(6), {}
    for frame in capture.frames:
        for side in SIDES:
            view = View.of(capture, frame, side, layers[frame.id][side])
            clean = hidden.signal(hidden.light(layers[frame.id][side], view), view, SCALES) - SCALES.black_dn
            noisy = clean * rng.gamma(SPECKLE**-2, SPECKLE**2, clean.shape) + READ_DN * rng.standard_normal(clean.shape)
            images[frame.id, side] = np.clip(np.rint(noisy + SCALES.black_dn), 0, 255).astype(np.float32)
    return gather(Exposed(**vars(capture), images=images), layers)


def ranked(evidence, candidates):
    """(DiagnosisContext, Ranking) of candidates on top of no effects."""
    context = DiagnosisContext(evidence, Fitters.of(evidence, scan_observations(evidence.train)), THRESHOLDS, workers=1)
    return context, rank(context, fit_base(evidence, context.fitters, Model(), THRESHOLDS), candidates)


@pytest.fixture(scope="module")
def found(table):
    ranking = ranked(evidence_of(table, Model().with_effect(DRIFT, per_k=PER_K)), [DRIFT])
    return settled_first(*ranking).best.explanation


def assert_true_scales(nuisances):
    assert nuisances.projector_scale == pytest.approx(SCALES.projector_scale, rel=0.004)
    assert nuisances.ambient_scale == pytest.approx(SCALES.ambient_scale, rel=0.01)


def test_scales_are_not_pulled_down_by_bright_grains(table):
    assert_true_scales(ranked(evidence_of(table, Model()), [])[1].base.solution.nuisances)


def test_nor_are_they_beside_an_effect(found):
    assert_true_scales(found.solution.nuisances)


def test_a_parameter_that_is_not_at_work_is_told_as_zero(found):
    rate, slope = found.parameters["per_k"], found.parameters["per_s"]
    assert slope.value == 0.0 and slope.low < 0.0 < slope.high
    assert rate.value == pytest.approx(PER_K, rel=0.03) and rate.low < PER_K < rate.high
    assert found.solution.model.effects[0][1]["per_s"] == 0.0


def test_what_the_data_cannot_tell_apart_goes_by_prior(table):
    """A filter that drifts dims dots in a warm rig as a laser does; a laser's drift of this size is the likelier."""
    evidence = evidence_of(table, Model().with_effect(DRIFT, per_k=PER_K))
    first, second = ranked(evidence, [builtin()["chromatic_drift"], DRIFT])[1].findings
    assert abs(first.score.nats - second.score.nats) < 3.0
    assert (first.id, second.id) == ("laser_power_drift", "chromatic_drift")


def test_a_second_effect_is_scanned_inside_its_range(table):
    """From a neutral focus to its nearest and back, rounding leaves the range."""
    evidence = evidence_of(table, Model())
    focus = builtin()["projector_defocus"]
    space = ParameterSpace.of(Model().with_effect(DRIFT, per_k=PER_K), focus)
    scan = Fitter(scan_observations(evidence.train), evidence.nuisance_prior(), evidence.tiles, supersampled=False)
    alone = np.array([1.0, focus.parameters[1].low])
    for start in starts(scan, space, focus, scan.phi0(evidence.nuisances), np.inf, alone):
        assert (space.low <= start.theta).all() and (start.theta <= space.high).all()
