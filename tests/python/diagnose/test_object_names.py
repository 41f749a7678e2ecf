# SPDX-License-Identifier: Apache-2.0
"""All that may be so of one object's surface is compared: what it is comes first, or is told to fit as well."""

from dataclasses import replace

import numpy as np
import pytest

from lab_worlds import WorldRenderer
from report_worlds import DIAGNOSIS
from activestereo.capture.capture import read_capture
from activestereo.compare.nuisances import Nuisances
from activestereo.compare.render import render_frames
from activestereo.compare.where_channels import surface_text
from activestereo.diagnose.base_fit import fit_base
from activestereo.diagnose.evidence import gather
from activestereo.diagnose.object_names import _explanation, object_json, rank_object
from activestereo.diagnose.propose.scan import scan_observations
from activestereo.diagnose.rank import DiagnosisContext, scored
from activestereo.diagnose.refine import Fitters
from activestereo.diagnose.thresholds import THRESHOLDS
from activestereo.effects import Light, Model, broken_laws, builtin
from activestereo.effects.core.laws import example_view, example_value
from activestereo.effects.core.descriptor import Stage
from activestereo.effects.core.object_rivals import RIVALS
from activestereo.effects.core.surfaces import MOST_MATERIALS
from activestereo.report.diagnosis import diagnosis_sections
from activestereo.report.diagnosis_text import diagnosis_text

LIGHT = Nuisances(9.0e4, 3.0e3, 4.0)
EFFECTS = builtin() | {e.id: e for e in RIVALS}
BARE = DIAGNOSIS | {"ranking": []}
OWN = [builtin()[name] for name in ("specular", "transmission", "subsurface")]


@pytest.fixture(scope="module")
def evidence(lab_world, lab_cache):
    capture = read_capture(lab_world.capture_path)
    return gather(capture, render_frames(capture, WorldRenderer(lab_world, grid=3), cache=lab_cache))


def ranked(evidence, name, material, **values):
    """(the ranking of one object that shows an effect, its context)."""
    model = Model().with_effect(EFFECTS[name], surfaces=2.0**material, **values)

    def shown(o):
        rng = np.random.default_rng([o.frame.id, o.side == "left"])
        clean = model.signal(model.light(o.layers, o.view), o.view, LIGHT)
        return replace(o, measured=(clean + rng.standard_normal(clean.shape)).astype(np.float32))

    evidence = replace(evidence, train=tuple(map(shown, evidence.train)))
    fitters = Fitters.of(evidence, scan_observations(evidence.train))
    context, base = DiagnosisContext(evidence, fitters, THRESHOLDS, 1), fit_base(evidence, fitters, Model(), THRESHOLDS)
    first = scored(context, base, [_explanation(context, base, builtin()["specular"], 2.0**material)])
    return rank_object(context, first, OWN), context


@pytest.mark.parametrize(
    "name, values",
    [("specular", {"factor": 1.0, "roughness": 0.4}), ("metal", {"fraction": 0.8}), ("albedo", {"change": -0.4})],
)
def test_an_object_s_own_name_comes_first_or_is_as_good(evidence, name, values):
    seen = evidence.train[0].view.material
    material = int(np.argmax(np.bincount(seen[seen < MOST_MATERIALS])))
    ranking, context = ranked(evidence, name, material, **values)
    assert {f.id for f in ranking.findings} == {e.id for e in (*OWN, *RIVALS)}
    name_of = surface_text(evidence.capture.scene_path)
    told = object_json(ranking, context, name_of)
    assert name in {told["names"][0]["effect"], *told["equivalent"]}
    assert told["materials"] == [name_of(material)] and not told["rendered"]
    assert told["text"].startswith(f"on {name_of(material)} ")
    assert ("as much" in told["text"]) == bool(told["equivalent"])
    assert told["text"] in diagnosis_text(BARE | {"objects": [told]})
    assert told["names"][0]["finding"] in diagnosis_sections(BARE | {"objects": [told]})[1]


def test_an_effect_that_chooses_no_surface_has_no_object(evidence):
    fitters = Fitters.of(evidence, scan_observations(evidence.train))
    context = DiagnosisContext(evidence, fitters, THRESHOLDS, 1)
    base = fit_base(evidence, fitters, Model(), THRESHOLDS)
    assert rank_object(context, scored(context, base, []), OWN) is None


@pytest.mark.parametrize("effect", RIVALS, ids=lambda e: e.id)
def test_rivals_obey_the_laws_of_effects(effect):
    assert broken_laws(effect) == []


def test_a_whole_metal_keeps_no_diffuse_light_and_a_darker_surface_all_of_its_dots():
    view = example_view("left")
    light: Light = example_value(Stage.SURFACE, view)
    metal, albedo = RIVALS[1], RIVALS[0]
    half = metal(light, view, fraction=0.5, roughness=0.3)
    whole = metal(light, view, fraction=1.0, roughness=0.3)
    np.testing.assert_allclose(half.direct, 0.5 * (light.direct + whole.direct))
    mirror_less = metal(light, view, fraction=1.0, roughness=1.0)
    assert whole.direct.max() > 2.0 * mirror_less.direct.max()  # a smooth metal gathers its light in a highlight
    np.testing.assert_allclose(albedo(light, view, change=-0.3).direct, 0.7 * light.direct)
