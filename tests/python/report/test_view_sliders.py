# SPDX-License-Identifier: Apache-2.0
"""The sliders of `activestereo view` in a browser, dragged, typed into and moved by keys; the picture follows."""

import json
import shutil

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.model import read_model
from chromium import needs_chromium
from view_page import View

pytestmark = needs_chromium
BLACK_DN = 4.0


@pytest.fixture(scope="module")
def saved_as(tmp_path_factory):
    return tmp_path_factory.mktemp("saved") / "model.json"


@pytest.fixture(scope="module")
def opened(lab_world, saved_as):
    with View(lab_world.capture_path, "--out", saved_as) as view:
        yield view


@pytest.fixture
def view(opened):
    """Frame 0 without any slider moved, refined."""
    opened.page.click("#zoom-reset")
    opened.page.click("#kinds [data-kind=left]")
    changed(opened, lambda: opened.page.click("#reset"))
    return opened


def changed(view, change):
    """Calls change() and waits until the picture is refined."""
    view.page.value("document.getElementById('view').dataset.shown = ''")
    change()
    view.wait()


def drag(view, name, share):
    """Presses the slider where it stands and moves the mouse to a share of its length."""
    selector = f"[data-name={name}] input[type=range]"
    value, width = view.page.value(f"(() => {{ const s = document.querySelector('{selector}'); "
                                   "return [s.value / s.max, s.clientWidth]; })()")  # fmt: skip
    thumb = 8 / width
    at = lambda x: view.page.place(selector, thumb + x * (1 - 2 * thumb))  # noqa: E731
    view.page.mouse("mousePressed", at(value), button="left", clickCount=1)
    for step in np.linspace(value, share, 5):
        view.page.mouse("mouseMoved", at(step), button="left", buttons=1)
    view.page.mouse("mouseReleased", at(share), button="left")


def type_number(view, name, value):
    selector = f"[data-name={name}] input[type=number]"
    field = f"document.querySelector('{selector}')"
    view.page.value(f"(() => {{ const f = {field}; f.value = '{value}'; f.onchange(); }})()")


def add_effect(view, name):
    chosen = f"const s = document.getElementById('add-effect'); s.value = '{name}'"
    view.page.value(f"(() => {{ {chosen}; s.onchange({{ target: s }}); }})()")


def picture(view, name="left"):
    values = f"[...pictures.simulated.images.{name}].map((x) => Number.isNaN(x) ? null : x)"
    return np.array(view.page.value(values), float)


def settings(view):
    return view.page.value("panel.settings()")


def test_exposure_scales_the_light_above_black(view):
    before = picture(view)
    changed(view, lambda: type_number(view, "exposure_s", 0.002))
    assert settings(view)["exposure_s"] == 0.002
    assert (picture(view).mean() - BLACK_DN) / (before.mean() - BLACK_DN) == pytest.approx(0.5, abs=0.03)


def test_dragging_the_laser_to_its_end_leaves_the_room_alone(view):
    before = picture(view), np.isfinite(picture(view, "disparity")).mean()
    changed(view, lambda: drag(view, "laser_power_mw", 0.0))
    assert settings(view)["laser_power_mw"] == 0.0
    assert picture(view).std() < 0.3 * before[0].std()
    assert np.isfinite(picture(view, "disparity")).mean() < before[1] - 0.1
    changed(view, lambda: drag(view, "laser_power_mw", 2 / 3))
    strong = settings(view)["laser_power_mw"]
    assert strong == pytest.approx(300.0, rel=0.02)
    assert picture(view).mean() > before[0].mean()


def test_a_slider_is_moved_by_keys(view):
    view.page.value("document.querySelector('[data-name=gain] input').focus()")
    arrow = {"key": "ArrowRight", "code": "ArrowRight", "windowsVirtualKeyCode": 39}
    for _ in range(3):
        view.page.call("Input.dispatchKeyEvent", type="keyDown", **arrow)
        view.page.call("Input.dispatchKeyEvent", type="keyUp", **arrow)
    view.wait()
    # Sixteen times up and down in a thousand steps of equal ratio, from the middle.
    assert settings(view)["gain"] == pytest.approx(256.0 ** (3 / 1000), rel=1e-4)


def test_a_draft_with_its_depth_comes_first(view):
    """The first answer to a slider is a draft; its disparity is there with it."""
    count = "pictures.simulated.images.disparity.filter((d) => d > 0).length"
    watch = f"new MutationObserver(() => seen.push([document.getElementById('view').dataset.shown, {count}]))"
    element = "document.getElementById('view'), { attributeFilter: ['data-shown'] }"
    view.page.value(f"window.seen = []; {watch}.observe({element})")
    changed(view, lambda: type_number(view, "gain", 1.5))
    seen = [entry for entry in view.page.value("seen") if entry[0]]
    assert [entry[0] for entry in seen] == ["draft", "refined"]
    assert seen[0][1] == pytest.approx(seen[1][1], rel=0.1)
    assert seen[0][1] > 1000


def test_the_last_of_many_settings_is_what_is_shown(view):
    reference = picture(view)
    changed(view, lambda: [type_number(view, "exposure_s", value) for value in (0.001, 0.016, 0.03, 0.002, 0.004)])
    assert settings(view)["exposure_s"] == 0.004
    assert np.array_equal(picture(view), reference)


def test_a_touched_surface_changes_alone(view):
    """Roughness and albedo of what was clicked; other surfaces stay, but for the light that it reflects onto them."""
    u, v = ball(view)
    before = picture(view)
    view.point(u, v)
    width, height = view.page.value("[facts.width, facts.height]")
    view.page.click("#measured", (u + 0.5) / width, (v + 0.5) / height)
    view.page.wait("document.querySelector('#surface [data-name=roughness]') !== null")
    name = view.page.text("#surface-name")
    assert "ball" in name
    changed(view, lambda: drag(view, "ir_albedo", 0.0))
    assert settings(view)["materials"] == {name: {"ir_albedo": 0.0}}
    after = picture(view)
    assert after[v * width + u] < 0.5 * before[v * width + u]
    corner = [row * width + column for row in range(10) for column in range(10)]
    assert np.abs(after - before)[corner].mean() < 3.0


def ball(view):
    """A bright pixel near the middle of the ball, which no other surface is as bright as."""
    width = view.page.value("facts.width")
    names = view.page.value("""(async () => { const found = [];
        for (let v = 5; v < facts.height; v += 8) for (let u = 5; u < facts.width; u += 8) {
            const answer = await called('surface', { ...wanted(), settings: {}, u, v });
            if (answer.name && answer.name.includes('ball')) found.push([u, v]);
        } return found; })()""")
    image = picture(view)
    return max(names, key=lambda place: image[place[1] * width + place[0]])


def test_effects_are_added_moved_and_removed(view):
    before = picture(view)
    changed(view, lambda: add_effect(view, "vignetting"))
    assert settings(view)["effects"] == {"vignetting": {"exponent": 1.5}}
    typical = picture(view)
    changed(view, lambda: drag(view, "exponent", 1.0))
    strongest = settings(view)["effects"]["vignetting"]["exponent"]
    assert strongest > 7.0
    assert picture(view).mean() < typical.mean() < before.mean()
    changed(view, lambda: view.page.click("[data-effect=vignetting] button"))
    assert np.array_equal(picture(view), before)


def test_an_effect_that_acts_on_images_is_shown_with_its_depth(view):
    before = picture(view)
    changed(view, lambda: add_effect(view, "ambient_ir"))
    assert picture(view).mean() > before.mean() + 1.0
    assert np.isfinite(picture(view, "disparity")).mean() > 0.3


def test_a_number_out_of_range_is_refused_where_it_is_typed(view):
    type_number(view, "laser_power_mw", 1e6)
    assert "laser_power_mw" not in settings(view)
    assert view.page.value("document.querySelector('[data-name=laser_power_mw] [type=number]').validity.customError")


def test_what_is_saved_is_what_was_shown(view, lab_world, saved_as):
    """model.json, opened again, gives the same picture to the last digit without any slider moved."""
    for name, value in (("laser_power_mw", 75), ("exposure_s", 0.006)):
        changed(view, lambda: type_number(view, name, value))  # noqa: B023
    changed(view, lambda: add_effect(view, "lens_psf"))
    shown = picture(view)
    view.page.click("#save")
    view.page.wait("document.getElementById('saved').textContent !== ''")
    assert view.page.text("#saved") == f"saved: {saved_as}"
    model = read_model(saved_as)
    assert [entry.effect.id for entry in model.effects] == ["lens_psf"]
    assert model.rig.exposure_s == 0.006
    view.key("s")
    view.page.wait(f"document.getElementById('saved').textContent === 'saved: {saved_as.with_name('model-2.json')}'")
    with View(lab_world.capture_path, "--model", saved_as) as again:
        changed(again, lambda: type_number(again, "exposure_s", 0.006))
        assert [e for e in settings(again)["effects"]] == ["lens_psf"]
        assert np.array_equal(picture(again), shown)


def test_wrong_settings_are_told_in_a_line(view):
    told = """(async () => {
        try { await called('simulate', { ...wanted(), settings: %s, page: 1, serial: 1 }); return ''; }
        catch (error) { return error.message; } })()"""
    for wrong, text in (
        ({"gian": 1.0}, "gain"), ({"gain": -1}, "gain is -1"), ({"gain": "1"}, "expected a finite number"),
        ({"effects": {"vignettng": {}}}, "vignetting"), ({"effects": {"vignetting": {"exponent": 99}}}, "0.0..8.0"),
        ({"effects": []}, "JSON object"), ({"materials": {"nothing": {}}}, "material"),
        ({"laser_power_mw": 1e5}, "laser_power_mw"), ({"has_noise": 1}, "true or false"),
    ):  # fmt: skip
        message = view.page.value(told % json.dumps(wrong))
        assert text in message and "\n" not in message, (wrong, message)


def test_a_capture_without_a_scene_is_shown_without_sliders(lab_world, tmp_path):
    folder = tmp_path / "capture"
    shutil.copytree(read_capture(lab_world.capture_path).path, folder)
    scene = json.loads((folder / "capture.json").read_text())["scene"]
    (folder / scene).write_text('{"asset": {"version": "2.0"}, "scenes": [{"nodes": []}], "scene": 0}')
    with View(folder, shown="measured") as view:
        assert view.page.value("document.getElementById('panel').hidden") is True
        view.point(30, 20)
        assert len(view.numbers()) == 5
