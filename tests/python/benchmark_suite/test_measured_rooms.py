# SPDX-License-Identifier: Apache-2.0
"""The benchmark that hides effects before a room is measured, on a drawn room."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import measured_rooms
from activestereo.cli import main
from room_worlds import BASELINE_M, CX, CY, F, Room


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
