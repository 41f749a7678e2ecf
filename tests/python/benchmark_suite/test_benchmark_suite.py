# SPDX-License-Identifier: Apache-2.0
"""The benchmark suite: cases, scores, runs, judges, measured rooms."""

import json
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import judges
import measured_rooms
import numpy as np
import pytest
from activestereo.cli import main
from activestereo.diagnose.room.plan import Recording
from room_worlds import BASELINE_M, CX, CY, F, Room
from run_suite import is_wanted, main as run_suite
from suite_score import Result, median, rate, score
from suite_sets import ALL, items

SUITE = Path(__file__).resolve().parents[2] / "benchmark_suite"
STUB = """
import json, sys
names = ("capture.json", "scene.gltf", "pattern.png")
assert all((__import__("pathlib").Path(sys.argv[1]) / n).is_file() for n in names)
answer = {"verdict": "none", "ranking": [], "added": [], "heldout_ir_rmse_before": 3.0, "heldout_ir_rmse_after": 3.0,
          "heldout_noise_floor": 2.9, "next_measurement": []}
open(sys.argv[2] + "/diagnose.json", "w").write(json.dumps(answer))
"""


def entry(effect, family="f", confidence=0.9, equivalent=(), **parameters):
    entries = {name: {"value": v, "low": 0.8 * v, "high": 1.2 * v, "unit": "1"} for name, v in parameters.items()}
    return {
        "effect": effect, "family": family, "score_nats": 10.0, "confidence": confidence, "parameters": entries,
        "equivalent": list(equivalent),
    }  # fmt: skip


def result(truth, verdict, ranking=(), added=(), set_name="single", ratio=1.0, scored=None, strength="strong"):
    key = {
        "id": f"{set_name}-0", "set": set_name, "hidden": dict.fromkeys(truth, {}), "scored": scored or {},
        "infrared": True,
        "strengths": dict.fromkeys(truth, strength), "oracle": {"test": {"ratio": ratio, "floor_dn": 2.0}},
    }  # fmt: skip
    answer = {"verdict": verdict, "ranking": list(ranking), "added": list(added)}
    answer |= {"heldout_ir_rmse_before": 4.0, "heldout_ir_rmse_after": 2.5}
    return Result(key, answer, {"diagnose_s": 10.0})


def test_cases_of_a_set_are_fixed_and_differ_between_sets():
    assert items("single") == items("single")
    everything = items("all")
    for name in ("seed", "anonymous_name"):
        assert len({getattr(item, name) for item in everything}) == len(everything)
    assert sorted(i.id for i in everything) == sorted(i.id for part in ALL for i in items(part))
    assert len(items("small")) == 12
    assert len({name for item in items("single") for name, _ in item.strengths}) >= 25
    assert len(items("none")) >= 100
    assert len(items("pairs")) == 40
    assert items("single")[7].draw() == items("single")[7].draw()


def test_other_generations_are_other_cases_of_the_same_kinds():
    own, other = items("all"), items("all", 1)
    assert [item.strengths for item in own] == [item.strengths for item in other]
    assert not {i.seed for i in own} & {i.seed for i in other} and not {i.id for i in own} & {i.id for i in other}
    codes = {"single": 1, "pairs": 2, "outside": 3, "none": 4, "depth": 5, "wider": 6}
    assert own[0].seed == codes[own[0].set] * 100_000 + own[0].number
    assert is_wanted(own[0], None) and is_wanted(own[0], [own[0].id]) and not is_wanted(own[0], ["no such effect"])
    assert [i.id for i in items("single") if is_wanted(i, ["haze"])] == [f"single-{k:03}" for k in (13, 52, 91, 130)]


def test_an_only_without_a_match_is_an_error_with_the_ids(monkeypatch, tmp_path):
    words = ["--set", "small", "--out", str(tmp_path / "out"), "--only", "none-999", "hase"]
    monkeypatch.setattr(sys, "argv", ["run_suite.py", *words])
    with pytest.raises(SystemExit, match="--only none-999 hase: no test case of the set 'small' has"):
        run_suite()
    assert not list(tmp_path.iterdir())


def test_right_answers_score_one_and_faint_effects_are_not_asked_for():
    right = result({"a"}, "effect", [entry("a", equivalent=["b"], x=1.1)], {"a"}, scored={"a": {"x": 1.0}})
    faint = result({"a"}, "none", ratio=0.2, strength="below")
    measures = score([right, faint])["measures"]
    for name in ("top-1", "top-3", "family", "equivalence set holds the truth", "named and right"):
        assert (measures[name]["value"], measures[name]["n"]) == (1.0, 1)
    assert measures["equivalence set size (median)"]["value"] == 2
    assert measures["parameter error (median)"]["value"] == pytest.approx(0.1)
    assert measures["90 % intervals hold the truth"]["value"] == 1.0
    assert measures["error fall F (median)"]["value"] == pytest.approx(1.0 - (2.5**2 - 2.0**2) / (4.0**2 - 2.0**2))
    assert measures["calibration error (ECE)"]["value"] == pytest.approx(0.1)


def test_a_pair_is_asked_for_where_each_of_it_would_be_seen_alone():
    seen, drowned = (result({"a", "b"}, "effect", [entry("a")], {"a"}, "pairs") for _ in range(2))
    seen.key["oracle"]["alone"], drowned.key["oracle"]["alone"] = {"a": 1.0, "b": 0.6}, {"a": 1.0, "b": 0.3}
    measures = score([seen, drowned])["measures"]
    assert (measures["pairs: both found"]["value"], measures["pairs: both found"]["n"]) == (0.0, 1)


def test_wrong_answers_are_told_apart():
    kin = result({"a"}, "effect", [entry("b"), entry("a", family="f")], {"b"})
    stranger = result({"a"}, "effect", [entry("b", family="g"), entry("c"), entry("d"), entry("a")], {"b"})
    alarm, quiet = result((), "effect", [entry("b")], {"b"}, "none"), result((), "none", set_name="none")
    said, misled = result({"z"}, "unknown", set_name="outside"), result({"z"}, "effect", [entry("b")], {"b"}, "outside")
    both = result({"a", "b"}, "effect", [entry("a")], {"b", "a"}, "pairs")
    one = result({"a", "b"}, "effect", [entry("a")], {"a"}, "pairs")
    twins = result({"a", "b"}, "effect", [entry("a", equivalent=["b"])], {"a"}, "pairs")
    out = score([kin, stranger, alarm, quiet, said, misled, both, one, twins])
    value = {name: m["value"] for name, m in out["measures"].items()}
    assert (value["top-1"], value["top-3"], value["family"]) == (0.0, 0.5, 0.5)
    for name in ("false alarms", "outside the library: said so", "outside the library: wrong name"):
        assert value[name] == 0.5
    assert value["pairs: both found"] == pytest.approx(1 / 3)
    assert value["pairs: each named, or in a name's set"] == pytest.approx(2 / 3)
    assert value["pairs: one of two first"] == 1.0
    assert out["by_strength"]["strong"]["confusion"] == {"a": "b"}


def test_a_measurement_resolves_where_the_truth_alone_is_left():
    first = result({"a"}, "effect", [entry("b", equivalent=["a"])], {"b"})
    assert first.is_ambiguous and not result({"a"}, "effect", [entry("b")], {"b"}).is_ambiguous
    answered, open_still = {"ranking": [entry("a")]}, {"ranking": [entry("a", equivalent=["b"])]}
    measures = score([replace(first, followed={"asked": answered, "random": open_still})])["measures"]
    assert (measures["next measurement resolves"]["value"], measures["a random one resolves"]["value"]) == (1.0, 0.0)


def test_intervals_cover_what_they_say():
    rng = np.random.default_rng(1)
    held = [r["low"] <= 0.9 <= r["high"] for r in (rate(rng.random(40) < 0.9) for _ in range(400))]
    assert 0.91 < np.mean(held) < 0.99
    held = [m["low"] <= 0.0 <= m["high"] for m in (median(rng.standard_normal(30)) for _ in range(400))]
    assert 0.92 < np.mean(held) < 1.0


def test_a_suite_is_run_once_and_resumed(tmp_path):
    stub = tmp_path / "stub.py"
    stub.write_text(STUB)
    out = tmp_path / "suite"
    command = [sys.executable, SUITE / "run_suite.py", "--set", "small", "--limit", "1", "--jobs", "1", "--out", out]
    command += ["--command", f"{sys.executable} {stub} {{capture}} {{out}}"]
    first = subprocess.run(command, capture_output=True, text=True)
    assert first.returncode == 0, first.stdout + first.stderr
    assert "[1/1]" in first.stdout
    assert "false alarms | 0 " in first.stdout
    keys = sorted(path.name for path in (out / "keys").iterdir())
    assert keys == ["none-000.json"]
    assert json.loads((out / "keys" / keys[0]).read_text())["hidden"] == {}
    assert not list((out / "captures").iterdir())
    assert "No misses." in (out / "README.md").read_text()
    again = subprocess.run(command, capture_output=True, text=True)
    assert "1 answered already" in again.stdout and "[1/" not in again.stdout


@pytest.mark.parametrize(("on_rig", "is_right"), [(-0.5, True), (0.5, False)])
def test_a_unit_in_the_room_is_right_only_where_the_second_unit_stands_there(on_rig, is_right):
    named = result(["second_projector"], "effect", [entry("room_projector")], ["room_projector"])
    key = named.key | {"hidden": {"second_projector": {"on_rig": on_rig}}}
    assert replace(named, key=key).right is is_right


def test_noise_is_about_planes_and_a_truth_is_read_without_running_it(tmp_path):
    rng, (v, u) = np.random.default_rng(0), np.mgrid[:200, :200]
    disparity = 40.0 + 0.02 * u - 0.01 * v + rng.normal(0.0, 0.1, u.shape)
    disparity[::20, ::20] += 5.0
    assert judges.noise_px(disparity) == pytest.approx(0.1, rel=0.05)
    assert np.isnan(judges.noise_px(np.zeros((200, 200))))
    truth, depth_mm = disparity.astype("<f4"), np.rint(1000.0 * 50.0 / disparity)
    (tmp_path / "left_disp.pkl").write_bytes(pickle.dumps(truth, protocol=4))
    np.save(tmp_path / "depth.npy", depth_mm.astype(np.uint16))
    assert np.array_equal(judges.disparity_of(tmp_path / "left_disp.pkl", 50.0, u.shape), truth)
    assert np.abs(judges.disparity_of(tmp_path / "depth.npy", 50.0, u.shape) - disparity).max() < 0.025


def test_a_hidden_gain_has_its_row_and_the_plain_room_none(tmp_path, monkeypatch, capsys):
    """The plan's word stands in the rows of all cases before the first one is diagnosed."""
    views = Room(turns_deg=((0, 0), (14, 3)), exposures=(1.0, 0.85)).write(tmp_path / "views")
    stated = ["--k", f"{F},{F},{CX},{CY}", "--baseline", str(BASELINE_M), "--depth-scale", "0.0001"]
    assert main(["import", str(views), "--sensor", "d415", *stated, "-o", str(tmp_path / "rec")]) == 0
    arguments = [str(tmp_path / "out"), str(tmp_path / "rec"), "--kind", "gain", "--strength", "strong"]
    monkeypatch.setattr(sys, "argv", ["measured_rooms.py", *arguments])
    diagnose, settled = measured_rooms.diagnose, []

    def opened(*given, **named):
        settled.append([row["told"] for row in json.loads((tmp_path / "out" / "results.json").read_text())])
        return diagnose(*given, **named)

    monkeypatch.setattr(measured_rooms, "diagnose", opened)
    planned = [Recording("this", 0.0, {})]  # what to record after the diagnosis has tests of its own
    monkeypatch.setattr("activestereo.diagnose.room.diagnosed.plan_of", lambda seen: planned)
    measured_rooms.main()
    assert settled == [[False, True]] * 2
    plain, hidden = json.loads((tmp_path / "out" / "results.json").read_text())
    assert (plain["hidden"], plain["verdict"]) == (None, "silent")
    assert (hidden["hidden"], hidden["named"][0], hidden["verdict"]) == ("gain", "gain_mismatch", "right")
    assert hidden["truth"] == {"excess": 0.2} and 0.0 < hidden["least"]["gain"] < 0.2
    said = "1 of 1 right, 0 in a set, 0 wrong; 1 of 1 that the plan tells; nothing hidden: 1 rooms, 0 with a name"
    assert said in capsys.readouterr().out


@pytest.mark.parametrize(
    "name, truth, told",
    [
        ("drops", {"side": "left", "sigma_px": 3.0, "share": 0.04}, True),
        ("drops", {"side": "left", "sigma_px": 3.0, "share": 0.01}, False),
        ("blur", {"radius_px": 2.2}, True),
        ("blur", {"radius_px": 1.4}, False),
        ("tangential_distortion", {"size": 0.003, "direction_rad": np.pi}, True),
        ("dead_dots", {"share": 0.15}, False),
        ("response", {"compression": 1.0}, False),
    ],
)
def test_the_plan_tells_a_size_or_not(name, truth, told):
    tells = {
        "drops on a window": {"share": 0.0125, "sigma_px": 1.1}, "focus_mismatch": {"sigma_px": 1.03},
        "tangential_distortion": {"p1": 0.004, "p2": 0.0024}, "response_gamma": {"log_exponent": 0.86},
    }  # fmt: skip
    rig = SimpleNamespace(max_dn=255.0)
    capture = SimpleNamespace(frames=[None], rig=rig, ir=lambda frame, side: np.full((2, 2), 60.0))
    assert measured_rooms.is_told(tells, name, truth, capture)[0] == told
