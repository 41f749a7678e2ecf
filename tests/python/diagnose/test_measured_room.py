# SPDX-License-Identifier: Apache-2.0
"""A room recorded by the very camera that is judged: effects are put into the recording, before it is measured."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import activestereo.report
from activestereo.calibrate.world.cells import Room as Measured
from activestereo.calibrate.world.world import calibrate_world
from activestereo.capture.capture import read_capture
from activestereo.cli import main
from activestereo.diagnose import diagnose
from activestereo.diagnose.room.plan import PLAN, recordings_for
from activestereo.diagnose.room.rows import row_variance
from activestereo.effects import Model, builtin
from room_worlds import BASELINE_M, BLACK_DN, CX, CY, EXPONENT, F, Room
from schema_check import violations


def gain(dn, side, rng):
    return BLACK_DN + (dn - BLACK_DN) * (1.12 if side == "right" else 0.9)


def rows(dn, side, rng):
    return dn + rng.normal(0.0, 1.0, (len(dn), 1))


def blur(dn, side, rng):
    return cv2.GaussianBlur(dn, (0, 0), 1.0) if side == "right" else dn


def nothing(dn, side, rng):
    return dn


@pytest.fixture(scope="module")
def capture_with(tmp_path_factory):
    """A function: the folder of a capture that was measured with an effect in the recording."""
    made = {}

    def capture(change):
        if change not in made:
            folder, rng = tmp_path_factory.mktemp(change.__name__), np.random.default_rng(0)
            views = Room(turns_deg=((0, 0), (14, 3), (-13, -4)), exposures=(1.0, 0.85, 1.3)).write(folder / "views")
            for path in sorted(views.glob("*t/*.png")):
                dn = change(cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(float), path.parent.name, rng)
                cv2.imwrite(str(path), np.rint(np.clip(dn, 0, 255)).astype(np.uint8))
            stated = ["--k", f"{F - 3},{F - 3},{CX + 4},{CY - 3}", "--baseline", str(BASELINE_M)]
            files = ["--depth-scale", "0.0001", "-o", str(folder / "rec")]
            assert main(["import", str(views), "--sensor", "d415", *stated, *files]) == 0
            calibrate_world(folder / "rec", folder / "capture")
            made[change] = folder / "capture"
        return made[change]

    return capture


@pytest.mark.parametrize(
    "change, also, parameter, truth",
    [
        (nothing, [], None, None),
        (gain, ["gain_mismatch"], "gain", 0.22),
        (rows, ["row_noise"], "sigma_dn", 1.0),
        (blur, ["focus_mismatch"], None, None),
    ],
)
def test_what_the_camera_has_is_named_beside_its_own_falloff(capture_with, change, also, parameter, truth):
    result = diagnose(capture_with(change)).result
    schema = Path(activestereo.report.__file__).parent / "schema" / "diagnose.schema.json"
    assert violations(result, json.loads(schema.read_text())) == []
    assert result["added"] == ["vignetting", *also]
    found = {entry["effect"]: entry["parameters"] for entry in result["ranking"]}
    assert found["vignetting"]["exponent"]["value"] == pytest.approx(EXPONENT, abs=1.2)
    assert result["heldout_ir_rmse_after"] < 0.5 * result["heldout_ir_rmse_before"]
    if parameter is not None:
        assert found[also[0]][parameter]["value"] == pytest.approx(truth, rel=0.15)


def test_a_camera_that_lacks_nothing_is_told_so_and_what_would_tell_more(capture_with):
    model = Model().with_effect(builtin()["vignetting"], exponent=EXPONENT)
    result = diagnose(capture_with(nothing), model=model).result
    assert (result["verdict"], result["added"]) == ("none", [])
    told = {name for advice in result["next_measurement"] for name in advice["separates"]}
    assert "response_gamma" in told
    assert sum(result["probabilities"]["named"].values()) + result["probabilities"]["none"] == pytest.approx(1.0)


def test_a_good_session_of_the_unit_tells_what_one_alone_leaves_open(capture_with):
    good, alone = capture_with(nothing), diagnose(capture_with(gain)).result
    beside = diagnose(capture_with(gain), reference=[good]).result
    gained = [{e["effect"]: e["score_nats"] for e in r["ranking"]}["gain_mismatch"] for r in (alone, beside)]
    assert beside["added"] == ["vignetting", "gain_mismatch"] and gained[1] > 1.3 * gained[0]
    assert diagnose(good, reference=[good]).result["added"] == ["vignetting"]


def test_what_is_no_reference_is_refused_in_a_line(capture_with):
    capture = capture_with(nothing)
    with pytest.raises(ValueError, match="is no reference: make it with calibrate world from two or more views"):
        diagnose(capture, reference=[capture.parent / "rec"])


def test_the_plan_fits_ten_minutes_and_names_effects_of_the_library(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", "world", "--plan"])
    said = capsys.readouterr().out
    assert ended.value.code == 0 and said.count("\n") == len(PLAN) + 1
    assert sum(recording.minutes for recording in PLAN) <= 10.0
    assert {name for recording in PLAN for name in recording.tells} <= set(builtin())
    assert [own for _, own in recordings_for(["response_gamma", "lens_psf"])] == [("response_gamma",), ("lens_psf",)]


def test_cells_lie_on_the_same_surface_in_every_image(capture_with):
    room = Measured(read_capture(capture_with(nothing)))
    assert room.views == 3 and len(room.images) == 6
    back, forth = room.places(4, 0), room.places(0, 4)
    column, row = np.meshgrid(np.arange(room.shape[1]), np.arange(room.shape[0]))
    for truth, returned in ((column, back.column), (row, back.row)):
        there = forth.read(returned)
        inside = forth.seen & (forth.read(back.seen.astype(np.float32)) > 0.99)
        assert inside.mean() > 0.2 and np.abs(there - truth)[inside].max() < 1.0
    assert abs(row_variance(room)[0]) < 0.02
