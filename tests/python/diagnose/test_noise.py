# SPDX-License-Identifier: Apache-2.0
"""Noise and weights: no bias by weights that have seen the noise, no name where two fit alike, and no part of a found
effect in the floor."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from activestereo.capture.capture import SIDES, Capture, Frame, read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.nuisances import Nuisances
from activestereo.compare.noise import NoiseModel
from activestereo.compare.render import render_frames
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.fitter import ImageResidual
from activestereo.diagnose.gather import gather, weighed_again
from activestereo.diagnose.ranking import parameters_of
from activestereo.diagnose.search import Search
from activestereo.effects import Model, View, builtin
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world

SCALES = Nuisances(9.0e4, 3.0e3, 4.0)
SPECKLE, READ_DN = 0.15, 1.0
PER_K = -0.01
DRIFT = builtin()["laser_power_drift"]
DRIFT_READ_DN = 1.5
WARMING = Model().with_effect(builtin()["black_level"], per_k_dn=0.5)
Images = dict[tuple[int, str], np.ndarray]


@dataclass(frozen=True)
class Exposed(Capture):
    """A capture whose images were never written."""

    images: dict[tuple[int, str], np.ndarray] = field(default_factory=dict)

    def ir(self, frame: Frame, side: str) -> np.ndarray:
        return self.images[frame.id, side]


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """(capture, layers): one pose, two frames repeat, the others do not; without projector, and warm."""
    world = make_world(tmp_path_factory.mktemp("world"))
    capture = read_capture(world.capture_path)
    base = replace(capture.frames[0], repeat_group=None, temperature_c=25.0, split="train", depth_path=None)
    repeat = {"repeat_group": 0}
    plan = [repeat, repeat, {"projector_power": 0.0}, {"temperature_c": 45.0}, {"temperature_c": 35.0}, {}]
    frames = (replace(base, id=i, timestamp_s=2.0 * i, **changes) for i, changes in enumerate(plan))
    capture = replace(capture, frames=tuple(frames))
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


def test_an_effect_leaves_the_scales_and_the_likelier_of_two_alike_is_first_with_its_parameters(found):
    """A filter that drifts dims dots in a warm rig as a laser does; a laser's drift of this size is the likelier. One
    parameter has its truth in its interval, and one that is not at work its neutral value."""
    assert_true_scales(found.solution.nuisances)
    assert [list(name.members) for name in found.names] == [["laser_power_drift", "chromatic_drift"]]
    parameters = parameters_of(found, found.names[0])
    rate, slope = parameters["per_k"], parameters["per_s"]
    assert slope.low < 0.0 < slope.high
    assert rate.value == pytest.approx(PER_K, rel=0.03) and rate.low < PER_K < rate.high


@pytest.fixture(scope="module")
def warming(tmp_path_factory: pytest.TempPathFactory) -> tuple[Evidence, Images, Images]:
    """(evidence of repeats whose black level grows, expected images under the true model, those without the growth)."""
    folder: Path = tmp_path_factory.mktemp("world")
    world = make_world(folder, size=(96, 56))
    capture = read_capture(world.capture_path)
    base = replace(capture.frames[0], repeat_group=0, split="train", depth_path=None)
    frames = tuple(replace(base, id=i, timestamp_s=2.0 * i, temperature_c=t) for i, t in enumerate((25.0, 33.0, 41.0)))
    frames = (*frames, replace(base, id=3, timestamp_s=8.0, repeat_group=None, split="test"))
    capture = replace(capture, frames=frames)
    layers = render_frames(capture, WorldRenderer(world), cache=LayerCache(folder / "cache"))
    rng, images, true, steady = np.random.default_rng(4), {}, {}, {}
    for frame in capture.frames:
        for side in SIDES:
            light = layers[frame.id][side]
            view = View.of(capture, frame, side, light)
            true[frame.id, side] = WARMING.signal(WARMING.light(light, view), view, SCALES)
            steady[frame.id, side] = Model().signal(Model().light(light, view), view, SCALES)
            noise = DRIFT_READ_DN * rng.standard_normal(view.shape)
            images[frame.id, side] = np.clip(np.rint(true[frame.id, side] + noise), 0, 255).astype(np.float32)
    return gather(Exposed(**vars(capture), images=images), layers), true, steady


def weighed(evidence: Evidence, model: Model, expected: Images) -> Evidence:
    rows = [ImageResidual(o, expected[o.key], o.measured, o.measured - expected[o.key]) for o in evidence.train]
    return weighed_again(evidence, model, SCALES.black_dn, rows)


def test_the_floor_is_that_of_the_noise_alone(warming: tuple[Evidence, Images, Images]) -> None:
    evidence, true, steady = warming
    found = weighed(evidence, WARMING, true)
    assert evidence.noise_variances[0, "left"] > 4.0 * DRIFT_READ_DN**2
    assert found.noise_variances[0, "left"] == pytest.approx(DRIFT_READ_DN**2 + 1 / 12, rel=0.1)
    for before, after in zip(evidence.train, found.train, strict=True):
        assert after.weight.mean() > 2.0 * before.weight.mean()
    unexplained = weighed(evidence, Model(), steady)  # no difference of repeats
    assert unexplained.noise_variances == pytest.approx(evidence.noise_variances, rel=1e-4)


def test_a_black_level_below_zero_is_no_dark_signal(warming: tuple[Evidence, Images, Images]) -> None:
    """Digital numbers end at 0, so that without light they differ from such a black level."""
    evidence, true, _ = warming
    evidence = replace(evidence, has_floor=False, noise_model=NoiseModel(1.0, 0.1, 0.0, black_dn=0.0))
    rows = [ImageResidual(o, true[o.key], o.measured, o.measured - true[o.key]) for o in evidence.train]
    below, at_zero = (weighed_again(evidence, Model(), black_dn, rows) for black_dn in (-3.0, 0.0))
    for one, other in zip(below.train, at_zero.train, strict=True):
        np.testing.assert_array_equal(one.weight, other.weight)
