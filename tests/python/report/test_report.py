# SPDX-License-Identifier: Apache-2.0
"""The report: files obey their schemas, the page is whole and self-contained, and it shows what the numbers say."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from command_line import led_on
from schema_check import violations
from activestereo.report import explorer, write
from activestereo.report.charts import effects_chart
from activestereo.report.diagnosis import diagnosis_screen
from activestereo.report.page import encoded_image
from activestereo.report.explorer import explorer_data
from activestereo.report.first_screen import first_screen, where_most_goes
from activestereo.report.models import model_images, told_errors
from activestereo.report.write import report_page, write_report
from activestereo.report.summary import comparison_screen, error_places, summary_table
from activestereo.report.screen import command
from report_worlds import DIAGNOSIS, WITH_MODEL, decoded


class _Page(HTMLParser):
    """Every address that a page refers to, whether its tags are closed in order, and its text."""

    _VOID = {"meta", "img", "br", "input"}

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
def comparison(ball_comparison):
    return ball_comparison


@pytest.fixture(scope="module")
def files(comparison, tmp_path_factory):
    return write_report(comparison, tmp_path_factory.mktemp("out") / "new")


def test_compare_json_obeys_its_schema(files):
    scores = json.loads(files[0].read_text())
    assert violations(scores, "compare") == []
    scores["ir"]["test"].pop("rmse_dn")
    scores["where"][0]["p_value"] = "small"
    assert len(violations(scores, "compare")) == 2


def test_diagnose_schema_takes_the_contract_and_not_less():
    assert violations(DIAGNOSIS, "diagnose") == []
    assert violations(DIAGNOSIS | {"verdict": "perhaps"}, "diagnose")
    assert violations({k: v for k, v in DIAGNOSIS.items() if k != "added"}, "diagnose")


def test_the_page_is_whole_and_loads_nothing(comparison, files):
    page = _Page(files[1].read_text())
    assert page.open == []
    explained = {name for name, found in comparison.scores["channels"].items() if found["is_explainable"]}
    assert explained >= {"infrared", "disparity"}  # the missing ball moves both; one at its noise floor has no chart
    charts = [address for address in page.addresses if re.match(r"data:image/svg\+xml;base64,", address)]
    pictures = [address for address in page.addresses if re.match(r"data:image/webp;base64,", address)]
    # charts: frames, photon transfer, one of covariates per such channel, and the first screen's
    places = min(2, len(error_places(comparison.scores["where"])))
    assert (len(charts), len(pictures)) == (2 + len(explained) + places, 4)
    assert len(page.addresses) == len(charts) + len(pictures)
    assert "default-src 'none'" in files[1].read_text()  # the browser itself is set to load nothing


def test_the_page_holds_every_frame_and_camera_under_every_model(comparison):
    """Pictures are decoded here as the page's script does, and are what was measured and expected, to half a step."""
    images = model_images(comparison, WITH_MODEL)
    assert list(images) == ["base", "found", "radial_distortion", "vignetting"]
    data = explorer_data(comparison, images, {})
    seen = [(view["frame"], view["camera"]) for view in data["views"]]
    assert seen == [
        (f.id, e) for f in comparison.capture.frames for e in ("left", "right", "depth") if e != "depth" or f.depth_path
    ]
    view = next(v for v in data["views"] if v["camera"] == "right")
    frame = next(f for f in comparison.capture.frames if f.id == view["frame"])
    measured = comparison.capture.ir(frame, "right")
    assert np.array_equal(decoded(view["layers"]["measured"]), measured)
    base = decoded(view["layers"]["base"])
    for name, own in images.items():
        values = decoded(view["layers"][name]) + (base if "added_to" in view["layers"][name] else 0.0)
        steps = view["layers"][name]["step"] + view["layers"]["base"]["step"]
        assert np.abs(values - own[frame.id, "right"]).max() <= 0.5 * steps + 1e-4, name
        assert view["rmse"][name] == pytest.approx(np.sqrt(np.mean((measured - own[frame.id, "right"]) ** 2)), rel=1e-5)
    assert view["layers"]["base"]["step"] < 0.2 * view["floor"]
    depth = next(v for v in data["views"] if v["camera"] == "depth")
    device = next(d for d in comparison.depths if d.frame.id == depth["frame"])
    values = decoded(depth["layers"]["measured"])
    assert np.array_equal(np.isnan(values), device.measured <= 0)
    seen = device.measured > 0
    off = np.abs(values[seen] - device.focal_baseline / device.measured[seen]).max()
    assert off <= 0.5 * depth["layers"]["measured"]["step"] + 1e-6


def test_pictures_quote_the_figures_of_their_frames(comparison):
    """The renderer's noise, which a picture has, is no error of its model."""
    told = told_errors(comparison)
    views = explorer_data(comparison, model_images(comparison), told)["views"]
    figures = {entry["id"]: entry["cameras"] for entry in comparison.scores["frames"]}
    quoted = [(v["rmse"]["base"], figures[v["frame"]][v["camera"]]["rmse_dn"]) for v in views if v["camera"] != "depth"]
    assert quoted and all(shown == figure for shown, figure in quoted)
    detail = where_most_goes(comparison, model_images(comparison))
    error = figures[detail.frame.id][detail.side]["rmse_dn"]
    assert f"{error:.2f} DN here, colours" in report_page(comparison)


def test_what_the_ranking_cannot_show_is_left_out(comparison):
    """A random effect, a depth engine's fault and an unknown effect have no expected image."""
    rows = [("shot_noise", {}), ("pixel_locking", {}), ("of another program", {"x": {"value": 1.0}})]
    ranking = [{"effect": name, "parameters": parameters} for name, parameters in rows]
    assert list(model_images(comparison, {"ranking": ranking})) == ["base"]


def test_a_page_holds_as_many_frames_as_fit(comparison, monkeypatch):
    monkeypatch.setattr(explorer, "_LARGEST_PIXELS", 3 * 2 * 160 * 90)
    frames = {view["frame"] for view in explorer_data(comparison, model_images(comparison), {})["views"]}
    splits = {frame.split for frame in comparison.capture.frames if frame.id in frames}
    assert len(frames) == 3 and splits == {"train", "test"}
    assert "3 of 8 frames" in report_page(comparison)


def test_a_page_shows_ranked_effects_on_as_many_frames_as_fit(comparison, monkeypatch):
    monkeypatch.setattr(explorer, "_LARGEST_PIXELS_OF_ROWS", 2 * 2 * 160 * 90)
    data = explorer_data(comparison, model_images(comparison, WITH_MODEL), {})
    infrared = [view for view in data["views"] if view["camera"] != "depth"]
    assert {view["frame"] for view in infrared if "vignetting" in view["layers"]} == set(data["rows"])
    assert len(data["rows"]) == 2 and data["start"] in data["rows"]
    assert all({"base", "found"} <= set(view["layers"]) and "vignetting" in view["rmse"] for view in infrared)


@pytest.mark.parametrize("high", [200.0, 2000.0, 1e9])
def test_codes_span_the_image(high):
    image = np.linspace(-high, high, 240).reshape(12, 20)
    valid = np.ones(image.shape, bool)
    valid[3, 4] = False
    layer = encoded_image(image, 0.25, valid)
    values = decoded(layer)
    assert np.isnan(values[3, 4]) and np.isfinite(values[valid]).all()
    assert np.abs(values - image)[valid].max() <= 0.5 * layer["step"] * (1 + 1e-9)
    assert layer["step"] == 0.25 or high == 1e9


def test_the_page_says_what_the_scores_say(comparison, files):
    words = " ".join(_Page(files[1].read_text()).words)
    scores = comparison.scores
    assert f"{scores['ir']['test']['rmse_dn']:.2f} DN" in words
    assert f"{100 * scores['depth']['test']['fill_measured']:.1f} /" in words
    assert f"RMSE {scores['channels']['infrared']['rmse']:.3g} DN" in words
    assert "What to measure next" not in words


def test_a_missing_ball_is_found_at_what_stands_behind_it(comparison):
    """The model sees table and wall where the ball was: nearly all error is in a part of the picture."""
    assert comparison.scores["channels"]["infrared"]["is_explainable"]
    assert comparison.scores["where"][0]["concentration"] > 0.6


def test_a_diagnosis_in_the_folder_is_shown(comparison, tmp_path):
    (tmp_path / "diagnose.json").write_text(json.dumps(DIAGNOSIS))
    page = _Page(write_report(comparison, tmp_path)[1].read_text())
    words = " ".join(page.words)
    assert page.open == []
    assert "The model lacks radial_distortion" in words
    assert "principal_point_offset" in words and "lens <shading>" in words  # escaped, and read back
    assert "a second distance" in words and "14.2" in words and "model now 6.21 DN, with the effect 2.51 DN" in words


def test_a_damaged_or_foreign_diagnosis_is_left_out(comparison, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(write, "report_page", lambda comparison, diagnosis, *_, **__: shown.append(diagnosis) or "")
    for content in ("{", "[]", json.dumps(DIAGNOSIS | {"capture": "another"}), json.dumps(DIAGNOSIS)):
        (tmp_path / "diagnose.json").write_text(content)
        write_report(comparison, tmp_path)
    assert shown == [None, None, None, DIAGNOSIS]


def test_an_empty_diagnosis_has_a_page_too(comparison):
    empty = DIAGNOSIS | {"verdict": "none", "ranking": [], "added": [], "next_measurement": [], "curve": []}
    empty |= dict.fromkeys(("heldout_ir_rmse_after", "heldout_noise_floor"))
    assert "Nothing is missing" in report_page(comparison, empty)


def test_an_unknown_effect_shows_the_model_of_its_residual(comparison):
    term = {"term": "r^2", "value": -0.31, "low": -0.35, "high": -0.27}
    words = "residual / the projector's light = -0.31 r^2"
    model = {"stage": "PROJECTOR", "text": words, "terms": [term], "explained_share": 0.8}
    unknown = DIAGNOSIS | {"verdict": "unknown", "added": [], "residual_model": model}
    assert violations(unknown, "diagnose") == []
    page = report_page(comparison, unknown)
    assert "no known effect explains" in page and "-0.35 … -0.27" in page


def test_the_terminal_leads_on_to_a_diagnosis(comparison):
    step = command("diagnose", "captures/table", "-o", "out/diagnosis")
    text = comparison_screen(comparison.scores, step, Path("out/report.html"), "cache: empty", False)
    assert led_on(text) == [["diagnose", "captures/table", "-o", "out/diagnosis"]]
    verbose = comparison_screen(comparison.scores, step, Path("out/report.html"), "cache: empty", True)
    table = " ".join(summary_table(comparison.scores).split())
    assert table in " ".join(verbose.split()) and "cache: empty" in verbose


@pytest.mark.parametrize("after, told", [(2.51, "2.51 DN"), (2.43, "at the noise floor")])
def test_no_error_below_the_noise_floor_is_told(after, told):
    result = DIAGNOSIS | {"heldout_ir_rmse_after": after, "ranking": [], "next_measurement": [], "depth": {}}
    said = diagnosis_screen(result, [], Path("report.html"), "", False)
    [line] = [line for line in said.splitlines() if "with the effect" in line]
    page = first_screen(result)
    assert told.split()[0] in line and f"with the effect {told}" in page
    assert (f"{after:.2f}" in line) == (after > result["heldout_noise_floor"])


def test_the_curve_of_errors_ends_at_the_floor():
    steps = [{"effects": [], "heldout_ir_rmse": 6.21}, {"effects": ["haze"], "heldout_ir_rmse": 2.43}]
    [axes] = effects_chart(steps, 2.44).axes
    assert axes.lines[0].get_ydata().tolist() == [6.21, 2.44]
    said = [note.get_text() for note in axes.texts]
    assert "at the noise floor" in said and not any("2.43" in words for words in said)
