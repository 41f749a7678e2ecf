# SPDX-License-Identifier: Apache-2.0
"""A diagnosis as a user meets it: what is hidden is found, users' own effects are judged, files keep their schema."""

import ast
import json
import re
import shutil
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import activestereo.lab
import activestereo.report
from activestereo.capture.capture import read_capture
from activestereo.capture.capture_json import JsonObject
from activestereo.cli import main
from activestereo.capture.images import read_gray, write_gray
from activestereo.compare.compare import compare, comparison_of
from activestereo.diagnose import diagnose
from activestereo.diagnose.goodness import Z90
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.residual_model import effect_stub
from activestereo.effects import Parameter, Randomness, Stage, builtin, effect
from activestereo.effects.core.descriptor import Channel, Lever, RandomTerm, Unjudged
from activestereo.effects.core.load import load_effects
from activestereo.lab import Lab
from activestereo.model import Pattern, Quantity, SensorModel, read_model, write_model
from activestereo.report.diagnosis import diagnosis_screen, diagnosis_table
from activestereo.report.write import write_diagnosis, write_diagnosis_report
from lab_worlds import BLACK_DN, WorldRenderer, altered, with_device_depth
from schema_check import violations

FEW = ("projector_vignetting", "radial_distortion", "vignetting", "response_gamma", "veiling_glare")
FEW += ("gain_mismatch", "prnu")
EFFECTS = {name: e for name, e in builtin().items() if name in FEW}
EXPONENT = 3.0  # takes half of the light: from the scales without it, a step from a start of twice as much fails
mine_shading = replace(builtin()["vignetting"], id="mine_shading", family="mine", finding="My lens is dark")
LAB = Path(activestereo.diagnose.__file__).resolve().parent


def shaded(dn, side):
    """Lens shading by cos^EXPONENT, of an image whose focal length is half its width."""
    height, width = dn.shape
    v, u = np.mgrid[0:height, 0:width]
    r2 = ((u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2) / (0.5 * width) ** 2
    return BLACK_DN + (dn - BLACK_DN) * (1.0 + r2) ** (-EXPONENT / 2)


def diagnosed(folder, world, cache, effects=EFFECTS, **more):
    return diagnose(folder, effects=effects, renderer=WorldRenderer(world, grid=3), cache=cache, **more)


def lab_of(folder, world, cache, model=None, grid=3):
    return Lab(folder, model, renderer=WorldRenderer(world, grid), cache=cache)


def with_gains(world, folder):
    """The world's capture by cameras whose pixels have gains that deviate by 15 %."""
    rng, gains = np.random.default_rng(3), {}

    def change(dn, side):
        gain = gains.setdefault(side, 1.0 + 0.15 * rng.standard_normal(dn.shape))
        return BLACK_DN + gain * (dn - BLACK_DN)

    return altered(world, folder, change)


@pytest.fixture(scope="module")
def hidden_shading(lab_world, lab_cache, tmp_path_factory):
    folder, words = altered(lab_world, tmp_path_factory.mktemp("shading") / "capture", shaded), []
    diagnosis = diagnosed(folder, lab_world, lab_cache, says=words.append)
    return folder, diagnosis, words


def test_a_hidden_lens_shading_is_named_alone_its_exponent_found_and_most_of_the_gap_closed(hidden_shading):
    _, diagnosis, words = hidden_shading
    result, first = diagnosis.result, diagnosis.result["ranking"][0]
    assert (result["verdict"], result["added"]) == ("effect", ["vignetting"])
    assert first["effect"] == "vignetting" and words[0].startswith("looks like vignetting")
    assert words[1].startswith("verdict: effect (vignetting)")
    found = first["parameters"]["exponent"]
    assert found["value"] == pytest.approx(EXPONENT, rel=0.1) and found["low"] < EXPONENT < found["high"]
    assert 0.5 * (found["high"] - found["low"]) > found["floor"] == pytest.approx(0.1 * Z90 * found["value"])
    assert [s["effects"] for s in result["sets"]] == [["vignetting"]]
    shares = {entry["effect"]: entry["explained_share"] for entry in result["ranking"]}
    for rival, share in result["sets"][0]["rivals"].items():
        assert share < shares["vignetting"] and share == pytest.approx(shares[rival], abs=0.02), rival
    given = result["probabilities"]
    assert sum(given["named"].values()) + given["none"] + given["something_else"] == pytest.approx(1.0)
    names = ("heldout_ir_rmse_before", "heldout_ir_rmse_after", "heldout_noise_floor")
    before, after, floor = (result[name] for name in names)
    assert (before - after) / (before - floor) > 0.6  # the rest is the analytic renderer's own noise
    assert first["explained_share"] == pytest.approx((before**2 - after**2) / (before**2 - floor**2), abs=0.1)


def test_other_views_are_diagnosed_beside_one_without_light(lab_world, lab_cache, tmp_path):
    folder, words = altered(lab_world, tmp_path / "capture", shaded), []
    first, *others = read_capture(folder).split("train")
    for frame in (first, *(f for f in others if np.array_equal(f.camera_to_world, first.camera_to_world))):
        for path in (frame.left_path, frame.right_path):
            write_gray(path, np.zeros_like(read_gray(path)))
    result = diagnosed(folder, lab_world, lab_cache, says=words.append).result
    assert result["ranking"] and words


def test_the_complete_model_has_the_scales_that_were_fitted_with_what_was_found(lab_world, lab_cache, hidden_shading):
    folder, diagnosis, _ = hidden_shading
    scale = diagnosis.sensor_model.nuisances["projector_scale"].value
    labs = (lab_of(folder, lab_world, lab_cache, model) for model in (None, diagnosis.model))
    without, under_it = (lab.compare().scores["fit"]["nuisances"] for lab in labs)
    assert scale == pytest.approx(under_it["projector_scale"], rel=0.02)
    assert abs(without["projector_scale"] / scale - 1.0) > 0.1


def test_nothing_is_named_where_nothing_is_hidden(lab_world, lab_cache):
    result = diagnosed(lab_world.capture_path, lab_world, lab_cache).result
    assert (result["verdict"], result["added"], result["sets"]) == ("none", [], [])
    assert result["heldout_ir_rmse_after"] == result["heldout_ir_rmse_before"]


@pytest.mark.parametrize("binning", [1, 2])
def test_pixel_gains_are_told_from_offsets_and_smooth_shading(lab_world, lab_cache, tmp_path, binning):
    """In the means of blocks of pixels, too, where their spread is smaller."""
    folder = with_gains(lab_world, tmp_path / "capture")
    effects = {name: e for name, e in builtin().items() if name in (*FEW, "fixed_pattern_noise", "hot_pixels")}
    first = diagnosed(folder, lab_world, lab_cache, effects, binning=binning).result["ranking"][0]
    assert first["effect"] == "prnu"
    assert first["parameters"]["sigma"]["value"] == pytest.approx(0.15, rel=0.15)


def test_a_large_recording_is_judged_with_test_frames_depth_and_noise(lab_world, lab_cache, tmp_path):
    """As its small images are: what it states of whole images is nearly what they state."""
    found = {}
    dark = replace(lab_world, capture_path=altered(lab_world, tmp_path / "dark", shaded))
    folder = with_device_depth(dark, tmp_path / "capture", ids=(0, 2, 4))
    few = ("vignetting", "projector_vignetting", "response_gamma", "pixel_locking")
    effects = {name: builtin()[name] for name in few}
    for binning in (1, 2):
        found[binning] = diagnosed(folder, lab_world, lab_cache, effects, binning=binning)
        result = found[binning].result
        assert (result["verdict"], result["added"]) == ("effect", ["vignetting"])
        assert result["ranking"][0]["parameters"]["exponent"]["value"] == pytest.approx(EXPONENT, rel=0.1)
        assert [entry["effect"] for entry in result["depth"]["ranking"]] == ["pixel_locking"]
    small, large = (found[binning].result["heldout_ir_rmse_after"] for binning in (1, 2))
    assert large == pytest.approx(small, rel=0.05)
    noise = [found[binning].sensor_model.imager for binning in (1, 2)]
    assert noise[1].shot.value == pytest.approx(noise[0].shot.value, rel=0.1)


def test_files_keep_the_schema_and_the_model_reads_back(hidden_shading, tmp_path):
    _, diagnosis, _ = hidden_shading
    paths = write_diagnosis(diagnosis, tmp_path)
    written = json.loads(paths[0].read_text())
    assert violations(written, "diagnose") == []
    assert [e.effect.id for e in read_model(tmp_path / "model.json").effects] == ["vignetting"]
    assert "vignetting" in diagnosis_table(written)
    path = tmp_path / "own.json"
    write_model(path, SensorModel().with_effect(builtin()["vignetting"], {"exponent": Quantity(0.2)}))
    assert read_model(path).bound(()).effects[0][1] == {"exponent": 0.2}
    path.write_text("{}")
    with pytest.raises(ValueError, match="format"):
        read_model(path)


def test_add_command_takes_the_parameters_of_a_diagnosis(hidden_shading, tmp_path, capsys):
    _, diagnosis, _ = hidden_shading
    write_diagnosis(diagnosis, tmp_path)
    out = tmp_path / "model2.json"
    assert main(["add", "vignetting", "--from", str(tmp_path / "diagnose.json"), "-o", str(out)]) == 0
    found = diagnosis.result["ranking"][0]["parameters"]["exponent"]["value"]
    assert read_model(out).bound(()).effects[0][1]["exponent"] == pytest.approx(found)
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
    words = []
    result = diagnosed(folder, lab_world, lab_cache, says=words.append).result
    assert result["heldout_ir_rmse_before"] > result["heldout_ir_rmse_after"] > 0.8 * result["heldout_noise_floor"]
    assert words[-1] == "verdict: effect (vignetting)"


def test_the_match_is_computed_once(hidden_shading, monkeypatch):
    monkeypatch.setattr("activestereo.compare.mismatch.warp_between", lambda *views: pytest.fail("computed again"))
    _, diagnosis, _ = hidden_shading
    assert comparison_of(diagnosis.before, diagnosis.made).scores["match"]["frames"]


def test_the_answer_is_an_object_to_work_with(hidden_shading):
    _, diagnosis, _ = hidden_shading
    frame = diagnosis.before.capture.frames[0].id
    assert np.abs(diagnosis.residual(frame)).mean() < np.abs(diagnosis.before.residuals()[frame, "left"]).mean()
    assert diagnosis.predict(frame).shape == diagnosis.residual(frame).shape
    assert not diagnosis.after.layers and not diagnosis.after.views, "gigabytes of large images"
    assert diagnosis.sets() == [["vignetting"]]
    assert "and was named" in diagnosis.explain("vignetting")
    assert "vignetting explains" in diagnosis.explain("projector_vignetting")
    assert diagnosis.explain("haze") == "haze explains next to nothing of the images"
    with pytest.raises(ValueError, match="there is no effect 'vignettng'|vignettng"):
        diagnosis.explain("vignettng")
    with pytest.raises(KeyError, match="frame 99, left was not judged: there are"):
        diagnosis.predict(99)
    widths = [bar.get_width() for bar in diagnosis.plot().axes[0].patches]
    assert widths and widths == sorted(widths)


def test_without_a_renderer_python_judges_by_the_engines_of_the_command_line(lab_world, monkeypatch):
    class Asked(Exception):
        pass

    def engines_of(*sampled):
        raise Asked(sampled)

    for judge in (compare, diagnose):
        monkeypatch.setattr(f"{judge.__module__}.engines_of", engines_of)
        with pytest.raises(Asked, match="'auto', None, 8, 0"):
            judge(lab_world.capture_path)
    with pytest.raises(TypeError, match="unknown settings: spp; there are renderer, samples_per_pixel"):
        Lab(lab_world.capture_path, spp=3)


def test_a_lab_adds_what_it_found_and_its_error_falls(hidden_shading, lab_world, lab_cache):
    lab = lab_of(hidden_shading[0], lab_world, lab_cache)
    lab.effects = EFFECTS
    before = lab.compare().scores["ir"]["test"]["rmse_dn"]
    lab.diagnose()
    lab.add("vignetting")
    assert lab.compare().scores["ir"]["test"]["rmse_dn"] < 0.85 * before


def test_a_lab_keeps_what_a_model_file_says_beside_its_effects(lab_world, lab_cache, tmp_path, monkeypatch):
    write_gray(tmp_path / "black.png", np.eye(320, dtype=np.uint8) * 255)
    projector = read_capture(lab_world.capture_path).rig.projector
    stated = SensorModel(pattern=Pattern(projector.K, file=tmp_path / "black.png"), source="a wall")
    write_model(tmp_path / "model.json", stated)
    reads, read = [], JsonObject.read
    monkeypatch.setattr(JsonObject, "read", lambda path, *told: reads.append(Path(path).name) or read(path, *told))
    lab = lab_of(lab_world.capture_path, lab_world, lab_cache, tmp_path / "model.json", grid=1)
    assert reads.count("model.json") == 1
    assert lab.compare().capture.rig.projector.pattern().shape == (320, 320)
    assert repr(lab.add("vignetting", exponent=1.0)) == "Model: vignetting(exponent=1)"
    lab.report(tmp_path / "out")
    again = read_model(tmp_path / "out/model.json")
    assert (
        again.pattern is not None
        and again.source == "a wall"
        and [e.effect.id for e in again.effects] == ["vignetting"]
    )


@effect("mine_idle", stage=Stage.READOUT, family="mine", source="a test",
        parameters=[Parameter("amount", "1", neutral=0.0, low=-1.0, high=1.0, typical=0.1)])  # fmt: skip
def mine_idle(signal, view, amount):
    """Columns differ in gain from left to right in waves of four pixels."""
    return signal * (1.0 + amount * np.cos(np.pi * np.arange(signal.shape[-1]) / 2.0))


@pytest.fixture(scope="module")
def renderer(lab_world):
    return WorldRenderer(lab_world, grid=3)


@pytest.fixture(scope="module")
def words():
    return []


@pytest.fixture(scope="module")
def diagnosis(lab_world, renderer, lab_cache, tmp_path_factory, words):
    folder = altered(lab_world, tmp_path_factory.mktemp("own") / "capture", shaded)
    own = {e.id: e for e in (mine_shading, mine_idle)}
    effects = {"gain_mismatch": builtin()["gain_mismatch"]} | own
    return diagnose(folder, effects=effects, renderer=renderer, cache=lab_cache, says=words.append)


def test_own_effects_say_why_they_rank_where_they_do(diagnosis, words):
    own, result = diagnosis.result["own"], diagnosis.result
    assert list(own) == ["mine_shading", "mine_idle"] and result["added"] == ["mine_shading"]
    assert own["mine_shading"] == "it explains the data best" and violations(result, "diagnose") == []
    ranked = {entry["effect"]: entry for entry in result["ranking"]}
    if "mine_idle" in ranked:
        share = 100 * ranked["mine_idle"]["explained_share"]
        assert own["mine_idle"].startswith(f"it may not be named: it explains {share:.1f} % of the error")
    else:
        assert own["mine_idle"] == "it explains next to nothing of the images"
    text = " ".join(diagnosis_screen(result, [], Path("report.html"), "", True).split())
    assert "lacks mine_shading (my lens is dark)" in text
    assert all(f"yours: {why}" in text for why in own.values())
    brief = " ".join(diagnosis_screen(result, [], Path("report.html"), "", False).split())
    assert f"mine_idle: {own['mine_idle']}." in brief
    ranks = [line for line in words if " ranks " in line]  # by their scores, before anything is fitted
    assert words[0].startswith("looks like") and words[1 : 1 + len(ranks)] == ranks
    assert ranks[0].startswith("mine_shading ranks 1 of ") and "gain_mismatch" not in " ".join(ranks)


def test_the_report_of_a_diagnosis_needs_no_render(diagnosis, renderer, tmp_path, monkeypatch):
    def refused(*_):
        raise AssertionError("the report renders")

    monkeypatch.setattr(WorldRenderer, "__call__", refused)
    path = write_diagnosis_report(diagnosis, tmp_path / "new", {"mine_shading": mine_shading})
    page = path.read_text()
    assert "mine_shading (my lens is dark).</h1>" in page and page.index('id="verdict"') < page.index('id="explorer"')
    data = json.loads(page.split('id="explorer-data">')[1].split("</script>")[0])
    assert list(data["models"]) == ["base", "found", "mine_shading"]
    view = next(v for v in data["views"] if v["camera"] == "left" and v["split"] == "test")
    key = view["frame"], "left"
    for name, errors in (("base", diagnosis.before), ("found", diagnosis.after)):
        rest = errors.measured[key].astype(np.float64) - errors.predictions[key]
        frame = next(frame for frame in errors.by_frame() if frame["id"] == view["frame"])
        assert view["rmse"][name] == pytest.approx(frame["cameras"]["left"]["rmse_dn"], rel=1e-6)
        assert 0.97 < view["rmse"][name] / np.sqrt(np.mean(rest**2)) < 1.0  # the renderer's noise is not the model's
    assert view["rmse"]["found"] < 0.8 * view["rmse"]["base"]


@pytest.mark.parametrize("stage", ["PROJECTOR", "READOUT", "DIGITAL"])
def test_the_stub_of_an_unknown_effect_loads_before_anybody_edits_it(tmp_path, stage):
    model = {"stage": stage, "terms": [{"code": "(x**2 + y**2)", "value": -0.3}], "text": "residual = -0.3 r^2"}
    (tmp_path / "stub.py").write_text(effect_stub(model, 'a user\'s "room"'))
    [loaded] = load_effects(tmp_path / "stub.py").values()
    assert loaded.id == "my_effect" and loaded.stage is Stage[stage]


def test_no_effect_is_named_in_the_lab():
    # A room's plan and the spread between its sessions are told by effect.
    for path in (path for path in LAB.rglob("*.py") if path.parent.name != "room"):
        constants = (n.value for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Constant))
        assert not {text for text in constants if isinstance(text, str)} & set(builtin()), path


def test_every_built_in_effect_says_how_it_is_judged():
    assert all(e.channel is not None or any(isinstance(j, Unjudged) for j in e.judged) for e in builtin().values())
    static = {e.id for e in builtin().values() if e.channel is Channel.STATIC_FIELD}
    assert static == {e.id for e in builtin().values() if e.randomness is Randomness.STATIC}


def test_a_term_names_a_parameter_of_its_effect():
    with pytest.raises(ValueError, match="judged by a parameter 'sigma'"):
        replace(builtin()["read_noise"], judged=(RandomTerm("sigma", Lever.ONE),))


def test_a_users_effects_are_ranked_and_one_that_cannot_be_is_listed_with_the_reason(lab_world, lab_cache, tmp_path):
    """A world whose pixels have gains, ranked with gains by another name, noise, and an effect without a word."""
    effects = {
        "my_gains": replace(builtin()["prnu"], id="my_gains"),
        "my_noise": replace(builtin()["read_noise"], id="my_noise"),
        "no_word": replace(builtin()["prnu"], id="no_word", judged=()),
    }
    result = diagnosed(with_gains(lab_world, tmp_path / "capture"), lab_world, lab_cache, effects).result
    first = result["ranking"][0]
    assert (first["effect"], result["verdict"]) == ("my_gains", "effect")
    assert first["parameters"]["sigma"]["value"] == pytest.approx(0.15, rel=0.15)
    [noise] = [e for e in result["ranking"] if e["effect"] == "my_noise"]
    assert noise["channel"] == "noise" and noise["parameters"]["sigma_dn"]["value"] >= 0.0
    [skipped] = result["not_ranked"]
    assert skipped["effect"] == "no_word" and "does not say how it is judged" in skipped["reason"]


def test_page_and_help_print_the_numbers_that_decide(capsys):
    table = re.findall(r"^\| `(\w+)` \| ([\d.]+) \|", (LAB / "README.md").read_text(), re.MULTILINE)
    assert len(table) <= 15 and table == [(f.name, f"{getattr(NUMBERS, f.name):g}") for f in fields(NUMBERS)]
    with pytest.raises(SystemExit):
        main(["diagnose", "--help"])
    said = capsys.readouterr().out
    assert f"--alpha {NUMBERS.alpha:g}" in said and f"removes {NUMBERS.least_share:g} of the squared error" in said
