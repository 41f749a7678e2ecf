# SPDX-License-Identifier: Apache-2.0
"""Noise variances and weights are made without what a found effect adds in the dark or between repeats."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from activestereo.capture.capture import SIDES, Capture, Frame, read_capture
from activestereo.effects import Model, View, builtin
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.gather import gather
from activestereo.diagnose.fitter import ImageResidual
from activestereo.diagnose.gather import weighed_again
from activestereo.compare.nuisances import Nuisances
from activestereo.compare.render import render_frames
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world

SCALES = Nuisances(9.0e4, 3.0e3, 4.0)
READ_DN = 1.5
WARMING = Model().with_effect(builtin()["black_level"], per_k_dn=0.5)

Images = dict[tuple[int, str], np.ndarray]


@dataclass(frozen=True)
class Exposed(Capture):
    """A capture whose images were never written."""

    images: Images = field(default_factory=dict)

    def ir(self, frame: Frame, side: str) -> np.ndarray:
        return self.images[frame.id, side]


class _NoCache:
    def get(self, key: str) -> None:
        return None

    def put(self, key: str, layers: object) -> None:
        pass


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
    layers = render_frames(capture, WorldRenderer(world), cache=_NoCache())
    rng, images, true, steady = np.random.default_rng(4), {}, {}, {}
    for frame in capture.frames:
        for side in SIDES:
            light = layers[frame.id][side]
            view = View.of(capture, frame, side, light)
            true[frame.id, side] = WARMING.signal(WARMING.light(light, view), view, SCALES)
            steady[frame.id, side] = Model().signal(Model().light(light, view), view, SCALES)
            noise = READ_DN * rng.standard_normal(view.shape)
            images[frame.id, side] = np.clip(np.rint(true[frame.id, side] + noise), 0, 255).astype(np.float32)
    return gather(Exposed(**vars(capture), images=images), layers), true, steady


def weighed(evidence: Evidence, model: Model, expected: Images) -> Evidence:
    rows = [ImageResidual(o, expected[o.key], o.measured, o.measured - expected[o.key]) for o in evidence.train]
    return weighed_again(evidence, model, SCALES.black_dn, rows)


def test_the_floor_is_that_of_the_noise_alone(warming: tuple[Evidence, Images, Images]) -> None:
    evidence, true, _ = warming
    found = weighed(evidence, WARMING, true)
    assert evidence.noise_variances[0, "left"] > 4.0 * READ_DN**2
    assert found.noise_variances[0, "left"] == pytest.approx(READ_DN**2 + 1 / 12, rel=0.1)
    for before, after in zip(evidence.train, found.train, strict=True):
        assert after.weight.mean() > 2.0 * before.weight.mean()


def test_what_explains_no_difference_of_repeats_leaves_the_floor(warming: tuple[Evidence, Images, Images]) -> None:
    evidence, _, steady = warming
    assert weighed(evidence, Model(), steady).noise_variances == pytest.approx(evidence.noise_variances, rel=1e-4)
