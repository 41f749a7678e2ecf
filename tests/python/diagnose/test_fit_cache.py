# SPDX-License-Identifier: Apache-2.0
"""Fits that are kept: a second diagnosis repeats none, and none of them outlives what decided it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.effects import Effect, Model, builtin
from activestereo.compare.cache import LayerCache
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.gather import gather
from activestereo.diagnose.fitter import ParameterSpace, Solution
from activestereo.diagnose.kept import FitCache, content_key, effect_content
from activestereo.diagnose.fitter import Fitter
from activestereo.compare.render import render_frames
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world

FADING = builtin()["vignetting"]
OF_A_USER = replace(FADING, apply=lambda image, view, **values: FADING.apply(image, view, **values))


@pytest.fixture(scope="module")
def evidence(tmp_path_factory: pytest.TempPathFactory) -> Evidence:
    folder = tmp_path_factory.mktemp("world")
    world = make_world(folder, grid=1)
    capture = read_capture(world.capture_path)
    return gather(capture, render_frames(capture, WorldRenderer(world), cache=LayerCache(folder / "cache")))


def fitted(evidence: Evidence, renders: Path, effect: Effect = FADING) -> Solution:
    """A fit, by what is kept in a folder."""
    memory = FitCache(LayerCache(renders), evidence.train)
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles, memory=memory)
    space, phi = ParameterSpace.of(Model(), effect), fitter.phi0(evidence.nuisances)
    solution = fitter.refine(space, np.array([0.1]), phi, 2)
    memory.save()
    return solution


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The fits that are made again."""
    done: list[str] = []
    own = Fitter._refined
    monkeypatch.setattr(Fitter, "_refined", lambda *given: (done.append("_refined"), own(*given))[1])
    return done


def test_a_second_diagnosis_repeats_no_fit(evidence: Evidence, tmp_path: Path, work: list[str]) -> None:
    first = fitted(evidence, tmp_path)
    assert work == ["_refined"]
    work.clear()
    again = fitted(evidence, tmp_path)
    assert not work
    one, other = first.sums.as_arrays(), again.sums.as_arrays()
    assert one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)
    assert np.array_equal(first.theta, again.theta) and np.array_equal(first.phi, again.phi)
    assert first.sums.block_moment.keys() == again.sums.block_moment.keys() and first.sums.block_moment


def test_one_other_pixel_makes_all_fits_anew(evidence: Evidence, tmp_path: Path, work: list[str]) -> None:
    fitted(evidence, tmp_path)
    work.clear()
    measured = evidence.train[-1].measured.copy()
    measured[0, 0] += 1.0
    other = (*evidence.train[:-1], replace(evidence.train[-1], measured=measured))
    fitted(replace(evidence, train=other), tmp_path)
    assert "_refined" in work


def test_fits_with_an_effect_of_a_users_own_are_not_kept(evidence: Evidence, tmp_path: Path, work: list[str]) -> None:
    assert effect_content(FADING) == "vignetting" and effect_content(OF_A_USER) is None
    for _ in range(2):
        fitted(evidence, tmp_path, OF_A_USER)
    assert work.count("_refined") == 2 and not list(tmp_path.iterdir())


def test_keys_are_of_content_alone() -> None:
    values = {"a": [np.arange(3), 0.1]}
    assert content_key(values) == content_key({"a": [np.arange(3), 0.1]})
    others = {"a": [np.arange(3.0), 0.1]}, {"a": [np.arange(3), 0.2]}, {"b": [np.arange(3), 0.1]}, {"a": [np.arange(3)]}
    assert len({content_key(values), *map(content_key, others)}) == 5
    assert content_key(Path("here")) == content_key(Path("there"))  # the same capture in another folder
