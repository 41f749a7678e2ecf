# SPDX-License-Identifier: Apache-2.0
"""Materials that reflect another share of the light than the scene says are told, by name and number."""

from dataclasses import replace

import numpy as np
import pytest

from lab_worlds import WorldRenderer
from report_worlds import DIAGNOSIS
from activestereo.capture.capture import Uncertainty, read_capture
from activestereo.compare.nuisances import Nuisances, predict
from activestereo.compare.render import render_frames
from activestereo.diagnose.found_model import albedo_json, albedo_surfaces
from activestereo.diagnose.words import geometry_words, next_steps
from activestereo.diagnose.found_model import found_model
from activestereo.diagnose.gather import gather
from activestereo.diagnose.fitter import Fitter
from activestereo.diagnose.fitter import ParameterSpace
from activestereo.diagnose.pixels import DENSE
from activestereo.effects import Model, builtin
from activestereo.effects.core.surfaces import scene_surfaces

LIGHT = Nuisances(9.0e4, 3.0e3, 4.0)


@pytest.fixture(scope="module")
def evidence(lab_world, lab_cache):
    capture = read_capture(lab_world.capture_path)
    return gather(capture, render_frames(capture, WorldRenderer(lab_world, grid=3), cache=lab_cache))


def reflecting(evidence, factors):
    """The evidence of materials, by index, that reflect so many times what the scene says; and the fit to it."""
    train = []
    for o in evidence.train:
        gain = np.ones(o.measured.shape)
        for index, factor in factors.items():
            gain[o.material == index] = factor
        expected = predict(o.frame, o.layers, LIGHT, 255.0)
        measured = LIGHT.black_dn + gain * (expected - LIGHT.black_dn)
        train.append(replace(o, measured=measured.astype(np.float32)))
    evidence = replace(evidence, train=tuple(train))
    fitter, space = Fitter(train, evidence.nuisance_prior(), evidence.tiles), ParameterSpace.of(Model())
    return evidence, fitter, fitter.refine(space, space.start, fitter.phi0(LIGHT), 8)


def test_a_wrong_albedo_is_told_by_name_and_number(evidence):
    told = albedo_json(*reflecting(evidence, {0: 0.6}))
    surface = scene_surfaces(evidence.capture.scene_path)[albedo_surfaces(evidence)[0]]
    assert [entry["material"] for entry in told] == [surface.name]
    assert told[0]["factor"] == pytest.approx(0.6, abs=0.03)
    assert geometry_words({"albedos": told}) == [f"{told[0]['text'][0].upper()}{told[0]['text'][1:]}."]
    assert "the scene says" in told[0]["text"]


def test_the_largest_material_is_told_where_all_others_seem_wrong_alike(evidence):
    told = albedo_json(*reflecting(evidence, {-1: 1.5}))
    surface = scene_surfaces(evidence.capture.scene_path)[albedo_surfaces(evidence)[-1]]
    assert [entry["material"] for entry in told] == [surface.name]
    assert told[0]["factor"] == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize("factors, farthest, second", [({0: 0.7}, 10.0, 0.0), ({0: 0.7, 1: 0.7}, 10.0, 10.0)])
def test_a_second_wrong_albedo_is_told_apart_from_one(evidence, factors, farthest, second):
    _, fitter, solution = reflecting(evidence, factors)
    found = [fitter.albedo_sigmas(solution, 0.03, k) for k in (1, 2)]
    np.testing.assert_allclose(found, (farthest, second), atol=1.5)


def test_what_is_as_stated_is_not_told(evidence):
    assert albedo_json(*reflecting(evidence, {0: 1.05})) == []


def test_beside_gloss_an_albedo_is_another_quantity(evidence):
    evidence, fitter, solution = reflecting(evidence, {0: 0.6})
    space = ParameterSpace.of(Model(), builtin()["specular"])
    named = fitter.refine(space, space.start, solution.phi, 0)
    assert albedo_json(evidence, fitter, named) == []


@pytest.mark.parametrize("stated, impossible", [(0.01, True), (0.1, False)])
def test_a_stated_albedo_that_is_impossible_for_what_is_seen_is_told(evidence, stated, impossible):
    wrong, fitter, solution = reflecting(evidence, {0: 0.6})
    wrong = replace(wrong, capture=replace(wrong.capture, uncertainty=Uncertainty(albedo=stated)))
    [entry] = albedo_json(wrong, fitter, solution)
    assert entry["stated_sigmas"] == pytest.approx(0.4 / stated, rel=0.1)
    assert ("times its stated uncertainty" in entry["text"]) == impossible
    steps = next_steps(DIAGNOSIS | {"albedos": [entry]})
    assert any(step.startswith("Measure the albedos again, or state a larger") for step in steps) == impossible


def test_no_material_of_a_found_model_reflects_less_than_nothing(evidence):
    evidence, fitter, solution = reflecting(evidence, {0: 0.6})
    phi = solution.phi.copy()
    phi[DENSE] = -1.02
    solution = replace(solution, phi=phi)
    materials = found_model(evidence, Model(), solution, {}).materials
    assert min(fields["ir_albedo_factor"].value for fields in materials.values()) == 0.0
    assert min(entry["factor"] for entry in albedo_json(evidence, fitter, solution)) == 0.0
