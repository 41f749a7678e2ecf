# SPDX-License-Identifier: Apache-2.0
"""`calibrate drift` on drawn warm-ups: drifts are named, with their truths in the intervals; others are refused."""

import json
import shutil
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from activestereo.cli import main
from activestereo.model import read_model
from command_line import led_on
from room_worlds import BASELINE_M, CX, CY, F, WARM_UP_S, Room, Warm

_FRAMES, _KELVIN = 8, 12.0
_WARM = lambda frame: {"temperature_c": 27.0 + frame["id"]}  # noqa: E731
CELSIUS = 27.0 + _KELVIN * (1.0 - np.exp(-np.arange(_FRAMES) / 3.0))


def warm_up(folder: Path, **per_k: float) -> Path:
    """The capture of a warm-up with drifts per kelvin, beside its temperatures.csv and what import said."""
    warm = CELSIUS - CELSIUS[0]
    cx, focal, pattern, power = (per_k.get(name, 0.0) for name in ("cx_px_per_k", "focal_per_k", "pattern", "power"))
    states = [Warm(cx * k, focal * k, pattern * k, float(np.exp(power * k))) for k in warm]
    Room(turns_deg=((0, 0),), exposures=(1.0,)).write_warm_up(folder / "views", states, off=2)
    stated = ["--k", f"{F},{F},{CX},{CY}", "--baseline", str(BASELINE_M), "--sensor", "d415"]
    with (folder / "said.txt").open("w") as said, redirect_stdout(said):
        assert main(["import", str(folder / "views"), *stated, "-o", str(folder / "capture")]) == 0
    rows = [f"{WARM_UP_S + 75 * k},{c}" for k, c in enumerate(CELSIUS)]
    (folder / "temperatures.csv").write_text("\n".join(rows) + "\n")
    described = json.loads((folder / "capture" / "capture.json").read_text())
    for frame in described["frames"]:
        frame["exposure_s"] *= 1.0 + 1e-5 * frame["id"]  # a camera's metadata jitters
    (folder / "capture" / "capture.json").write_text(json.dumps(described))
    return folder / "capture"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A function: the capture of a warm-up with drifts, drawn once."""
    return cache(lambda **drifts: warm_up(tmp_path_factory.mktemp("warm"), **drifts))


@pytest.mark.parametrize(
    "hidden, truth",
    [
        ({}, {}),
        ({"cx_px_per_k": 0.012, "focal_per_k": -4e-5},
         {"thermal_drift.cx_px_per_k": 0.012, "thermal_drift.focal_per_k": -4e-5}),
        ({"pattern": -7e-5, "power": 0.006}, {"pattern_scale_drift.per_k": -7e-5, "laser_power_drift.per_k": 0.006}),
    ],
)  # fmt: skip
def test_what_drifts_is_named_and_what_stays_is_not(drawn, tmp_path, capsys, hidden, truth):
    capture, model = drawn(**hidden), tmp_path / "model.json"
    given = ["--temperatures", str(capture.parent / "temperatures.csv"), "-o", str(model)]
    assert main(["calibrate", "drift", str(capture), *given]) == 0
    end = capsys.readouterr().out
    assert led_on(end[end.index("effects in") :]) == [["model", "show", str(model)]]
    said = end.split("moves with temperature")[0]
    assert all(name in said for name in truth) and ("nothing" in said) == (not truth)
    found = {f"{e.effect.id}.{name}": q for e in read_model(model).effects for name, q in e.parameters.items()}
    assert {name.split(".")[0] for name in found} == {name.split(".")[0] for name in truth}
    for name, value in truth.items():
        half = (found[name].high - found[name].low) / 2
        assert abs(found[name].value - value) < half < 0.15 * abs(value), (name, found[name])


def test_import_sends_a_warm_up_to_calibrate_drift(drawn):
    assert "next: activestereo calibrate drift" in (drawn().parent / "said.txt").read_text()


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda frames: [f for f in frames if f["projector_power"] > 0], "no frame has the projector off"),
        (lambda frames: [f | {"temperature_c": 30.0} for f in frames], "frames span 0 K"),
        (lambda frames: [f | _WARM(f) | {"exposure_s": 0.008 / (1 + f["id"] % 2)} for f in frames], "0.004 to 0.008 s"),
        (
            lambda frames: [
                f | _WARM(f) | ({"left": f["right"], "right": f["left"]} if f["id"] == 5 else {}) for f in frames
            ],
            "still view",
        ),
        (lambda frames: [f | {"temperature_c": None} for f in frames], "0 frames with dots have a temperature"),
    ],
)
def test_what_tells_no_drift_is_refused(drawn, tmp_path, capsys, change, said):
    capture = shutil.copytree(drawn(), tmp_path / "capture")
    described = json.loads((capture / "capture.json").read_text())
    described["frames"] = change(described["frames"])
    (capture / "capture.json").write_text(json.dumps(described))
    assert main(["calibrate", "drift", str(capture), "-o", str(tmp_path / "model.json")]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    (tmp_path / "kelvin.csv").write_text("0,298\n9,310\n")
    given = "--temperatures", str(tmp_path / "kelvin.csv"), "-o", str(tmp_path / "model.json")
    assert main(["calibrate", "drift", str(capture), *given]) == 2
    assert "kelvin.csv: a temperature is 298, expected" in capsys.readouterr().err
    assert not (tmp_path / "model.json").exists()
