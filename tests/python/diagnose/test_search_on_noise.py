# SPDX-License-Identifier: Apache-2.0
"""Parameters and scales that a search reports: no bias by weights that have seen the noise, and no name where two fit
alike."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from lab_worlds import WorldRenderer
from activestereo.capture.capture import SIDES, Capture, read_capture
from activestereo.effects import Model, View, builtin
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.ranking import parameters_of
from activestereo.diagnose.gather import gather
from activestereo.diagnose.search import Search
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


def searched(evidence, *names):
    return Search(evidence, Model(), [builtin()[name] for name in names]).run()


@pytest.fixture(scope="module")
def found(table):
    return searched(evidence_of(table, Model().with_effect(DRIFT, per_k=PER_K)), DRIFT.id, "chromatic_drift")


def assert_true_scales(nuisances):
    assert nuisances.projector_scale == pytest.approx(SCALES.projector_scale, rel=0.004)
    assert nuisances.ambient_scale == pytest.approx(SCALES.ambient_scale, rel=0.01)


def test_scales_are_not_pulled_down_by_bright_grains(table):
    outcome = searched(evidence_of(table, Model()), DRIFT.id)
    assert not outcome.names
    assert_true_scales(outcome.first.nuisances)


def test_nor_are_they_beside_an_effect(found):
    assert_true_scales(found.solution.nuisances)


def test_a_parameter_has_its_truth_in_its_interval_and_one_that_is_not_at_work_its_neutral_value(found):
    parameters = parameters_of(found, found.names[0])
    rate, slope = parameters["per_k"], parameters["per_s"]
    assert slope.low < 0.0 < slope.high
    assert rate.value == pytest.approx(PER_K, rel=0.03) and rate.low < PER_K < rate.high


def test_what_the_data_cannot_tell_apart_is_a_set_and_the_likelier_is_first(found):
    """A filter that drifts dims dots in a warm rig as a laser does; a laser's drift of this size is the likelier."""
    assert [list(name.members) for name in found.names] == [["laser_power_drift", "chromatic_drift"]]
