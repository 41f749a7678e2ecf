# SPDX-License-Identifier: Apache-2.0
"""The report in a browser: a headless chromium clicks, drags and points, and the page answers."""

import re

import numpy as np
import pytest

from activestereo.report.write import write_report
from activestereo.report.models import model_images
from report_worlds import WITH_MODEL
from chromium import Page, needs_chromium

pytestmark = needs_chromium

_HEIGHT, _WIDTH = 90, 160


@pytest.fixture(scope="module")
def images(ball_comparison):
    return model_images(ball_comparison, WITH_MODEL)


@pytest.fixture(scope="module")
def browser(ball_comparison, tmp_path_factory):
    file = write_report(ball_comparison, tmp_path_factory.mktemp("explored"), WITH_MODEL)[1]
    with Page(file) as page:
        page.wait("document.getElementById('explorer').dataset.view !== undefined")
        yield page


@pytest.fixture(scope="module")
def without_model(ball_comparison, tmp_path_factory):
    """The page of a comparison alone."""
    with Page(write_report(ball_comparison, tmp_path_factory.mktemp("alone"))[1]) as page:
        page.wait("document.getElementById('explorer').dataset.view !== undefined")
        yield page


@pytest.fixture
def page(browser):
    """On frame 0, left camera, the whole picture, the slider at the measurement."""
    browser.click("#zoom-reset")
    show(browser, 0, "left")
    slide(browser, 0)
    return browser


def show(page, frame, side):
    page.value(f"(() => {{ const s = document.getElementById('frame'); s.value = '{frame}'; s.onchange(); }})()")
    page.wait(f"document.getElementById('explorer').dataset.view.startsWith('{frame} ')")
    page.click(f"#cameras [data-camera={side}]")
    page.wait(f"document.getElementById('explorer').dataset.view === '{frame} {side}'")


def slide(page, value):
    page.value(f"(() => {{ const s = document.getElementById('fade'); s.value = '{value}'; s.oninput(); }})()")


def shown_part(page, selector):
    """(left, top, width, height) of the part of the image that a canvas shows, pixels."""
    return [float(v) for v in page.value(f"document.querySelector('{selector}').dataset.shown").split()]


def colour(page, selector, u, v):
    """The colour of an image pixel's middle as a canvas draws it while the whole picture is shown."""
    script = f"""(() => {{ const c = document.querySelector('{selector}');
        const x = c.width * {(u + 0.5) / _WIDTH}, y = c.height * {(v + 0.5) / _HEIGHT};
        return [...c.getContext('2d').getImageData(x, y, 1, 1).data]; }})()"""
    return page.value(script)[:3]


def readout(page):
    """Numbers of the readout, in order, minus signs made plain."""
    return [float(n.replace("−", "-")) for n in re.findall(r"[+−-]?\d+(?:\.\d+)?", page.text("#readout"))]


def test_nothing_is_loaded_and_nothing_fails(page):
    assert [address.split(":")[0] for address in page.requests()] == ["file"]
    assert page.complaints() == []


def test_the_worst_test_frame_is_shown_first(ball_comparison, without_model):
    entries = [e for e in ball_comparison.scores["frames"] if e["split"] == "test"]
    frame = without_model.value("document.getElementById('explorer').dataset.view").split()[0]
    assert int(frame) == max(entries, key=lambda e: e["explainable_rmse_dn"])["id"]


def test_values_under_the_pointer(page, ball_comparison, images):
    u, v = 37, 22
    page.point("#picture", (u + 0.5) / _WIDTH, (v + 0.5) / _HEIGHT)
    measured = float(ball_comparison.capture.ir(ball_comparison.capture.frames[0], "left")[v, u])
    base, found = (float(images[name][0, "left"][v, u]) for name in ("base", "found"))
    expected = [u, v, measured, base, measured - base, found, measured - found]
    assert readout(page) == pytest.approx(expected, abs=0.35)
    page.point("#residual-base", (u + 1.5) / _WIDTH, (v + 0.5) / _HEIGHT)  # any picture will do
    assert readout(page)[:2] == [u + 1, v]


def test_frames_and_cameras_are_picked(page, ball_comparison):
    u, v = 100, 50
    for frame, side in ((2, "right"), (4, "left")):
        show(page, frame, side)
        page.point("#picture", (u + 0.5) / _WIDTH, (v + 0.5) / _HEIGHT)
        own = next(f for f in ball_comparison.capture.frames if f.id == frame)
        assert readout(page)[2] == ball_comparison.capture.ir(own, side)[v, u]
    page.click("#next-frame")
    page.wait("document.getElementById('explorer').dataset.view === '5 left'")
    page.click("#previous-frame")
    page.wait("document.getElementById('explorer').dataset.view === '4 left'")


def test_depth_is_the_third_camera(page, ball_comparison):
    show(page, 2, "depth")
    device = next(d for d in ball_comparison.depths if d.frame.id == 2)
    v, u = (int(i) for i in np.argwhere((device.measured > 0) & (device.model[0] > 0))[500])
    page.point("#picture", (u + 0.5) / _WIDTH, (v + 0.5) / _HEIGHT)
    disparity = [device.focal_baseline / z[v, u] for z in (device.measured, device.model[0])]
    assert readout(page) == pytest.approx([u, v, *disparity, disparity[0] - disparity[1]], abs=0.03)
    v, u = (int(i) for i in np.argwhere(device.measured <= 0)[0])
    page.point("#picture", (u + 0.5) / _WIDTH, (v + 0.5) / _HEIGHT)
    assert "device none" in page.text("#readout")
    page.click("#next-frame")  # frame 3 has no depth: its left camera is shown
    page.wait("document.getElementById('explorer').dataset.view === '3 left'")


def test_the_slider_fades_from_measured_to_base_to_found(page, ball_comparison, images):
    u, v = 80, 40
    high = np.quantile(ball_comparison.capture.ir(ball_comparison.capture.frames[0], "left"), 0.998)
    measured = ball_comparison.capture.ir(ball_comparison.capture.frames[0], "left")
    values = [measured[v, u], *(images[n][0, "left"][v, u] for n in ("base", "found"))]
    page.point("#readout")
    for at in (0.0, 0.5, 1.0, 1.75, 2.0):
        slide(page, at)
        value = np.interp(at, [0, 1, 2], values)
        assert colour(page, "#picture", u, v) == pytest.approx([255 * np.sqrt(min(value / high, 1.0))] * 3, abs=3), at
    assert page.text("#picture-name") == "model with what was found"
    page.click("#fade-names button:nth-child(2)")
    assert page.value("document.getElementById('fade').value") == "1"
    assert page.text("#picture-name") == "base model"


def test_one_zoom_for_all_pictures(page):
    pictures = ["#picture", "#residual-base", "#residual-other", "canvas[data-model=vignetting]"]
    assert {tuple(shown_part(page, p)) for p in pictures} == {(0, 0, _WIDTH, _HEIGHT)}
    page.wheel("#residual-base", -480, 0.25, 0.5)
    page.wait("document.getElementById('zoom').textContent === '4×'")
    first, *others = [shown_part(page, p) for p in pictures]
    assert others == [first] * 3
    # What was under the pointer, a quarter from the left, has stayed.
    assert first == pytest.approx([30, 33.75, 40, 22.5], abs=0.3)
    page.drag("#picture", -page.value("document.getElementById('picture').clientWidth") / 4)
    assert [shown_part(page, p) for p in pictures] == [pytest.approx([first[0] + 10, *first[1:]], abs=0.3)] * 4
    page.click("#picture", count=2)
    assert {tuple(shown_part(page, p)) for p in pictures} == {(0, 0, _WIDTH, _HEIGHT)}
    page.click("#zoom-in")
    assert page.text("#zoom") == "2×"
    page.value("document.getElementById('picture').focus()")
    page.call("Input.dispatchKeyEvent", type="keyDown", key="-")
    assert page.text("#zoom") == "1×"


def test_each_row_shows_its_own_residual(page, ball_comparison, images):
    """Rows are drawn from their own effect's expected image; a click shows it large."""
    measured = ball_comparison.capture.ir(ball_comparison.capture.frames[0], "left")
    for name in ("radial_distortion", "vignetting"):
        rmse = np.sqrt(np.mean((measured - images[name][0, "left"]) ** 2))
        row = f"document.querySelector('canvas[data-model={name}]').parentElement"
        assert page.value(f"{row}.querySelector('figcaption').textContent") == f"RMSE {rmse:.2f} DN"
        page.click(f"canvas[data-model={name}]")
        assert page.text("#fade-names button:last-child") == f"base model with {name} alone"
        slide(page, 2)
        assert page.text("#picture-name") == f"base model with {name} alone"
        assert page.value("document.getElementById('residual-other').dataset.model") == name
        chosen = page.value("document.getElementById('other').selectedOptions[0].textContent")
        assert chosen.endswith(f"base model with {name} alone")
    both = [images[name][0, "left"] for name in ("radial_distortion", "vignetting")]
    v, u = np.unravel_index(np.argmax(np.abs(both[0] - both[1])), both[0].shape)
    page.point("#picture", (u + 0.5) / _WIDTH, (v + 0.5) / _HEIGHT)
    assert readout(page)[-1] == pytest.approx(float(measured[v, u] - both[1][v, u]), abs=0.35)


def test_without_anything_found_the_slider_ends_at_the_base_model(without_model):
    page, names = without_model, "[...document.querySelectorAll('#fade-names button')].map((b) => b.textContent)"
    assert page.value("document.getElementById('fade').max") == "1"
    assert page.value(names) == ["measured", "base model"]
    assert page.value("document.getElementById('residual-other').parentElement.hidden") is True
    assert page.complaints() == []
