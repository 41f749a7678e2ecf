# SPDX-License-Identifier: Apache-2.0
"""diagnose: names the effect that a world hides, names none where nothing is hidden, and says so where the data cannot
tell."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from lab_worlds import BLACK_DN, WorldRenderer, altered
from schema_check import violations
import activestereo.lab
from activestereo.cli import main
from activestereo.effects import Model, builtin
from activestereo.lab import Lab
from activestereo.diagnose import diagnose
from activestereo.diagnose.goodness import Z90
from activestereo.report.diagnosis import diagnosis_table
from activestereo.report.write import write_diagnosis
from activestereo.compare.model_file import library, read_model, write_model

FEW = (
    "projector_vignetting",
    "radial_distortion",
    "vignetting",
    "response_gamma",
    "veiling_glare",
    "gain_mismatch",
    "prnu",
)
EFFECTS = {name: e for name, e in builtin().items() if name in FEW}


EXPONENT = 2.0


def shaded(dn, side):
    """Lens shading by cos^EXPONENT, of an image whose focal length is half its width."""
    height, width = dn.shape
    v, u = np.mgrid[0:height, 0:width]
    r2 = ((u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2) / (0.5 * width) ** 2
    return BLACK_DN + (dn - BLACK_DN) * (1.0 + r2) ** (-EXPONENT / 2)


def diagnosed(folder, world, cache, effects=EFFECTS, **more):
    return diagnose(folder, effects=effects, renderer=WorldRenderer(world, grid=3), cache=cache, **more)


@pytest.fixture(scope="module")
def hidden_shading(lab_world, lab_cache, tmp_path_factory):
    folder, words = altered(lab_world, tmp_path_factory.mktemp("shading") / "capture", shaded), []
    diagnosis = diagnosed(folder, lab_world, lab_cache, says=words.append)
    return folder, diagnosis, words


def test_a_hidden_lens_shading_is_named_and_its_exponent_found(hidden_shading):
    _, diagnosis, words = hidden_shading
    first = diagnosis.result["ranking"][0]
    assert (diagnosis.result["verdict"], diagnosis.result["added"]) == ("effect", ["vignetting"])
    assert first["effect"] == "vignetting" and words[0].startswith("looks like vignetting")
    assert words[1].startswith("verdict: effect (vignetting)")
    found = first["parameters"]["exponent"]
    assert found["value"] == pytest.approx(EXPONENT, rel=0.1) and found["low"] < EXPONENT < found["high"]
    assert 0.5 * (found["high"] - found["low"]) > found["floor"] == pytest.approx(0.1 * Z90 * found["value"])


def test_its_set_holds_it_alone_and_probabilities_add_up(hidden_shading):
    result = hidden_shading[1].result
    assert [s["effects"] for s in result["sets"]] == [["vignetting"]]
    shares = {entry["effect"]: entry["explained_share"] for entry in result["ranking"]}
    for rival, share in result["sets"][0]["rivals"].items():
        assert share < shares["vignetting"] and share == pytest.approx(shares[rival], abs=0.02), rival
    given = result["probabilities"]
    assert sum(given["named"].values()) + given["none"] + given["something_else"] == pytest.approx(1.0)


def test_adding_it_closes_most_of_the_gap_on_frames_that_no_fit_saw(hidden_shading):
    _, diagnosis, _ = hidden_shading
    before, after = (diagnosis.result[f"heldout_ir_rmse_{when}"] for when in ("before", "after"))
    floor = diagnosis.result["heldout_noise_floor"]
    assert (before - after) / (before - floor) > 0.6  # the rest is the analytic renderer's own noise
    share = diagnosis.result["ranking"][0]["explained_share"]
    assert share == pytest.approx((before**2 - after**2) / (before**2 - floor**2), abs=0.1)


def test_the_complete_model_has_the_scales_that_were_fitted_with_what_was_found(lab_world, lab_cache, hidden_shading):
    folder, diagnosis, _ = hidden_shading
    scale = diagnosis.sensor_model.nuisances["projector_scale"].value
    without, under_it = (
        lab.compare().scores["fit"]["nuisances"]
        for lab in (
            Lab(folder, model, renderer=WorldRenderer(lab_world, grid=3), cache=lab_cache)
            for model in (None, diagnosis.model)
        )
    )
    assert scale == pytest.approx(under_it["projector_scale"], rel=0.02)
    assert abs(without["projector_scale"] / scale - 1.0) > 0.1


def test_nothing_is_named_where_nothing_is_hidden(lab_world, lab_cache):
    result = diagnosed(lab_world.capture_path, lab_world, lab_cache).result
    assert (result["verdict"], result["added"], result["sets"]) == ("none", [], [])
    assert result["heldout_ir_rmse_after"] == result["heldout_ir_rmse_before"]


def test_pixel_gains_are_told_from_offsets_and_smooth_shading(lab_world, lab_cache, tmp_path):
    rng = np.random.default_rng(3)
    gains = {}

    def change(dn, side):
        gain = gains.setdefault(side, 1.0 + 0.15 * rng.standard_normal(dn.shape))
        return BLACK_DN + gain * (dn - BLACK_DN)

    folder = altered(lab_world, tmp_path / "capture", change)
    effects = {name: e for name, e in builtin().items() if name in (*FEW, "fixed_pattern_noise", "hot_pixels")}
    first = diagnosed(folder, lab_world, lab_cache, effects).result["ranking"][0]
    assert first["effect"] == "prnu"
    assert first["parameters"]["sigma"]["value"] == pytest.approx(0.15, rel=0.15)


def test_files_keep_the_schema_and_the_model_reads_back(hidden_shading, tmp_path):
    _, diagnosis, _ = hidden_shading
    paths = write_diagnosis(diagnosis, tmp_path)
    written = json.loads(paths[0].read_text())
    schema = json.loads((Path(activestereo.report.__file__).parent / "schema" / "diagnose.schema.json").read_text())
    assert violations(written, schema) == []
    model = read_model(tmp_path / "model.json", library())
    assert [e.id for e, _ in model.effects] == ["vignetting"]
    assert "vignetting" in diagnosis_table(written)


def test_add_command_takes_the_parameters_of_a_diagnosis(hidden_shading, tmp_path, capsys):
    _, diagnosis, _ = hidden_shading
    write_diagnosis(diagnosis, tmp_path)
    out = tmp_path / "model2.json"
    assert main(["add", "vignetting", "--from", str(tmp_path / "diagnose.json"), "-o", str(out)]) == 0
    found = diagnosis.result["ranking"][0]["parameters"]["exponent"]["value"]
    assert read_model(out, library()).effects[0][1]["exponent"] == pytest.approx(found)
    (tmp_path / "list.json").write_text("[]")
    assert main(["add", "vignetting", "--from", str(tmp_path / "list.json"), "-o", str(out)]) == 2
    assert main(["add", "no_such_effect", "-o", str(out)]) == 2
    assert "unknown effect 'no_such_effect'" in capsys.readouterr().err


def test_depth_alone_ends_in_undetermined(lab_world, tmp_path):
    folder = shutil.copytree(lab_world.capture_path, tmp_path / "capture")
    root = json.loads((folder / "capture.json").read_text())
    for frame in root["frames"]:
        frame["left"] = frame["right"] = None
    (folder / "capture.json").write_text(json.dumps(root))
    result = diagnose(folder).result
    assert (result["verdict"], result["ranking"]) == ("undetermined", [])
    assert result["next_measurement"]


def test_without_test_frames_the_figures_are_of_frames_left_out(hidden_shading, lab_world, lab_cache, tmp_path):
    folder = shutil.copytree(hidden_shading[0], tmp_path / "capture")
    root = json.loads((folder / "capture.json").read_text())
    root["frames"] = [frame for frame in root["frames"] if frame.get("split", "train") == "train"]
    (folder / "capture.json").write_text(json.dumps(root))
    result = diagnosed(folder, lab_world, lab_cache).result
    before, after, floor = (
        result[key] for key in ("heldout_ir_rmse_before", "heldout_ir_rmse_after", "heldout_noise_floor")
    )
    assert before > after > 0.8 * floor


def test_the_answer_is_an_object_to_work_with(hidden_shading):
    _, diagnosis, _ = hidden_shading
    frame = diagnosis.before.capture.frames[0].id
    assert np.abs(diagnosis.residual(frame)).mean() < np.abs(diagnosis.before.residuals()[frame, "left"]).mean()
    assert diagnosis.predict(frame).shape == diagnosis.residual(frame).shape
    assert diagnosis.sets() == [["vignetting"]]
    assert "and was named" in diagnosis.explain("vignetting")
    assert "vignetting explains" in diagnosis.explain("projector_vignetting")
    assert diagnosis.explain("haze") == "haze explains next to nothing of the images"
    assert len(diagnosis.plot().axes[0].patches) > 0


def test_a_lab_adds_what_it_found_and_its_error_falls(hidden_shading, lab_world, lab_cache):
    folder, *_ = hidden_shading
    lab = Lab(folder, renderer=WorldRenderer(lab_world, grid=3), cache=lab_cache)
    lab.effects = EFFECTS
    before = lab.compare().scores["ir"]["test"]["rmse_dn"]
    lab.diagnose()
    lab.add("vignetting")
    assert lab.compare().scores["ir"]["test"]["rmse_dn"] < 0.85 * before


def test_model_files_say_what_is_wrong(tmp_path):
    path = tmp_path / "model.json"
    path.write_text("{}")
    with pytest.raises(ValueError, match="format"):
        read_model(path, library())
    write_model(path, Model().with_effect(builtin()["vignetting"], exponent=0.2))
    assert read_model(path, library()).effects[0][1] == {"exponent": 0.2}
