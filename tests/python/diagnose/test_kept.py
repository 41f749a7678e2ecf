# SPDX-License-Identifier: Apache-2.0
"""Fits that are kept: a second diagnosis repeats none, none outlives what decided it, and those made ahead in processes
are there afterwards."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from activestereo.capture.capture import read_capture
from activestereo.common.processes import forked
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import render_frames
from activestereo.diagnose import dictionary
from activestereo.diagnose.dictionary import Atom
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.selection import first_words
from activestereo.diagnose.fitter import Fitter, ParameterSpace, Solution
from activestereo.diagnose.gather import gather
from activestereo.diagnose.kept import FitCache, content_key, effect_content
from activestereo.diagnose.linear import Linear
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.refit import _Rendered
from activestereo.diagnose.search import Search
from activestereo.diagnose.settings import Settings
from activestereo.effects import Effect, Model, builtin
from activestereo.effects.core.descriptor import StartImage
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


def test_a_first_guess_leaves_out_what_takes_long_to_start(evidence: Evidence, tmp_path: Path) -> None:
    def slow(images: list[StartImage]) -> list[dict[str, float]]:
        raise AssertionError("a first guess waits for starting values")

    late = replace(builtin()["room_projector"], starts=slow)
    words = first_words(evidence, Model(), [late], NUMBERS, FitCache(LayerCache(tmp_path), evidence.train))
    assert late.starts_late and words.startswith("no effect of images fits")


def test_the_search_scores_image_changes_of_the_first_words_again(
    evidence: Evidence, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a geometry search has found since how badly the model fits. First each effect has one shape."""
    made: list[list[tuple[str, str]]] = []
    own = dictionary._compute_columns

    def computed(linear: Linear, atoms: list[Atom]) -> NDArray[np.float16]:
        made.append([(a.effect.id, str(a.values)) for a in atoms])
        return own(linear, atoms)

    monkeypatch.setattr(dictionary, "_compute_columns", computed)
    effects = [builtin()[name] for name in ("vignetting", "veiling_glare", "lens_psf")]
    memory = FitCache(LayerCache(tmp_path), evidence.train)
    assert first_words(evidence, Model(), effects, NUMBERS, memory)
    searched = replace(evidence, geometry=replace(evidence.geometry, misfit=3.0))
    Search(searched, Model(), effects, Settings(memory=memory)).run()
    [of_words, more, *_] = made
    assert {name for name, _ in of_words} == {effect.id for effect in effects}
    assert len(of_words) == len(set(of_words)) and not set(of_words) & set(more)


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


def test_rendered_images_of_an_effect_are_known_by_all_their_pixels() -> None:
    """An array's text leaves out its middle."""
    images = [{(0, "left"): np.zeros((3, 40, 40), np.float32)} for _ in range(3)]
    images[2][0, "left"][1, 20, 20] = 1.0
    haze = builtin()["haze"]
    known, same, other = (
        effect_content(replace(haze, apply=_Rendered(haze, np.zeros(1), change, ()).apply)) for change in images
    )
    assert known == same != other and known is not None and len(known) < 100


def test_keys_are_of_content_alone() -> None:
    values = {"a": [np.arange(3), 0.1]}
    assert content_key(values) == content_key({"a": [np.arange(3), 0.1]})
    others = {"a": [np.arange(3.0), 0.1]}, {"a": [np.arange(3), 0.2]}, {"b": [np.arange(3), 0.1]}, {"a": [np.arange(3)]}
    assert len({content_key(values), *map(content_key, others)}) == 5
    assert content_key(Path("here")) == content_key(Path("there"))  # the same capture in another folder


@pytest.fixture
def memory(tmp_path: Path) -> FitCache:
    return FitCache(LayerCache(tmp_path), [], workers=2)


class Squares:
    """work(n) asks for the fit of n; `made` counts the fits of this process."""

    def __init__(self, memory: FitCache) -> None:
        self.memory, self.made, self.own = memory, 0, os.getpid()

    def __call__(self, n: int) -> float:
        return float(self.memory.once(f"square {n}", lambda: self._made(n))["value"])

    def _made(self, n: int) -> dict[str, np.ndarray]:
        self.made += 1
        return {"value": np.array(n * n)}


def test_fits_come_back_from_their_processes(memory: FitCache) -> None:
    squares = Squares(memory)
    memory.make_ahead(squares, [3, 4, 5])
    assert [squares(n) for n in (3, 4, 5)] == [9.0, 16.0, 25.0] and squares.made == 0
    assert squares(6) == 36.0 and squares.made == 1


def test_one_worker_leaves_all_to_the_caller(memory: FitCache) -> None:
    assert list(forked(Squares(memory), [3, 4], 1)) == list(forked(Squares(memory), [3], 2)) == []


def test_what_fails_or_dies_in_a_process_is_left_to_the_caller(memory: FitCache) -> None:
    squares = Squares(memory)

    def failing(n: int) -> float:
        if n == 4:
            raise ValueError("four")
        return squares(n)

    memory.make_ahead(failing, [3, 4, 5])
    assert [squares(n) for n in (3, 5)] == [9.0, 25.0] and squares.made == 0

    def dying(n: int) -> float:
        if n == 7 and os.getpid() != squares.own:
            os._exit(1)
        return squares(n)

    memory.make_ahead(dying, [7, 7, 7])
    assert squares(7) == 49.0 and squares.made == 1
