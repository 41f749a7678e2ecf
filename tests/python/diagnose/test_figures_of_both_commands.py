# SPDX-License-Identifier: Apache-2.0
"""diagnose tells of the given model, and of the model that it writes, what compare tells of them in any folder."""

import json
import shutil
from contextlib import redirect_stdout
from dataclasses import replace
from functools import partial
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.capture.images import read_gray
from activestereo.capture.write import write_capture
from activestereo.cli import main
from activestereo.compare.cache import LayerCache
from activestereo.compare.effect_trials import trial_capture
from activestereo.compare.engine_prediction import engines_of
from activestereo.compare.nuisances import Nuisances
from activestereo.diagnose import diagnose
from activestereo.effects import Model, builtin
from activestereo.effects.engines import CaptureRenderer, SceneMeasurement
from activestereo.model import diagnosed_model, read_model, write_model
from activestereo.report.screen import Step
from activestereo.report.write import write_diagnosis, write_diagnosis_report

FEW = {name: builtin()[name] for name in ("vignetting", "response_gamma", "gain_mismatch")}
SETTINGS = {"samples_per_pixel": 16, "max_bounces": 1, "seed": 3}
SAMPLING = tuple(SETTINGS.values())
NOISE_DN = 3.0


def recorded(folder: Path, hidden: Model) -> Path:
    """A small capture by a sensor with hidden effects: a view that is repeated, and a frame that is held out."""
    nominal = trial_capture(folder, scale=0.5)
    first, second = nominal.frames
    frames = *(replace(first, id=n, repeat_group=0) for n in (0, 1)), replace(second, id=2, split="test")
    nominal = replace(nominal, frames=frames)
    light = CaptureRenderer("auto", *SAMPLING)
    scales, measured = Nuisances(120000.0, 9000.0, 5.0), SceneMeasurement((0.002, 0.002), {1: 1.1})
    images, rng = light.expected(nominal, hidden, scales, scene_measurement=measured), np.random.default_rng(1)
    noisy = {key: np.rint(dn + NOISE_DN * rng.standard_normal(dn.shape)) for key, dn in images.items()}
    noisy = {key: np.clip(dn, 0, 255).astype(np.uint8) for key, dn in noisy.items()}
    write_capture(folder / "capture", nominal, noisy, read_gray(nominal.rig.projector.pattern_path))
    return folder / "capture"


def compared(capture: Path, out: Path, model: Path | None = None) -> dict[str, float]:
    samples, bounces, seed = map(str, SAMPLING)
    words = ["compare", str(capture), "--out", str(out), "--spp", samples, "--max-bounces", bounces, "--seed", seed]
    out.mkdir()
    with redirect_stdout(StringIO()) as said:
        assert main([*words, "--json", *([] if model is None else ["--model", str(model)])]) == 0
    told = json.loads(said.getvalue())
    assert told == json.loads((out / "compare.json").read_text())
    return told["ir"]


@pytest.mark.parametrize("starts_from", ["nothing", "a model"])
def test_diagnose_and_compare_tell_the_same_figures(tmp_path, starts_from):
    hidden, start = Model().with_effect(FEW["vignetting"], exponent=2.0), None
    if starts_from == "nothing":
        hidden = hidden.with_effect(FEW["gain_mismatch"], gain=0.15)
    capture = recorded(tmp_path, hidden)
    if starts_from == "a model":
        start = tmp_path / "start.json"
        model = Model().with_effect(FEW["gain_mismatch"], gain=0.02)
        write_model(start, diagnosed_model(read_capture(capture), model, {"focal_left": 0.001, "focal_right": 0.0}))
    model = None if start is None else read_model(start)
    diagnosis = diagnose(capture, model, FEW, workers=1, engines=engines_of("auto", *SAMPLING), **SETTINGS)
    write_diagnosis(diagnosis, tmp_path / "diagnosis")
    said = json.loads((tmp_path / "diagnosis" / "diagnose.json").read_text())
    assert said["added"] == ["vignetting", "gain_mismatch"][: 1 + (starts_from == "nothing")]
    before = compared(capture, tmp_path / "before", start)
    after = compared(capture, tmp_path / "elsewhere", tmp_path / "diagnosis" / "model.json")
    # a BLAS may add in another order where an array begins elsewhere in memory: the last digits differ
    same = partial(pytest.approx, rel=1e-12)
    assert said["heldout_ir_rmse_before"] == same(before["test"]["rmse_dn"])
    assert said["heldout_ir_rmse_after"] == same(after["test"]["rmse_dn"])
    assert said["heldout_noise_floor"] == same(after["test"]["noise_floor_dn"])
    assert said["train_noise_floor"] == same(after["train"]["noise_floor_dn"])
    assert [step["effects"] for step in said["curve"]] == [[], said["added"]]
    for step, told in ((said["curve"][0], before), (said["curve"][-1], after)):
        assert step["heldout_ir_rmse"] == same(told["test"]["rmse_dn"])
        assert step["train_ir_rmse"] == same(told["train"]["rmse_dn"])
    left, had = (figures["test"]["explainable_rmse_dn"] for figures in (after, before))
    assert left < 0.2 * had


def test_a_diagnosis_is_kept_whole_but_with_an_effect_of_a_users_own(tmp_path, monkeypatch):
    hidden = Model().with_effect(FEW["vignetting"], exponent=2.0)
    capture, cache, said = recorded(tmp_path, hidden), LayerCache(tmp_path / "cache"), []

    def told(effects):
        engines = lambda seen: CaptureRenderer("auto", *SAMPLING)  # noqa: E731
        return diagnose(capture, None, effects, cache=cache, engines=engines, says=said.append, **SETTINGS)

    first = told(FEW)
    monkeypatch.setattr("activestereo.diagnose.diagnosis.examine", lambda *given: pytest.fail("searched again"))
    capture = Path(shutil.copytree(capture, tmp_path / "elsewhere"))
    again = told(FEW)
    assert again.sensor_model.pattern.file.parent == capture
    assert said[1] == f"{said[-1]}; test frames have to confirm it" and said[-1] == "verdict: effect (vignetting)"
    monkeypatch.setattr("activestereo.report.write.LayerCache", lambda: cache)
    for folder, diagnosis in (("first", first), ("again", again)):
        write_diagnosis(diagnosis, tmp_path / folder)
        step = Step(("activestereo", "view", folder), "next")
        write_diagnosis_report(diagnosis, tmp_path / folder, FEW, steps=[step])
        assert f"activestereo view {folder}</code>" in (tmp_path / folder / "report.html").read_text()
        monkeypatch.setattr("activestereo.report.write.report_page", lambda *given: pytest.fail("written again"))
    for name in ("diagnose.json", "model.json", "model.pattern.png"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()
    assert all(np.array_equal(again.predictions()[key], image) for key, image in first.predictions().items())
    own = replace(FEW["vignetting"], apply=lambda image, view, **values: image)
    with pytest.raises(pytest.fail.Exception, match="searched again"):
        told(FEW | {"vignetting": own})
