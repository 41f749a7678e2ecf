"""The report: files obey their schemas, the page is whole and self-contained, and it shows what the numbers say."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import activestereo.lab
from lab_worlds import WorldRenderer
from schema_check import violations
from activestereo.lab.cache import LayerCache
from activestereo.lab.compare import compare
from activestereo.lab.html import picture, table
from activestereo.lab.report import report_page, summary_table, write_report
from test_depth_compare import with_device_depth
from worlds.world import make_world

_SCHEMAS = Path(activestereo.lab.__file__).resolve().parent / "schema"
_DIAGNOSIS = {
    "verdict": "effect",
    "ranking": [
        {
            "effect": "radial_distortion", "family": "camera geometry", "score_nats": 812.4, "confidence": 0.97,
            "parameters": {"k1": {"value": -0.0085, "low": -0.0088, "high": -0.0082, "unit": "1"}},
            "equivalent": ["radial_distortion", "principal_point_offset"],
        },
        {
            "effect": "vignetting", "family": "lens <shading>", "score_nats": 3.1, "confidence": 0.01,
            "parameters": {"exponent": {"value": 0.1, "low": None, "high": None, "unit": "1"}}, "equivalent": [],
        },
    ],
    "added": ["radial_distortion"],
    "heldout_ir_rmse_before": 6.21,
    "heldout_ir_rmse_after": 2.51,
    "heldout_noise_floor": 2.44,
    "next_measurement": ["a second distance", {"text": "tilt by 30 degrees (expected 14.2 nats)", "separates": ["a", "b"]}],
    "law": None,
    "curve": [
        {"effects": [], "heldout_ir_rmse": 6.21, "train_ir_rmse": 5.9},
        {"effects": ["radial_distortion"], "heldout_ir_rmse": 2.51, "train_ir_rmse": 2.3},
    ],
}  # fmt: skip


class _Page(HTMLParser):
    """Every address that a page refers to, whether its tags are closed in order, and its text."""

    _VOID = {"meta", "img", "br"}

    def __init__(self, text):
        super().__init__()
        self.addresses, self.open, self.words = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.addresses += [value for name, value in attrs if name in ("src", "href")]
        if tag not in self._VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def comparison(tmp_path_factory):
    """A model that lacks the ball, on a world with device depth: there is much to explain."""
    folder = tmp_path_factory.mktemp("report")
    world = make_world(folder / "world", size=(160, 90), grid=3)
    capture = with_device_depth(world, folder / "capture", ids=(0, 2, 4))
    wrong = replace(world, solids=tuple(s for s in world.solids if s.name != "ball"))
    return compare(capture, renderer=WorldRenderer(wrong, grid=3), cache=LayerCache(folder / "cache"))


@pytest.fixture(scope="module")
def files(comparison, tmp_path_factory):
    return write_report(comparison, tmp_path_factory.mktemp("out") / "new")


def _schema(name):
    return json.loads((_SCHEMAS / f"{name}.schema.json").read_text())


def test_compare_json_obeys_its_schema(files):
    scores = json.loads(files[0].read_text())
    assert violations(scores, _schema("compare")) == []
    scores["ir"]["test"].pop("rmse_dn")
    scores["where"][0]["p_value"] = "small"
    assert len(violations(scores, _schema("compare"))) == 2


def test_diagnose_schema_takes_the_contract_and_not_less():
    assert violations(_DIAGNOSIS, _schema("diagnose")) == []
    assert violations(_DIAGNOSIS | {"verdict": "perhaps"}, _schema("diagnose"))
    assert violations({k: v for k, v in _DIAGNOSIS.items() if k != "added"}, _schema("diagnose"))


def test_the_page_is_whole_and_loads_nothing(files):
    page = _Page(files[1].read_text())
    assert page.open == []
    assert len(page.addresses) >= 14  # six infrared and six depth pictures, charts
    assert all(re.match(r"data:image/(png|svg\+xml);base64,", address) for address in page.addresses)
    assert "<script" not in files[1].read_text()


def test_the_page_says_what_the_scores_say(comparison, files):
    words = " ".join(_Page(files[1].read_text()).words)
    scores = comparison.scores
    assert f"{scores['ir']['test']['rmse_dn']:.2f} DN" in words
    assert f"{100 * scores['depth']['test']['fill_measured']:.1f} /" in words
    head = scores["regions"]["infrared"]["headline"]
    assert f"{100 * head['share']:.0f} % of the explainable error" in words and head["words"] in words
    assert "Which effect is missing" not in words


def test_a_missing_ball_is_found_at_what_stands_behind_it(comparison):
    """The model sees table and wall where the ball was: nearly all error is in a part of the picture."""
    region = comparison.scores["regions"]["infrared"]
    assert region["is_explainable"]
    assert region["headline"]["share"] > 3 * region["headline"]["pixel_share"]


def test_a_diagnosis_in_the_folder_is_shown(comparison, tmp_path):
    (tmp_path / "diagnose.json").write_text(json.dumps(_DIAGNOSIS))
    page = _Page(write_report(comparison, tmp_path)[1].read_text())
    words = " ".join(page.words)
    assert page.open == []
    assert "A known effect is missing : radial_distortion" in words
    assert "principal_point_offset" in words and "lens <shading>" in words  # escaped, and read back
    assert "a second distance" in words and "14.2" in words and "6.21 → 2.51 DN" in words


def test_a_damaged_or_foreign_diagnosis_is_left_out(comparison, tmp_path):
    for content in ("{", "[]", json.dumps(_DIAGNOSIS | {"capture": "another"})):
        (tmp_path / "diagnose.json").write_text(content)
        assert "Which effect is missing" not in write_report(comparison, tmp_path)[1].read_text()


def test_an_empty_diagnosis_has_a_page_too(comparison):
    empty = _DIAGNOSIS | {"verdict": "none", "ranking": [], "added": [], "next_measurement": [], "curve": []}
    empty |= dict.fromkeys(("heldout_ir_rmse_after", "heldout_noise_floor"))
    assert "Nothing is missing" in report_page(comparison, empty)


def test_an_unknown_effect_shows_its_law(comparison):
    term = {"term": "r^2", "value": -0.31, "low": -0.35, "high": -0.27}
    law = {"stage": "PROJECTOR", "text": "residual / the projector's light = -0.31 r^2", "terms": [term], "explained_share": 0.8}
    unknown = _DIAGNOSIS | {"verdict": "unknown", "added": [], "law": law}
    assert violations(unknown, _schema("diagnose")) == []
    page = report_page(comparison, unknown)
    assert "no known effect explains" in page and "-0.35 … -0.27" in page


def test_summary_names_depth_and_where(comparison):
    summary = summary_table(comparison.scores)
    assert "fill device" in summary and "% of the explainable error:" in summary


def test_text_is_escaped_and_pictures_keep_their_pixels():
    assert "<b>" not in table(["<b>"], [])
    assert 'src="data:image/png;base64,' in picture(np.zeros((3, 4)), 0, 1, "gray", "t", "DN")
