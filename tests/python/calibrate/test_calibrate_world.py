# SPDX-License-Identifier: Apache-2.0
"""`calibrate world` on drawn rooms: the truth lies in its intervals; what cannot be measured is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from room_worlds import BALLS, BASELINE_M, CX, CY, EXPONENT, HEIGHT, PLACE_M, WIDTH, F, Room

from activestereo.calibrate.world.joint import joint_covariance, read_covariance
from activestereo.calibrate.world.light import black_level, light_view, response_of
from activestereo.calibrate.world.pattern import PatternEstimate
from activestereo.calibrate.world.poses import group_views
from activestereo.calibrate.world.views import SceneView, read_views
from activestereo.calibrate.world.world import calibrate_world
from activestereo.capture.capture import read_capture
from activestereo.capture.capture_json import CaptureError
from activestereo.cli import main
from activestereo.scene_io.scene_files import read_document

NOMINAL = f"{F - 3},{F - 3},{CX + 4},{CY - 3}"


def recording(folder: Path, room: Room) -> Path:
    room.write(folder / "views")
    out = folder / "rec"
    main(
        ["import", str(folder / "views"), "--sensor", "d415", "--k", NOMINAL, "--baseline", str(BASELINE_M),
         "--depth-scale", "0.0001", "-o", str(out)]
    )  # fmt: skip
    return out


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    rec = recording(folder, Room())
    lines = calibrate_world(rec, folder / "capture", test=[3])
    return read_capture(folder / "capture"), lines


def within(value, truth, sd, sigmas=3.5):
    return abs(value - truth) <= sigmas * sd


def test_the_camera_is_found_within_its_interval(measured):
    capture, _ = measured
    camera = capture.measured["camera"]
    assert capture.name == capture.path.name == "capture" and camera["from"] == "overlaps"
    sd = np.sqrt(np.diag(camera["covariance_px2"]))
    assert sd.max() < 1.5
    for value, truth, s in zip(camera["f_cx_cy_px"], (F, CX, CY), sd, strict=True):
        assert within(value, truth, s), (camera, sd)
    assert capture.rig.left.K[0, 0] == camera["f_cx_cy_px"][0]


def test_poses_are_those_of_the_tripod(measured):
    capture, _ = measured
    room = Room()
    first = room.pose(0)
    for frame in capture.frames:
        error = np.linalg.inv(np.linalg.inv(first) @ room.pose(frame.id)) @ frame.camera_to_world
        assert np.linalg.norm(error[:3, 3]) < 1.5e-3
        assert np.degrees(np.linalg.norm(cv2.Rodrigues(error[:3, :3])[0])) < 0.3  # a turn trades with the centre
    assert capture.measured["poses"]["distance_m"] < 1e-3
    # Differences between views would else be taken for noise, and every model for one at the floor.
    assert capture.repeats() == []


def test_the_projector_stands_where_it_is(measured):
    capture, _ = measured
    pattern = capture.measured["pattern"]
    assert np.abs(np.subtract(pattern["place_m"], PLACE_M)[:2]).max() < 1e-3, pattern
    assert min(pattern["left_out_r"].values()) > 0.4


def test_falloff_and_exposures_are_told_apart(measured):
    capture, _ = measured
    light = capture.measured["exposure"]
    n, sd = light["vignetting_exponent"]
    assert abs(n - EXPONENT) < 1.645 * sd and sd < 0.8, (n, sd)
    assert light["log_scatter"][1] < 0.3 * light["log_scatter"][0]
    times = [light["exposure_s"][str(k)] for k in range(4)]
    for found, truth in zip(np.array(times) / times[0], Room().exposures, strict=True):
        assert abs(found / truth - 1.0) < 0.05


def test_black_levels_lie_in_their_intervals(tmp_path):
    """Nothing in a drawn room is black: its darkest surfaces end 2 to 3 DN above, at another count in each view."""
    errors = []
    for seed in (11, 12, 13, 14):
        room = Room(turns_deg=((0, 0), (14, 3)), exposures=(1.0, 0.85), seed=seed)
        rec, out = recording(tmp_path / str(seed), room), tmp_path / f"{seed}" / "capture"
        calibrate_world(rec, out, steps=("camera", "poses", "pattern", "exposure"))
        level, deviation = read_capture(out).rig.black_dn
        assert deviation < 2.0
        errors.append((level - 4.0) / deviation)
    assert np.sum(np.abs(errors) < 1.645) >= 3 and np.sqrt(np.mean(np.square(errors))) < 1.3, errors


def test_the_held_out_view_is_no_part_of_the_scene(measured):
    capture, _ = measured
    assert [f.split for f in capture.frames] == ["train", "train", "train", "test"]
    assert "3" not in capture.measured["pattern"]["left_out_r"]
    document = read_document(capture.scene_path)
    assert [m["name"] for m in document["materials"]] == ["view 0", "view 1", "view 2"]
    assert document["asset"]["extras"] == {"room_light": "emission"}
    known = capture.known(capture.frames[3], "left")
    assert 0.2 < known.mean() < 0.95


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("one frame", "one view with depth: record two or more"),
        ("no depth", "no frame has depth"),
        ("foreign depth", "depth does not belong to the pair"),
        ("no overlap", "no two of its 2 views overlap"),
        ("a scene that moves", "the scene moves|no two of its 2 views overlap"),
        ("one place", "its 2 views look the same way from one place: turn the camera by 10 to 30 degrees"),
        ("saturated", "is saturated"),
        ("dots off", "no dots"),
    ],
)
def test_what_cannot_be_measured_is_refused(tmp_path, what, said):
    apart, moved = ((-32, 0), (32, 0)), [((x + 0.12, y - 0.1, z - 0.15), r * 1.15) for (x, y, z), r in BALLS]
    changes = {
        "one frame": {"turns_deg": ((0, 0),), "exposures": (1.0,)},
        "no overlap": {"turns_deg": apart}, "foreign depth": {"turns_deg": apart},
        "a scene that moves": {"turns_deg": ((0, 0), (3, 0)), "balls": {1: moved}},
        "one place": {"turns_deg": ((0, 0), (0.5, 0))}, "saturated": {"exposures": (40.0, 40.0)},
        "dots off": {"dots_dn": 0.0},
    }  # fmt: skip
    usual = {"turns_deg": ((0, 0), (10, 0)), "exposures": (1.0, 1.0)}
    rec = recording(tmp_path, Room(**(usual | changes.get(what, {}))))
    described = json.loads((rec / "capture.json").read_text())
    if what == "no depth":
        for frame in described["frames"]:
            del frame["depth"]
    if what == "foreign depth":
        first, second = (frame["depth"] for frame in described["frames"])
        described["frames"][0]["depth"], described["frames"][1]["depth"] = second, first
    (rec / "capture.json").write_text(json.dumps(described))
    with pytest.raises(ValueError, match=said) as caught:
        calibrate_world(rec, tmp_path / "capture")
    assert "\n" not in str(caught.value)
    kept = "which could be measured, in" in str(caught.value)
    assert kept == (what in ("no overlap", "a scene that moves", "one place", "dots off")), caught.value
    assert (tmp_path / "capture").exists() == kept
    if kept:
        assert "camera" in read_capture(tmp_path / "capture").measured


def test_a_board_that_moved_between_views_is_told_from_views_apart(tmp_path):
    class Moving(Room):
        def write(self, folder):
            super().write(folder)
            texture = cv2.GaussianBlur(np.random.default_rng(0).normal(size=(230, 220)), (0, 0), 2.0)
            board = np.clip(60 + 250 * texture, 5, 200).astype(np.uint8)
            for k, x in enumerate((60, 230)):
                depth = 1e4 * F * BASELINE_M / 26
                for name, at, drawn in (("left", x, board), ("right", x - 26, board), ("depth", x, depth)):
                    path = str(folder / name / f"{k:03d}.png")
                    image = cv2.imread(path, cv2.IMREAD_UNCHANGED)
                    image[20:250, at : at + 220] = drawn
                    cv2.imwrite(path, image)
            return folder

    rec = recording(tmp_path, Moving(turns_deg=((0, 0), (6, 0)), exposures=(1.0, 1.0)))
    with pytest.raises(ValueError, match=r"the scene moves: [3-7]\d % of what frames 0 and 1 both see lies elsewhere"):
        calibrate_world(rec, tmp_path / "capture", steps=["poses"])


def test_gaps_of_dead_dots_that_ride_along_are_no_place(tmp_path):
    room = Room(turns_deg=((0, 0), (10, 3)), exposures=(1.0, 1.0))
    views, _ = read_views(read_capture(recording(tmp_path, room)))
    rng, gaps = np.random.default_rng(0), np.ones((HEIGHT, WIDTH), np.float32)
    for u, v in rng.uniform(0, (WIDTH, HEIGHT), (1500, 2)).astype(int):
        cv2.circle(gaps, (int(u), int(v)), 3, 0.3, -1)
    views = [replace(view, left=view.left * gaps) for view in views]
    _, overlaps, groups = group_views(views, np.array([[F, 0, CX], [0, F, CY], [0, 0, 1]]))
    assert groups == [[0, 1]]
    truth = np.linalg.inv(room.pose(1)) @ room.pose(0)
    assert np.allclose(overlaps[0].a_to_b, truth, atol=5e-3)


def test_views_of_which_much_is_saturated_are_told_and_one_that_is_whole_is_left_out(tmp_path):
    room = Room(turns_deg=((0, 0), (10, 0), (-8, 2)), exposures=(1.0, 40.0, 6.0))
    views, told = read_views(read_capture(recording(tmp_path, room)))
    assert [view.frame.id for view in views] == [0, 2]
    left_out, partly = told
    assert "frame 1" in left_out and "less exposure, gain or laser power" in left_out
    assert re.fullmatch(r"\d+ % of frame 2's left image is saturated \(255 DN\) .* less exposure, .*", partly)


def test_exposures_and_albedo_are_steps_of_their_own(measured, tmp_path):
    capture, _ = measured
    assert main(["calibrate", "exposure", str(capture.path), "-o", str(tmp_path / "exposed")]) == 0
    assert main(["calibrate", "albedo", str(tmp_path / "exposed"), "-o", str(tmp_path / "whole")]) == 0
    again = read_capture(tmp_path / "whole")
    for before, after in zip(capture.frames, again.frames, strict=True):
        times = [frame.exposure_s / own.frames[0].exposure_s for frame, own in ((before, capture), (after, again))]
        assert times[1] == pytest.approx(times[0], rel=0.02)
        same = capture.known(before, "left") == again.known(after, "left")
        assert same.mean() > 0.999
    assert again.rig.black_dn == pytest.approx(capture.rig.black_dn, abs=0.5)
    assert {"camera", "poses", "pattern", "exposure", "albedo"} <= set(again.measured)
    assert (tmp_path / "exposed" / "measured" / "exposure.png").is_file()
    assert (tmp_path / "whole" / "measured" / "albedo.png").is_file()


def test_counts_that_end_abruptly_are_the_black_level():
    rng = np.random.default_rng(4)
    light = rng.gamma(1.0, 3.0, (200, 300))
    ends = np.rint(np.maximum(light + 4.0, 4.0)).astype(np.float32)
    thins_out = np.rint(rng.normal(30.0, 4.0, (200, 300))).astype(np.float32)
    view = SceneView(None, ends, ends, ends, ends > 0)
    assert black_level([view]) == (4.0, pytest.approx(0.4))
    blurred = cv2.GaussianBlur(ends + rng.normal(0.0, 0.4, ends.shape).astype(np.float32), (0, 0), 0.6)
    level, deviation = black_level([replace(view, left=blurred, right=blurred)])
    assert within(level, 4.0, deviation)
    # Views that end at counts of their own, at the light of their darkest surfaces, show no floor.
    level, deviation = black_level([replace(view, left=ends + dark, right=ends + dark) for dark in (1.0, 2.0, 4.0)])
    assert deviation > 2.0 and within(level, 4.0, deviation)
    level, deviation = black_level([replace(view, left=thins_out, right=thins_out)])
    assert deviation > 4.0 and level < 12.0


@pytest.mark.parametrize("exponent", [1.0, 0.85])
def test_two_exposures_of_one_place_tell_response_and_black_level(exponent):
    """The scene does not matter; a view of another place tells neither."""
    rng = np.random.default_rng(5)
    light, elsewhere = (cv2.GaussianBlur(rng.uniform(0.0, 600.0, (120, 160)), (0, 0), 2.0) for _ in range(2))

    def view(light, exposure):
        dn = np.rint(4.0 + 230.0 * (light * exposure / 600.0) ** exponent + rng.normal(0.0, 0.4, light.shape))
        dn = dn.astype(np.float32)
        return SceneView(SimpleNamespace(exposure_gain=exposure), dn, dn, dn, dn > 0)

    views = [view(light, 1.0), view(elsewhere, 0.5)]
    assert response_of(views, 255) is None and response_of([view(light, 1.0)] * 2, 255) is None
    found, black_dn = response_of([*views, view(light, 0.5)], 255)
    assert found == pytest.approx(np.log(exponent), abs=0.01) and black_dn == pytest.approx(4.0, abs=0.5)


def test_the_squares_of_a_board_are_not_taken_for_dots():
    rng, shape, K = np.random.default_rng(0), (160, 320), np.array([[200.0, 0, 159.5], [0, 200.0, 79.5], [0, 0, 1.0]])
    dots = cv2.GaussianBlur(rng.normal(size=shape).astype(np.float32), (0, 0), 1.2)
    dots /= dots.std()
    row, column = np.indices(shape)
    albedo = np.where((row // 19 + column // 19) % 2 + (column < 160), 1.0, 0.2)  # a wall, and a board right of it
    image = (4.0 + albedo * (60.0 + 5.0 * dots) + rng.normal(0.0, 0.5, shape)).astype(np.float32)
    depth = np.ones(shape, np.float32)
    pattern = PatternEstimate(dots, K, np.zeros(3), np.eye(3), {})
    light = light_view(SceneView(None, image, image, depth, depth > 0), K, pattern)
    assert light.amplitude[30:-30, 30:130].mean() == pytest.approx(5.0, rel=0.1)
    assert light.amplitude[30:-30, 190:-30].std() < 0.3 * 0.6 * 5.0  # squares of 48 DN, dots of 3 DN in the mean


@pytest.mark.parametrize(
    "covariance", [np.diag([1.0, 1.0, -0.5]), np.ones((3, 3)), np.eye(2), [[1, 2, 0], [0, 1, 0], [0, 0, 1]]]
)
def test_a_covariance_that_is_none_is_refused_in_a_line(covariance):
    with pytest.raises(CaptureError, match="covariance_px2: is no covariance .* step camera again"):
        read_covariance(covariance, 3, "camera", "covariance_px2")


def test_one_covariance_of_all_that_was_measured_goes_on(measured):
    """Its deviations are those that the steps state; a black level, or a centre, that is off moves others along."""
    capture, _ = measured
    names, covariance = joint_covariance(capture)
    sd = dict(zip(names, np.sqrt(np.diag(covariance)), strict=True))
    light, camera = capture.measured["exposure"], capture.measured["camera"]
    assert sd["falloff"] == pytest.approx(light["vignetting_exponent"][1])
    assert sd["black"] == pytest.approx(light["black_dn"][1])
    assert sd["focal length"] == pytest.approx(np.sqrt(camera["covariance_px2"][0][0]) / camera["f_cx_cy_px"][0])
    correlation = covariance / np.outer(list(sd.values()), list(sd.values()))
    of = lambda one, other: correlation[names.index(one), names.index(other)]  # noqa: E731
    assert of("black", "falloff") > 0.3 and abs(of("black", "cx")) < 1e-9
    assert {f"{what} {axis} {k}" for what in ("turn", "move") for axis in "xyz" for k in (1, 2, 3)} < {*names}
    assert {"exposure 1", "exposure 2", "right row", "projector x"} < {*names}
