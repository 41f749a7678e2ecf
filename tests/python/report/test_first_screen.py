# SPDX-License-Identifier: Apache-2.0
"""Screens, verdicts and notebooks: the first that people read."""

import base64
import io
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from activestereo.diagnose import Diagnosis
from activestereo.diagnose.words import alike, headline, next_steps, rival_words
from activestereo.effects import Model
from activestereo.report.diagnosis import diagnosis_screen, diagnosis_sections, diagnosis_table
from activestereo.report.first_screen import _largest_window, first_screen
from activestereo.report.lettering import escape_dollars, save_figure
from activestereo.report.models import model_images
from activestereo.report.screen import command
from activestereo.report.write import write_report
from chromium import Page, is_installed
from command_line import led_on
from matplotlib.figure import Figure
from PIL import Image
from report_worlds import DIAGNOSIS, WITH_MODEL

SAYS = "The lenses distort more or less than calibrated"
_FIRST, _SECOND = DIAGNOSIS["ranking"]
FOUND = WITH_MODEL | {"capture": "world", "ranking": [_FIRST | {"finding": SAYS}, _SECOND]}


@pytest.fixture(scope="module")
def screen(ball_comparison):
    steps = [command("simulate", "a.gltf", label="use")]
    return first_screen(FOUND, ball_comparison, model_images(ball_comparison, FOUND), steps)


def _pictures(html):
    """{alt: pixels} of the pictures that are no charts."""
    found = re.findall(r'<img alt="([^"]*)" src="data:image/webp;base64,([^"]*)"', html)
    return {alt: np.asarray(Image.open(io.BytesIO(base64.b64decode(data)))) for alt, data in found}


def test_the_sentence_the_rivals_and_the_advice_are_there(screen):
    named = f"radial_distortion ({SAYS[0].lower()}{SAYS[1:]})"
    assert f"<h1>The model lacks {named}.</h1>" in screen
    assert "This data cannot tell radial_distortion from principal_point_offset." in screen
    assert "Measure: a second distance." in screen
    assert "no fit has seen: model now 6.21 DN, with the effect 2.51 DN, sensor noise 2.44 DN" in screen
    assert "<p>use: <code>activestereo simulate a.gltf</code></p>" in screen
    assert screen.count("data:image/svg+xml") == 1  # the curve


def test_the_pictures_are_the_images(screen, ball_comparison):
    """The detail has 140 pixels across, in measurement and models: where the squared error falls most."""
    pictures, images = _pictures(screen), model_images(ball_comparison, FOUND)
    assert list(pictures) == ["measured", "model", "model with what was found", "measured − model", "what is left"]
    tests = [(f.id, side) for f in ball_comparison.capture.split("test") for side in ("left", "right")]
    falls = {}
    for key in tests:
        measured = ball_comparison.capture.ir(next(f for f in ball_comparison.capture.frames if f.id == key[0]), key[1])
        fall = (measured - images["base"][key]) ** 2 - (measured - images["found"][key]) ** 2
        for top, left in np.ndindex(90 - 79 + 1, 160 - 140 + 1):
            falls[key, top, left] = fall[top : top + 79, left : left + 140].sum()
    key, top, left = max(falls, key=falls.get)
    shown = pictures["measured"][..., 0]
    assert shown.shape == (79, 140)
    measured = ball_comparison.measured[key].astype(np.float64)
    level = np.rint(255.0 * np.sqrt(np.clip(measured / np.quantile(measured, 0.998), 0.0, 1.0)))
    windows = np.lib.stride_tricks.sliding_window_view(level, shown.shape)
    assert np.argwhere(np.abs(windows - shown).max(axis=(2, 3)) <= 1.0).tolist() == [[top, left]]


@pytest.mark.parametrize("size, detail", [((480, 848), (160, 283)), ((120, 212), (79, 140)), ((60, 100), (60, 100))])
def test_a_detail_is_a_third_but_not_a_few_pixels(size, detail):
    _, rows, columns = _largest_window(np.ones(size))
    assert (rows.stop - rows.start, columns.stop - columns.start) == detail


def test_without_anything_found_the_residual_takes_the_third_place(ball_comparison):
    nothing = DIAGNOSIS | {"verdict": "unknown", "added": []}
    nothing["curve"] = nothing["curve"][:1]
    html = first_screen(nothing, ball_comparison, model_images(ball_comparison))
    assert list(_pictures(html)) == ["measured", "model", "measured − model, there", "measured − model"]
    assert "no known effect explains" in html and "effect_stub.py" in html


def test_without_images_the_sentence_stands_alone():
    blank = DIAGNOSIS | {"verdict": "undetermined", "reason": "the images are <blank>", "ranking": [], "added": []}
    blank |= {"heldout_ir_rmse_before": None, "heldout_ir_rmse_after": None, "heldout_noise_floor": None, "curve": []}
    html = first_screen(blank)
    assert "cannot tell what is missing: the images are &lt;blank&gt;." in html and "<img" not in html


@pytest.fixture(scope="module")
def shown(ball_comparison, tmp_path_factory):
    """(the report's file, its page)"""
    if not is_installed():
        pytest.skip("no chromium: install Debian's package chromium")
    file = write_report(ball_comparison, tmp_path_factory.mktemp("report"), FOUND)[1]
    with Page(file, size=(1280, 720)) as page:
        yield file, page


def test_it_fits_a_window_of_1280_by_720(shown):
    _, page = shown
    page.wait("[...document.querySelectorAll('#verdict img')].every((i) => i.complete && i.naturalWidth > 0)")
    box = "document.getElementById('verdict').getBoundingClientRect()"
    assert page.value(f"{box}.top") >= 0 and page.value(f"{box}.bottom") <= 720
    assert page.value("document.documentElement.scrollWidth") <= 1280
    heights = page.value("[...document.querySelectorAll('#verdict img')].map((i) => i.clientHeight)")
    assert len(heights) == 6 and min(heights) >= 180


def test_what_was_found_has_a_slider_of_its_strength(shown):
    """Without the effect at its left end, as fitted in the middle, and twice as strong at its right end."""
    file, page = shown
    names = page.value("[...document.querySelectorAll('.strip h2')].map((h) => h.textContent)")
    assert names == [f"What {name} does here" for name in FOUND["added"]]
    seen = {}
    for value in ("4", "0", "8"):
        moved = f"const s = document.querySelector('.strip input'); s.value = '{value}'; s.oninput();"
        page.value(f"(() => {{ {moved} }})()")
        images = page.value("[...document.querySelector('.strip').querySelectorAll('img')].map((i) => i.src)")
        seen[value] = images, page.text(".strip output")
    assert seen["0"][0][1] == seen["0"][0][0] and len({pictures[1] for pictures, _ in seen.values()}) == 3
    fitted = FOUND["model"]["effects"][0]["parameters"]
    assert all(f"{name} {value:.4g}" in seen["4"][1] for name, value in fitted.items())
    size = _pictures(file.read_text())["without"].shape
    assert size[:2] == (79, 140)


def _row(name, equivalent=(), nats=10.0):
    return {
        "effect": name, "family": "family", "finding": "", "score_nats": nats, "confidence": 0.1,
        "explained_share": 0.2, "parameters": {}, "equivalent": list(equivalent),
    }  # fmt: skip


def _result(**changed):
    base = {"ranking": [_row("a", ["b"]), _row("b", ["a"]), _row("c", ["a", "b", "d"]), _row("d", ["a", "b", "c"])]}
    return DIAGNOSIS | base | {"added": ["a"], "depth": None} | changed


def _screen(result, verbose=False):
    steps = [command("compare", "captures/table", "--model", "out/diagnosis/model.json", "-o", "out/diagnosis/after",
                     label="check")]  # fmt: skip
    return diagnosis_screen(result, steps, Path("out/diagnosis/report.html"), "cache: empty", verbose)


def test_a_sentence_for_each_verdict():
    said = [_row("a") | {"finding": "The air is hazy"}, _row("b") | {"finding": "A lamp flickers"}]
    both = _result(ranking=said, added=["a", "b"])
    assert headline(both) == "The model lacks a (the air is hazy) and b (a lamp flickers)."
    assert headline(_result()) == "The model lacks a."
    assert headline(_result(verdict="unknown", added=[])) == (
        "Something is missing that no known effect explains (2.51 DN, noise alone gives 2.44 DN)."
    )
    assert "at the noise floor (at the noise floor, noise" not in headline(_result(verdict="none", added=[]))
    fault = {"verdict": "effect", "reason": None, "added": ["e"], "ranking": [_row("e") | {"nuisance": False}]}
    assert headline(_result(verdict="none", added=[], depth=fault)) == (
        "The images lack nothing; the depth engine has one effect more: e."
    )
    assert headline(_result(verdict="undetermined", reason="it is dark")).endswith("missing: it is dark.")


def test_what_is_wrong_with_the_recording_is_the_first_note():
    told = _screen(_result(warnings=["frame 2: it is white"], own={"mine": "it ranks last"}), verbose=True)
    assert 0 < told.index("Warning: frame 2: it is white.") < told.index("mine: it ranks last")
    assert "Warning: frame 2: it is white." in first_screen(_result(warnings=["frame 2: it is white"]))


def test_an_effect_has_one_share_and_no_words_contradict_it():
    """A rival that rounds to the same share gets a digit more; none is "within 5 %" of a name and explains 95 %."""
    sure = {"effects": ["a"], "rivals": {"c": 0.4, "d": 0.3, "e": 0.2}}  # beside other effects; the ranking's are told
    ranking = [_row(name) | {"explained_share": share} for name, share in zip("acde", (0.951, 0.93, 0.71, 0.2))]
    words = rival_words(_result(ranking=ranking, sets=[sure]))
    assert words == ["Rivals fit worse: it explains 95 %, c 93 %, d 71 %."]
    ranking[1]["explained_share"] = 0.9483
    assert "explains 95.1 %, c 94.8 %," in rival_words(_result(ranking=ranking, sets=[sure]))[0]
    ranking[1]["explained_share"] = 0.97
    assert "worse" not in rival_words(_result(ranking=ranking, sets=[sure]))[0]
    both = rival_words(_result(ranking=ranking, sets=[sure, {"effects": ["d"], "rivals": {}}]))
    assert both == ["Share of the error beyond noise: a 95 % and d 71 %."]
    open_set = {"effects": ["a", "b"], "rivals": {}}
    assert rival_words(_result(sets=[open_set]))[1] == "This data cannot tell a from b."
    repeats = _row("a") | {"channel": "noise"}
    assert rival_words(_result(ranking=[repeats], sets=[sure])) == []
    shares = re.findall(r"a +family +10\.0 +(\d+) %|noise: a (\d+) %", _screen(_result(sets=[open_set]), True))
    assert len(shares) == 2 and len({one or other for one, other in shares}) == 1


def test_the_screen_has_errors_values_with_their_floor_and_the_next_commands():
    row = _row("a") | {"finding": "The air is hazy"}
    row["parameters"] = {"k": {"value": 4.0, "low": 3.3, "high": 4.7, "unit": "m", "floor": 0.66}}
    result = _result(ranking=[row], sets=[{"effects": ["a"], "rivals": {"b": 0.1}}], capture="table",
                     depth={"verdict": "none", "reason": None, "added": [], "ranking": []})  # fmt: skip
    text = _screen(result)
    assert led_on(text)[0][0] == "compare" and "\ncheck: " in text
    assert text.startswith("table: the model lacks a (the air is hazy). Errors on frames that")
    for name, value in (("model now", "6.21"), ("with the effect", "2.51"), ("sensor noise", "2.44")):
        assert re.search(f"^  {name} +{value} DN +█", text, re.M)
    assert "fitted: k 4.00 ±0.70 m (floor ±0.66)" in text and "depth engine: nothing is missing." in text
    row["parameters"]["k"]["floor"] = 0.7
    row["parameters"] |= {"haze_per_m": {"value": 0.2, "low": 0.0, "high": 0.9, "unit": "1/m", "floor": 0.02}}
    text = _screen(result)
    assert "k 4.00 ±0.70 m (its formula's error), haze 0.2 1/m (0 to 0.9," in text
    assert "probability" not in _screen(result, True) and "confidence" not in _screen(result, True)


def test_the_columns_of_both_tables_are_told():
    for said in (diagnosis_table(_result()), "".join(diagnosis_sections(_result(depth={})))):
        for word in ("nats: the logarithm of how much likelier", "explains: share of the squared error", "floor: "):
            assert said.count(word) == 1
    assert "nats:" not in diagnosis_table(_result(ranking=[], added=[]))


def test_what_differs_is_mended_where_it_is():
    """A glossier table is no fault of the sensor."""
    rows = [_row("specular") | {"family": "surface"}, _row("lens_psf"), _row("prnu")]
    advice = [next_steps(_result(ranking=rows, added=added))[-1] for added in (["specular"], ["lens_psf", "prnu"])]
    assert advice[0].startswith("Give the scene file's materials the values found, or simulate with ")
    assert advice[1].startswith("Mend the sensor and record again, or simulate")
    both = next_steps(_result(ranking=rows, added=["specular", "lens_psf"]))[-1]
    assert both.startswith("Give the scene file's materials the values found; mend the sensor and record again, or")


def test_every_row_says_what_it_cannot_be_told_from():
    """An effect that explains more than a row is no equal of it where it does not say so of the row."""
    result = _result()
    assert [alike(result, row) for row in result["ranking"]] == [["b"], ["a"], ["d"], ["c"]]
    lines = diagnosis_table(result).splitlines()
    notes = [line.strip() for line in lines if line.strip().startswith("cannot be told from")]
    assert notes == [f"cannot be told from {name}" for name in "badc"]


def test_own_effects_are_in_the_table_wherever_they_rank():
    rows = [_row(f"e{i}") for i in range(20)] + [_row("mine")]
    result = _result(ranking=rows, added=["e0"], own={"mine": "it gains 1 nat", "other": "it explains next to nothing"})
    lines = diagnosis_table(result).splitlines()
    place = next(i for i, line in enumerate(lines) if line.split()[:2] == ["21", "mine"])
    assert lines[place + 1].strip() == "yours: it gains 1 nat"
    assert any(line.split()[:2] == ["-", "other"] and "next to nothing" in line for line in lines)
    assert not any(" e12 " in line for line in lines)


def test_rows_that_gain_nothing_are_not_printed():
    rows = [_row("a", nats=30.0), _row("b", nats=0.0), _row("mine", nats=0.0)]
    text = diagnosis_table(_result(ranking=rows, own={"mine": "it gains nothing"}))
    assert " a " in text and " mine " in text and " b " not in text


RESULT = WITH_MODEL | {"ranking": [row | {"explained_share": 0.5} for row in DIAGNOSIS["ranking"]]}


def test_a_comparison_has_residuals_and_a_table(ball_comparison):
    frame = ball_comparison.capture.frames[2]
    rest = ball_comparison.residuals()[frame.id, "right"]
    measured = ball_comparison.capture.ir(frame, "right").astype(np.float64)
    assert np.allclose(rest, measured - ball_comparison.predictions[frame.id, "right"], atol=1e-3)
    shown, printed = ball_comparison._repr_html_(), str(ball_comparison)
    for text in (shown, printed):
        assert f"{ball_comparison.scores['ir']['test']['rmse_dn']:.3f}" in text and "noise floor, DN" in text
    assert "<table>" in shown and len(printed.splitlines()) == 4


def test_a_diagnosis_says_its_verdict_in_a_notebook_and_printed():
    diagnosis = Diagnosis(RESULT, Model())
    assert str(diagnosis).startswith("The model lacks radial_distortion") and len(str(diagnosis)) < 500
    shown = diagnosis._repr_html_()
    assert "The model lacks radial_distortion" in shown and "principal_point_offset" in shown
    assert diagnosis.predictions() == {} and diagnosis.residuals() == {} and diagnosis.comparison() is None


NAMES = ["\x1b[31mred", "bell\x07", "two\nlines", "\ud800", "$\\nothing$", "a$b", "100 %", "日本", "\u202eright"]


@pytest.mark.parametrize("form", ["png", "svg"])
@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_drawn_without_a_word(name: str, form: str) -> None:
    figure = Figure(figsize=(1, 1))
    figure.suptitle(escape_dollars(name))
    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(figure, file, format=form)
    assert file.getvalue()
