# SPDX-License-Identifier: Apache-2.0
"""The first screen of a diagnosis: the sentence says what the figures say, the pictures are the images, and all of it
fits a window of 1280 x 720."""

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

from activestereo.report.first_screen import _largest_window, first_screen
from activestereo.report.models import model_images
from activestereo.report.screen import command
from activestereo.report.write import write_report
from chromium import Page, is_installed
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
    """The detail of a small image has 140 pixels across, and the same place in measurement and models: where the
    squared error falls most."""
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
