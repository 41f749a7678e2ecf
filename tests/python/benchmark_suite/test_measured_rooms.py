# SPDX-License-Identifier: Apache-2.0
"""The benchmark that hides effects before a room is measured, on a drawn room."""

import json
import sys

import measured_rooms
from activestereo.cli import main
from room_worlds import BASELINE_M, CX, CY, F, Room


def test_a_hidden_gain_has_its_row_and_the_plain_room_none(tmp_path, monkeypatch, capsys):
    views = Room(turns_deg=((0, 0), (14, 3), (-13, -4)), exposures=(1.0, 0.85, 1.3)).write(tmp_path / "views")
    stated = ["--k", f"{F},{F},{CX},{CY}", "--baseline", str(BASELINE_M), "--depth-scale", "0.0001"]
    assert main(["import", str(views), "--sensor", "d415", *stated, "-o", str(tmp_path / "rec")]) == 0
    arguments = [str(tmp_path / "out"), str(tmp_path / "rec"), "--kind", "gain", "--strength", "strong"]
    monkeypatch.setattr(sys, "argv", ["measured_rooms.py", *arguments])
    measured_rooms.main()
    plain, hidden = json.loads((tmp_path / "out" / "results.json").read_text())
    assert (plain["hidden"], plain["verdict"]) == (None, "silent")
    assert (hidden["hidden"], hidden["named"][0], hidden["verdict"]) == ("gain", "gain_mismatch", "right")
    assert hidden["truth"] == {"excess": 0.2}
    assert "1 of 1 right, 0 wrong; nothing hidden: 1 rooms, 0 with a name" in capsys.readouterr().out
