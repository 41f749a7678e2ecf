# SPDX-License-Identifier: Apache-2.0
"""The page of `activestereo view` in a browser: a headless chromium clicks, drags and points, and the page answers."""

import re
import shutil

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from chromium import needs_chromium
from view_page import View

pytestmark = needs_chromium


@pytest.fixture(scope="module")
def capture(lab_world):
    return read_capture(lab_world.capture_path)


@pytest.fixture(scope="module")
def opened(capture):
    with View(capture.path) as view:
        yield view


@pytest.fixture
def view(opened):
    """On frame 0, left image, the whole picture."""
    opened.page.click("#zoom-reset")
    opened.page.click("#kinds [data-kind=left]")
    if opened.page.value("document.getElementById('frame').value") != "0":
        opened.page.value("(() => { const s = document.getElementById('frame'); s.value = '0'; s.onchange(); })()")
    opened.wait()
    return opened


def test_a_capture_is_shown_with_what_the_simulator_gives_in_its_place(view, capture):
    u, v = 60, 40
    view.point(u, v)
    shown = view.numbers()
    assert shown[:3] == [u, v, capture.ir(capture.frames[0], "left")[v, u]]
    script = "[...pictures.measured.images.left]", "[...pictures.simulated.images.left]"
    measured, simulated = (np.array(view.page.value(s)) for s in script)
    assert np.array_equal(measured, capture.ir(capture.frames[0], "left").ravel())
    # The scene is the one that was measured: what differs is noise, and pixels at edges.
    residual = measured - simulated
    assert np.sqrt(np.mean(residual**2)) < 0.35 * measured.std()
    assert shown[3] == np.rint(simulated[v * capture.rig.left.width + u])
    told = float(re.search(r"RMS ([\d.]+) DN", view.page.text("#rmse"))[1])
    assert told == pytest.approx(np.sqrt(np.mean(residual**2)), abs=0.01)


def test_disparity_and_depth_under_the_pointer_agree(view, capture):
    both = view.page.value(
        "pictures.measured.images.disparity.findIndex((d, i) => d > 0 && pictures.simulated.images.disparity[i] > 0)"
    )
    width = capture.rig.left.width
    view.point(both % width, both // width)
    *_, d_measured, d_simulated, z_measured, z_simulated = view.numbers()
    focal_baseline = capture.rig.left.K[0, 0] * capture.rig.baseline_m
    depths = [focal_baseline / d_measured, focal_baseline / d_simulated]
    assert [z_measured, z_simulated] == pytest.approx(depths, rel=0.01)
    assert d_simulated == pytest.approx(d_measured, abs=1.0)


def test_frames_and_pictures_are_chosen_by_click_and_by_key(view, capture):
    view.page.click("#kinds [data-kind=right]")
    view.point(30, 20)
    assert view.numbers()[2] == capture.ir(capture.frames[0], "right")[20, 30]
    view.page.click("#next-frame")
    view.wait()
    view.point(30, 20)
    assert view.numbers()[2] == capture.ir(capture.frames[1], "right")[20, 30]
    view.page.value("document.activeElement.blur()")
    view.key("1")
    view.point(30, 20)
    assert view.numbers()[2] == capture.ir(capture.frames[1], "left")[20, 30]
    view.key("3")
    assert "px" in view.page.text("#measured-scale")
    view.key("p")
    view.wait()
    assert view.page.value("document.getElementById('frame').value") == "0"


def test_the_pointer_is_moved_by_keys(view):
    view.point(30, 20)
    view.page.value("document.getElementById('measured').focus()")
    shift = 8
    for _ in range(3):
        view.key("ArrowRight", modifiers=shift)
    view.key("ArrowUp", modifiers=shift)
    assert view.numbers()[:2] == [33, 19]
    assert view.page.text("#zoom") == "1×"


def test_all_pictures_share_one_zoom_and_are_dragged_together(view):
    pictures = ["#measured", "#simulated", "#difference"]
    parts = lambda: [view.page.value(f"document.querySelector('{p}').dataset.shown") for p in pictures]  # noqa: E731
    whole = parts()
    view.page.wheel("#difference", -480, 0.5, 0.5)
    view.page.wait("document.getElementById('zoom').textContent === '4×'")
    zoomed = parts()
    view.page.drag("#measured", -40)
    dragged = parts()
    assert len(set(whole)) == len(set(zoomed)) == len(set(dragged)) == 1
    assert float(dragged[0].split()[0]) > float(zoomed[0].split()[0]) > 0.0


def test_dots_under_the_pointer_are_shown_where_the_right_camera_has_them(view):
    """The right crop is taken at the disparity: both crops show the same dots."""
    script = """(() => { const images = pictures.measured.images, w = facts.width;
        for (let i = 13 * w; i < images.left.length - 13 * w; ++i) {
            const u = i % w, d = images.disparity[i];
            if (u > d + 14 && u < w - 14 && images.left[i] > 80) return [u, Math.floor(i / w)];
        } return null; })()"""
    view.point(*view.page.value(script))
    crop = """(() => { const c = document.querySelector('#dots-measured-%s');
        return [...c.getContext('2d').getImageData(0, 0, c.width, c.height).data]; })()"""
    left, right = (np.array(view.page.value(crop % side), float).reshape(300, 300, 4)[6::12, 6::12, 0] for side in
                   ("left", "right"))  # fmt: skip
    assert np.corrcoef(left[8:17, 8:17].ravel(), right[8:17, 8:17].ravel())[0, 1] > 0.5
    assert float(re.search(r"brightest ([\d.]+)", view.page.text("#dots-text"))[1]) > 1.5


def test_nothing_but_the_server_is_asked_and_nothing_fails(view):
    assert {address.split("/")[2] for address in view.page.requests()} == {f"127.0.0.1:{view.server.server_port}"}
    assert view.page.complaints() == []


def test_a_scene_is_compared_with_its_own_first_picture(table_top):
    with View(table_top, "--resolution", "212x120") as view:
        view.point(100, 60)
        u, v, before, now, *_ = view.numbers()
        assert (u, v) == (100, 60) and before == now > 0
        assert "before" in view.page.text("#readout")
        assert view.page.value("pictures.measured === before[false] && before[true] !== before[false]")
        assert view.page.value("document.querySelectorAll('.waiting, .empty').length") == 0
        assert float(re.search(r"RMS ([\d.]+)", view.page.text("#rmse"))[1]) == 0.0


def test_a_folder_is_a_list_to_choose_from(lab_world, tmp_path):
    for name in ("first", "second"):
        shutil.copytree(read_capture(lab_world.capture_path).path, tmp_path / name)
    (tmp_path / "second" / "capture.json").write_text("{}")
    with View(tmp_path) as view:
        names = "[...document.getElementById('entry').options].map((o) => o.value)"
        assert view.page.value(names) == ["first", "second"]
        view.page.value("(() => { const s = document.getElementById('entry'); s.value = 'second'; s.onchange(); })()")
        view.wait("nothing")
        assert "capture.json" in view.page.text("#told")


def test_a_recording_and_a_data_set_are_shown_as_they_were_measured(lab_world, tmp_path):
    """Pairs by their files' names: a recording's folder, a data set's and one of simulate."""
    capture = read_capture(lab_world.capture_path)
    frame = capture.frames[0]
    places = {
        "recording": ("left_7.png", "right_7.png"),
        "set": ("000000/ir_left/000000.png", "000000/ir_right/000000.png"),
        "simulated": ("ir_left.png", "ir_right.png"),
    }
    for folder, names in places.items():
        for name, source in zip(names, (frame.left_path, frame.right_path)):
            path = tmp_path / folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, path)
    for folder in places:
        with View(tmp_path / folder, shown="measured") as view:
            assert view.page.value("document.getElementById('panel').hidden") is True
            view.point(30, 20)
            assert view.numbers()[:3] == [30, 20, capture.ir(frame, "left")[20, 30]]
            assert "nominal figures of the D435" in view.page.text("#title")
            assert view.page.text("#measured-name") == "as in the file"  # simulate's images are not measured
            assert view.page.value("document.getElementById('clouds').parentElement.hidden") is True
            assert view.page.value("pictures.measured.images.disparity.filter((d) => d > 0).length") > 500
