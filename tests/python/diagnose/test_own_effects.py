# SPDX-License-Identifier: Apache-2.0
"""An effect of the user's own is always in the answer, with why it ranks where it does; and the report is written from
what the diagnosis has rendered."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import activestereo.report
from activestereo.diagnose import diagnose
from activestereo.diagnose.residual_model import ResidualModel, Term
from activestereo.effects import Parameter, Stage, builtin, effect
from activestereo.effects.core.load import load_effects
from activestereo.report.diagnosis import diagnosis_screen
from activestereo.report.write import write_diagnosis_report
from lab_worlds import BLACK_DN, WorldRenderer, altered
from schema_check import violations


mine_shading = replace(builtin()["vignetting"], id="mine_shading", family="mine", finding="My lens is dark")


@effect("mine_idle", stage=Stage.READOUT, family="mine", source="a test",
        parameters=[Parameter("amount", "1", neutral=0.0, low=-1.0, high=1.0, typical=0.1)])  # fmt: skip
def mine_idle(signal, view, amount):
    """Columns differ in gain from left to right in waves of four pixels."""
    return signal * (1.0 + amount * np.cos(np.pi * np.arange(signal.shape[-1]) / 2.0))


def shaded(dn, side):
    height, width = dn.shape
    v, u = np.mgrid[0:height, 0:width]
    r2 = ((u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2) / (0.5 * width) ** 2
    return BLACK_DN + (dn - BLACK_DN) / (1.0 + r2)


@pytest.fixture(scope="module")
def renderer(lab_world):
    return WorldRenderer(lab_world, grid=3)


@pytest.fixture(scope="module")
def words():
    return []


@pytest.fixture(scope="module")
def diagnosis(lab_world, renderer, lab_cache, tmp_path_factory, words):
    folder = altered(lab_world, tmp_path_factory.mktemp("own") / "capture", shaded)
    own = {e.id: e for e in (mine_shading, mine_idle)}
    effects = {"gain_mismatch": builtin()["gain_mismatch"]} | own
    return diagnose(folder, effects=effects, renderer=renderer, cache=lab_cache, says=words.append)


def test_own_effects_say_why_they_rank_where_they_do(diagnosis):
    own, result = diagnosis.result["own"], diagnosis.result
    assert list(own) == ["mine_shading", "mine_idle"] and result["added"] == ["mine_shading"]
    assert own["mine_shading"] == "it explains the data best"
    ranked = {entry["effect"]: entry for entry in result["ranking"]}
    if "mine_idle" in ranked:
        share = 100 * ranked["mine_idle"]["explained_share"]
        assert own["mine_idle"].startswith(f"it may not be named: it explains {share:.1f} % of the error")
    else:
        assert own["mine_idle"] == "it explains next to nothing of the images"
    text = " ".join(diagnosis_screen(result, [], Path("report.html"), "", True).split())
    assert "lacks mine_shading (my lens is dark)" in text
    assert all(f"yours: {why}" in text for why in own.values())


def test_own_effects_are_ranked_by_their_scores_before_anything_is_fitted(diagnosis, words):
    ranks = [line for line in words if " ranks " in line]
    assert words[0].startswith("looks like") and words[1 : 1 + len(ranks)] == ranks
    assert ranks[0].startswith("mine_shading ranks 1 of ") and "gain_mismatch" not in " ".join(ranks)


def test_the_report_of_a_diagnosis_needs_no_render(diagnosis, renderer, tmp_path, monkeypatch):
    def refused(*_):
        raise AssertionError("the report renders")

    monkeypatch.setattr(WorldRenderer, "__call__", refused)
    path = write_diagnosis_report(diagnosis, tmp_path / "new", {"mine_shading": mine_shading})
    page = path.read_text()
    assert "mine_shading (my lens is dark).</h1>" in page and page.index('id="verdict"') < page.index('id="explorer"')
    data = json.loads(page.split('id="explorer-data">')[1].split("</script>")[0])
    assert list(data["models"]) == ["base", "found", "mine_shading"]
    view = next(v for v in data["views"] if v["camera"] == "left" and v["split"] == "test")
    key = view["frame"], "left"
    for name, errors in (("base", diagnosis.before), ("found", diagnosis.after)):
        rest = errors.measured[key].astype(np.float64) - errors.predictions[key]
        frame = next(frame for frame in errors.by_frame() if frame["id"] == view["frame"])
        assert view["rmse"][name] == pytest.approx(frame["cameras"]["left"]["rmse_dn"], rel=1e-6)
        assert 0.97 < view["rmse"][name] / np.sqrt(np.mean(rest**2)) < 1.0  # the renderer's noise is not the model's
    assert view["rmse"]["found"] < 0.8 * view["rmse"]["base"]


def test_the_answer_obeys_its_schema(diagnosis):
    schema = Path(activestereo.report.__file__).parent / "schema/diagnose.schema.json"
    assert violations(diagnosis.result, json.loads(schema.read_text())) == []


@pytest.mark.parametrize("stage", ["PROJECTOR", "READOUT", "DIGITAL"])
def test_the_stub_of_an_unknown_effect_loads_before_anybody_edits_it(tmp_path, stage):
    terms = (Term(term="r^2", code="(x**2 + y**2)", value=-0.3, low=-0.35, high=-0.27),)
    (tmp_path / "stub.py").write_text(ResidualModel('a user\'s "room"', stage, terms, 0.5).stub())
    [loaded] = load_effects(tmp_path / "stub.py").values()
    assert loaded.id == "my_effect" and loaded.stage is Stage[stage]
