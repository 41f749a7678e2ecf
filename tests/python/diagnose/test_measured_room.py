# SPDX-License-Identifier: Apache-2.0
"""A room recorded by the very camera that is judged: effects are put into the recording, before it is measured."""

import json
import re
import shutil
from dataclasses import replace
from functools import cache
from itertools import accumulate
from unittest.mock import patch

import cv2
import numpy as np
import pytest

from activestereo.calibrate.world.cells import Room as Measured
from activestereo.calibrate.world.world import calibrate_world
from activestereo.capture.capture import read_capture
from activestereo.cli import main
from activestereo.diagnose import diagnose
from activestereo.diagnose.room import columns, names
from activestereo.diagnose.room.beside import row_variance
from activestereo.diagnose.room.columns import acting
from activestereo.diagnose.room.evidence import Found
from activestereo.diagnose.room.further import with_turned_view
from activestereo.diagnose.room.names import names_of, reinterpret_as_glare, score_room, with_planned_pair
from activestereo.diagnose.room.plan import Recording
from activestereo.diagnose.words import errors_of
from activestereo.effects import Model, builtin
from chromium import Page, is_installed
from room_worlds import BASELINE_M, BLACK_DN, CX, CY, EXPONENT, F, Room
from schema_check import violations


def gain(dn, side, rng):
    return BLACK_DN + (dn - BLACK_DN) * (1.12 if side == "right" else 0.9)


def rows(dn, side, rng):
    return dn + rng.normal(0.0, 1.0, (len(dn), 1))


def blur(dn, side, rng):
    return cv2.GaussianBlur(dn, (0, 0), 1.5) if side == "right" else dn


def drops(dn, side, rng):
    """The left camera's window is wet in three places."""
    if side == "right":
        return dn
    wet = np.zeros(dn.shape)
    for centre in ((120, 80), (260, 150), (360, 210)):
        cv2.circle(wet, centre, 30, 1.0, -1)
    return dn + cv2.GaussianBlur(wet, (0, 0), 4) * (cv2.GaussianBlur(dn, (0, 0), 3.0) - dn)


def ghost(dn, side, rng):
    """A pane stands a degree off the axis, so that the picture is mirrored beside its centre."""
    return dn + 0.06 * (np.roll(dn[::-1, ::-1], 12, axis=1) - BLACK_DN)


def nothing(dn, side, rng):
    return dn


def _built_in(*names):
    return {name: builtin()[name] for name in names}


def soft(dn, side, rng):
    """Both cameras saturate softly; black level and full scale stay, but a room takes the bend for a black level."""
    x = np.maximum(dn - BLACK_DN, 0.0) / 255.0
    return BLACK_DN + 255.0 * 2.2 * x / (1.0 + 1.2 * x)


def glare(dn, side, rng):
    return dn + 0.12 * (dn.mean() - dn)


def pedestal(dn, side, rng):
    return dn + 3.0


def again(dn, side, rng):
    """Another session, its tripod not quite where it was."""
    return dn


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Folders of what the cameras of two sessions see."""
    first, second = ((0, 0), (14, 3), (-13, -4)), ((0.3, 0.1), (13.8, 3.2), (-13.3, -4.1))
    return [
        Room(turns_deg=turns, exposures=(1.0, 0.85, 1.3), session=session).write(tmp_path_factory.mktemp("room") / "v")
        for session, turns in enumerate((first, second))
    ]


@pytest.fixture(scope="module")
def capture_with(tmp_path_factory, drawn):
    """A function: the folder of a capture that was measured with an effect in the recording."""

    @cache
    def capture(change):
        folder, rng = tmp_path_factory.mktemp(change.__name__), np.random.default_rng(0)
        views = shutil.copytree(drawn[change is again], folder / "views")
        for path in sorted(views.glob("*t/*.png")):
            dn = change(cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(float), path.parent.name, rng)
            cv2.imwrite(str(path), np.rint(np.clip(dn, 0, 255)).astype(np.uint8))
        stated = ["--k", f"{F - 3},{F - 3},{CX + 4},{CY - 3}", "--baseline", str(BASELINE_M)]
        files = ["--depth-scale", "0.0001", "-o", str(folder / "rec")]
        assert main(["import", str(views), "--sensor", "d415", *stated, *files]) == 0
        calibrate_world(folder / "rec", folder / "capture")
        return folder / "capture"

    return capture


def unplanned(capture, **more):
    """A diagnosis but for its plan of further recordings, which takes longer than the rest."""
    with patch("activestereo.diagnose.room.diagnosed.plan_of", lambda seen: [Recording("this", 0.0, {})]):
        return diagnose(capture, **more)


@pytest.fixture(scope="module")
def diagnosed(capture_with):
    """A function: a diagnosis of capture_with(change), made once; with its plan where nothing was put in."""
    return cache(lambda change: (diagnose if change is nothing else unplanned)(capture_with(change)))


@pytest.fixture
def room(capture_with):
    """The room that nothing was put into."""
    return Measured(read_capture(capture_with(nothing)))


@pytest.fixture(scope="module")
def seen(capture_with):
    """The same with the scores of all effects, for tests that change nothing in it."""
    return score_room(Measured(read_capture(capture_with(nothing))), builtin())


@pytest.mark.parametrize(
    "change, also, parameter, truth",
    [
        (nothing, [], None, None),
        (gain, ["gain_mismatch"], "gain", 0.22),
        (rows, ["row_noise"], "sigma_dn", 1.0),
        (blur, ["focus_mismatch"], "sigma_px", 1.5),
        (drops, ["focus_mismatch"], None, None),
        (ghost, ["lens_ghost"], "fraction", 0.06),
    ],
)
def test_what_the_camera_has_is_named_beside_its_own_falloff(diagnosed, change, also, parameter, truth):
    result = diagnosed(change).result
    assert violations(result, "diagnose") == []
    assert result["added"] == ["vignetting", *also]
    assert result["not_predicted"] == [name for name in also if name == "row_noise"]
    assert ("row_noise" in errors_of(result)) == ("row_noise" in also)
    found = {entry["effect"]: entry["parameters"] for entry in result["ranking"]}
    exponent = found["vignetting"]["exponent"]
    assert exponent["value"] == pytest.approx(EXPONENT, abs=0.4)  # a ghost is taken out first
    assert exponent["low"] < EXPONENT < exponent["high"]
    assert result["heldout_ir_rmse_after"] < 0.5 * result["heldout_ir_rmse_before"]
    if parameter is not None:
        assert found[also[0]][parameter]["value"] == pytest.approx(truth, rel=0.15)


def test_the_report_shows_a_view_as_the_others_predict_it(capture_with, diagnosed, tmp_path, monkeypatch, capsys):
    diagnosis = diagnosed(nothing)
    monkeypatch.setattr("activestereo.diagnose.diagnose", lambda *_, **more: diagnosis)
    before, after = diagnosis.unseen
    inner = after.off_axis < 0.3
    rise = [np.nanmean((v.measured - v.expected)[inner]) - np.nanmean((v.measured - v.expected)[~inner])
            for v in (before, after)]  # fmt: skip
    assert rise[0] > 5.0 and abs(rise[1]) < 0.1 * rise[0] and after.rmse_dn < 0.3 * before.rmse_dn
    capsys.readouterr()
    monkeypatch.chdir(tmp_path)
    assert main(["diagnose", str(capture_with(nothing)), "-o", "out", "--workers", "1"]) == 0
    said, page = capsys.readouterr().out, (tmp_path / "out/report.html").read_text()
    assert len(said.replace("\\\n", "").splitlines()) <= 10 and max(map(len, said.splitlines())) <= 80
    assert re.search(r"Not told: \w+ and \d+ more\. Measure: ", said) and "not judged" not in said
    assert all("Errors of each view, predicted by the others: " in " ".join(x.split()) for x in (said, page))
    alts = ["measured", "model", "model with what was found", "measured − model", "what is left"]
    assert re.findall(r'alt="([^"]*)"', page) == [*alts, "the error towards the corners"]
    assert len(re.findall(r"this view [0-9.]+ DN, colours ±[0-9.]+ DN", page)) == 2
    assert "<p>Nothing speaks for " in page and ">0.0<" not in page and "no expected image" not in page
    if is_installed():
        with Page(tmp_path / "out/report.html", size=(1280, 720)) as shown:
            shown.wait("[...document.querySelectorAll('#verdict img')].every((i) => i.complete && i.naturalWidth > 0)")
            assert shown.value("document.getElementById('verdict').getBoundingClientRect().bottom") <= 720


def test_an_effect_is_not_named_at_a_size_that_cannot_be(capture_with):
    most_a_tenth = builtin()["gain_mismatch"]
    narrow = tuple(replace(p, low=-0.1, high=0.1) if p.name == "gain" else p for p in most_a_tenth.parameters)
    effects = builtin() | {most_a_tenth.id: replace(most_a_tenth, parameters=narrow)}
    result = unplanned(capture_with(gain), effects=effects).result
    assert (result["verdict"], result["added"]) == ("undetermined", ["vignetting"])
    assert "gain_mismatch would need gain 0.2" in result["reason"] and "more views" in result["reason"]


def test_drops_on_a_window_are_told_from_a_lens_out_of_focus(diagnosed):
    said = [
        next(e["finding"] for e in diagnosed(change).result["ranking"] if e["effect"] == "focus_mismatch")
        for change in (drops, blur)
    ]
    assert "The left camera is blurred in places" in said[0] and "drops or dirt on its window" in said[0]
    assert "drops" not in said[1]


def test_a_camera_that_lacks_nothing_is_told_so_and_what_would_tell_more(capture_with):
    model = Model().with_effect(builtin()["vignetting"], exponent=EXPONENT)
    result = diagnose(capture_with(nothing), model=model).result
    assert (result["verdict"], result["added"]) == ("none", [])
    told = {name for advice in result["next_measurement"] for name in advice["separates"]}
    assert "response_gamma" in told
    assert sum(result["probabilities"]["named"].values()) + result["probabilities"]["none"] == pytest.approx(1.0)


def test_an_effect_named_beside_a_model_is_in_the_prediction(capture_with):
    model = Model().with_effect(builtin()["vignetting"], exponent=EXPONENT)
    result = unplanned(capture_with(gain), model=model).result
    assert (result["added"], result["not_predicted"]) == (["gain_mismatch"], [])
    assert result["heldout_ir_rmse_after"] <= 0.93 * result["heldout_ir_rmse_before"]


@pytest.mark.parametrize(
    "change, also",
    [(nothing, []), (soft, ["response_gamma"]), (glare, ["veiling_glare"]), (pedestal, ["black_level"])],
)
def test_a_good_session_of_the_same_views_tells_what_one_alone_leaves_open(capture_with, change, also):
    """Alone, a room takes for its own light and black level whatever changes all of its images alike."""
    result = unplanned(capture_with(change), reference=[capture_with(again)]).result
    assert result["added"] == ["vignetting", *also]


def test_a_response_that_two_exposures_told_is_named(capture_with, tmp_path):
    room = shutil.copytree(capture_with(nothing), tmp_path / "room")
    described = json.loads((room / "capture.json").read_text())
    described["measured"]["exposure"]["response_log_exponent"] = -0.15
    (room / "capture.json").write_text(json.dumps(described))
    result = diagnose(room).result
    assert result["added"] == ["vignetting", "response_gamma"]
    assert not any("another exposure" in advice["text"] for advice in result["next_measurement"])
    told = next(e for e in result["ranking"] if e["effect"] == "response_gamma")
    assert told["parameters"]["log_exponent"]["value"] == -0.15 and "Two exposures of one place" in told["finding"]


def test_a_good_session_of_other_views_tells_the_unit_s_own(capture_with, diagnosed, monkeypatch):
    good, alone = capture_with(nothing), diagnosed(gain).result
    monkeypatch.setattr(names, "room_beside", lambda room, other: None)
    beside = unplanned(capture_with(gain), reference=[good]).result
    gained = [{e["effect"]: e["score_nats"] for e in r["ranking"]}["gain_mismatch"] for r in (alone, beside)]
    assert beside["added"] == ["vignetting", "gain_mismatch"] and gained[1] > 1.2 * gained[0]
    assert unplanned(good, reference=[good]).result["added"] == ["vignetting"]


@pytest.mark.parametrize(
    "lifted, is_glare",
    [((-0.15, 0.3), True), ((0.15, -0.3), False), ((-0.3, -0.15), False), ((-1.2, 2.4), False)],
)
def test_black_levels_that_follow_the_views_light_are_glare(seen, lifted, is_glare):
    """Exposures are 1, 0.85 and 1.3 of one room: a quarter of the light, scattered, lifts its views so; twice it is no
    glare."""
    light = np.mean([image.mean() for image in seen.light.seen[:2]])
    told = {f"black_level.{v}": (0.25 * x * light, 0.1) for v, x in enumerate(lifted, 1)}
    found = reinterpret_as_glare(Found(builtin()["black_level"], 7.0, told), seen)
    assert (found is not None) == is_glare
    if found is not None:
        assert found.effect.id == "veiling_glare" and found.nats == 7.0
        assert found.parameters["veiling_glare.fraction"][0] == pytest.approx(0.25, rel=0.4)
    assert reinterpret_as_glare(Found(builtin()["gain_mismatch"], 7.0, told), seen) is None


def test_lifted_views_may_be_glare_or_a_bent_response(seen, monkeypatch):
    """One room cannot tell them apart: two exposures of one place would."""
    light = np.mean([image.mean() for image in seen.light.seen[:2]])
    told = {"black_level.1": (-0.04 * light, 0.1), "black_level.2": (0.08 * light, 0.1)}
    monkeypatch.setattr(names, "score_room", lambda *_: seen)
    monkeypatch.setattr(names, "judged", lambda *a: [Found(builtin()["black_level"], 7.0, told, {"offset_dn": 1.0})])
    found = names.names_of(seen.room, Model(), builtin()).named[0]
    assert set(found.members) == {"veiling_glare", "black_level", "response_gamma"}
    assert found.effect.id == "veiling_glare" and sum(found.members.values()) == pytest.approx(1.0)


def test_what_is_no_reference_is_refused_in_a_line(capture_with):
    capture = capture_with(nothing)
    with pytest.raises(ValueError, match="is no reference: make it with calibrate world from two or more views"):
        diagnose(capture, reference=[capture.parent / "rec"])


@pytest.mark.parametrize(
    "differs, said", [("dots", "its dots correlate 0.[0-3]"), ("lens", "its focal length is 3[45]")]
)
def test_a_session_of_another_unit_is_refused_in_a_line(capture_with, tmp_path, differs, said):
    other = shutil.copytree(capture_with(nothing), tmp_path / "other")
    if differs == "dots":
        path = other / "pattern.png"
        cv2.imwrite(str(path), cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[:, ::-1])
    else:
        described = json.loads((other / "capture.json").read_text())
        described["measured"]["camera"]["f_cx_cy_px"][0] += 10.0
        (other / "capture.json").write_text(json.dumps(described))
    with pytest.raises(ValueError, match=f"other: is of another unit than .*: {said}.*: give a session of the same"):
        diagnose(capture_with(gain), reference=[other])


def test_the_plan_is_of_the_recording_at_hand_and_leaves_no_effect_out(capture_with, capsys, monkeypatch):
    capture = capture_with(nothing)
    capsys.readouterr()
    assert main(["calibrate", "world", str(capture), "--plan", "--json"]) == 0
    this, *plan = json.loads(capsys.readouterr().out)
    views = [r for r in plan if all(r["tells"].values())]
    first = [r for r in plan if r["ends"] is not None]
    assert first == plan[: len(first)] and [r["ends"] for r in first] == list(accumulate(r["minutes"] for r in first))
    assert 5.0 < first[-1]["ends"] <= 10.0 and all(first[-1]["ends"] + r["minutes"] > 10.0 for r in plan[len(first) :])
    assert {"read_noise", "stereo_pitch"} < {name for r in first for name in r["tells"]}
    assert {name for r in (this, *plan) for name in r["tells"]} == {*builtin(), "drops on a window"}
    for recording in (this, *views):
        for name, sizes in recording["tells"].items():
            if name == "drops on a window":
                assert 0.0 < sizes["share"] < 0.05 and 0.5 < sizes["sigma_px"] < 2.0
                continue
            parameters = [p for p in builtin()[name].parameters if p.name in sizes]
            assert parameters and all(0.0 < sizes[p.name] <= p.high for p in parameters), name
            told = this["tells"].get(name, {})
            is_much_less = any(sizes[p.name] < 0.75 * told.get(p.name, 0.0) for p in parameters)
            assert recording is this or is_much_less or all(sizes[p.name] <= p.typical for p in parameters), name
    assert {*this["tells"]["gain_mismatch"]} == {"gain", "offset_dn"}
    monkeypatch.setattr("activestereo.diagnose.room.plan.plan_of", lambda _: [Recording(**r) for r in (this, *plan)])
    assert main(["calibrate", "world", str(capture), "--plan"]) == 0
    said = capsys.readouterr().out
    assert (said.count(" in all): "), said.count("would take longer: ")) == (1 + len(first), len(plan) - len(first))
    assert main(["calibrate", "world", str(capture.parent / "rec"), "--plan"]) == 2
    assert "is no measured room" in capsys.readouterr().err


@pytest.mark.parametrize("cycles", [1.4, 2.6])
def test_a_weak_flicker_is_sought_at_its_own_period(room, cycles):
    """Good units flicker slowly, too: the period is the one that explains the images, not the one least like them."""
    angle = 2.0 * np.pi * cycles * np.arange(room.shape[0])[:, None] / room.shape[0]
    for k, image in enumerate(room.images):
        lit = 1.0 + 0.06 * np.cos(angle + 0.9 + 2.2 * image.view).astype(np.float32)
        room.images[k] = replace(image, dn=BLACK_DN + (image.dn - BLACK_DN) * lit)
    found = names_of(room, Model(()), _built_in("flicker_banding", "black_level"))
    (period,) = found.seen.chosen["flicker_banding"]
    assert 2 * room.shape[0] / period == pytest.approx(cycles, abs=0.25)
    assert {f.effect.id for f in found.named} <= {"flicker_banding"}


def test_a_view_that_was_imagined_lies_where_a_recorded_one_does(room):
    """A take of the first view's own pose sees what that view sees; one that turns sees it turned, and back."""
    seen = score_room(room, _built_in("tangential_distortion", "gain_mismatch"))
    same = with_turned_view(room, seen.light, (0.0, 0.0, 0.0))
    assert (same.views, same.judged, len(same.images)) == (4, 3, 8)
    usable = same.images[6].usable
    ratio = (same.images[6].dn - seen.light.black_dn)[usable] / (room.images[0].dn - seen.light.black_dn)[usable]
    assert np.median(ratio) == pytest.approx(1.0, rel=0.05)
    rolled = with_turned_view(room, seen.light, (0.0, 0.0, 90.0))
    forth, back = rolled.places(2, 6), rolled.places(6, 2)
    column, row = np.meshgrid(np.arange(room.shape[1]), np.arange(room.shape[0]))
    inside = back.seen & (back.read(forth.seen.astype(np.float32)) > 0.99)
    assert inside.mean() > 0.05
    assert np.abs(back.read(forth.column) - column)[inside].max() < 1.0
    assert np.abs(back.read(forth.row) - row)[inside].max() < 1.0
    for effect in ("tangential_distortion", "gain_mismatch"):
        lead = [f"{effect}.{p.name}" for p in builtin()[effect].parameters][0]
        information = [
            float(r.information[j, j]) for r in (seen.scores, with_planned_pair(seen, (0.0, 15.0, 0.0)))
            for j, c in enumerate(r.columns) if c.name == lead
        ]  # fmt: skip
        assert information[1] > information[0]  # more views tell more


def test_a_lens_s_distortion_is_found_at_its_own_size(room):
    """Both cameras of a pair move alike but for a tenth. A fit by each image's own gradients found a quarter."""
    effect = builtin()["tangential_distortion"]
    for k, image in enumerate(room.images):
        moved = acting(effect, {"p1": 0.003}, image.dn, columns.view_of(room, k), 0.0)
        room.images[k] = replace(image, dn=moved.astype(np.float32))
    scores = score_room(room, {effect.id: effect}).scores
    (found,) = names.judged(scores, names.session_spread(scores, names.OF_A_UNIT))
    assert found.parameters["tangential_distortion.p1"][0] == pytest.approx(0.003, rel=0.4)


def test_cells_lie_on_the_same_surface_in_every_image(room):
    assert room.views == 3 and len(room.images) == 6
    back, forth = room.places(4, 0), room.places(0, 4)
    column, row = np.meshgrid(np.arange(room.shape[1]), np.arange(room.shape[0]))
    for truth, returned in ((column, back.column), (row, back.row)):
        there = forth.read(returned)
        inside = forth.seen & (forth.read(back.seen.astype(np.float32)) > 0.99)
        assert inside.mean() > 0.2 and np.abs(there - truth)[inside].max() < 1.0
    assert abs(row_variance(room)[0]) < 0.02
