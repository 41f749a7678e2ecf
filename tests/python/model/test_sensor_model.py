# SPDX-License-Identifier: Apache-2.0
"""model.json: what is written is read, old files load, and what is wrong is one line that names it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from schema_check import violations

from activestereo.cli import main
from activestereo.common.pose import rigid_motion
from activestereo.effects import builtin
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import Camera, Frame
from activestereo.capture.images import write_gray
from activestereo.model import Imager, Pattern, Quantity, Rig, SensorModel, model_json, read_model, write_model
from activestereo.model.words import show
from command_line import refused, run_here

EFFECTS = builtin()
K = np.array([[430.0, 0, 211.5], [0, 430.0, 119.5], [0, 0, 1]])


@pytest.fixture
def whole(tmp_path) -> SensorModel:
    """A model that says something in every section."""
    image = tmp_path / "dots.png"
    write_gray(image, np.eye(60, 100, dtype=np.uint8) * 255)
    beside = rigid_motion((-0.05, 0, 0))
    side = Camera(424, 240, K, (0.01, 0.0, 0.0, 0.0, 0.0))
    rational = Camera(424, 240, K, (0.01, 0.0, 0.0, 0.0, 0.0, 0.02, -0.01, 0.001))
    model = SensorModel(
        rig=Rig(side, rational, beside, beside, source="a board"),
        pattern=Pattern(K, file=image, source="a wall"),
        imager=Imager(Quantity(0.6, unit="DN^2"), Quantity(0.005, unit="DN"), Quantity(0.001)),
        materials={"cup": {"ir_albedo_factor": Quantity(1.03, 1.01, 1.05)}},
        nuisances={
            "projector_scale": Quantity(7e4, 6.9e4, 7.1e4, "DN sr/(W s)", "a fit"),
            "focal_left": Quantity(1e-3),
        },
        source="a test",
    )
    model = model.with_effect(EFFECTS["vignetting"], {"exponent": Quantity(1.2, 1.1, 1.3, "1", "a fit")})
    return model.with_effect(EFFECTS["specular"], {"factor": Quantity(0.4), "roughness": Quantity(0.3)}, ("cup",))


def written(model: SensorModel, folder: Path) -> Path:
    path = folder / "model.json"
    write_model(path, model)
    return path


def edited(path: Path, change) -> Path:
    root = json.loads(path.read_text())
    change(root)
    path.write_text(json.dumps(root))
    return path


def test_what_is_written_is_read(whole, tmp_path):
    path = written(whole, tmp_path)
    again = read_model(path)
    assert again.pattern.file == tmp_path / "model.pattern.png"
    assert model_json(again, "model.pattern.png") == model_json(whole, "model.pattern.png")
    assert again.effects[1].surfaces == ("cup",)
    np.testing.assert_array_equal(again.rig.right.distortion, whole.rig.right.distortion)
    assert not violations(json.loads(path.read_text()), "model")
    write_model(path, again)  # over itself
    assert read_model(path).pattern.file.is_file()


def test_an_interval_beyond_the_limits_is_cut_to_them(whole, tmp_path):
    wide = {"ir_albedo": Quantity(0.9, 0.8, 1.1), "roughness": Quantity(0.1, -0.1, 0.3)}
    model = replace(whole, materials={"cup": wide}, nuisances={"ambient_scale": Quantity(2.0, -1.0, 5.0)})
    model = model.with_effect(EFFECTS["lens_ghost"], {"fraction": Quantity(0.01, -0.5, 0.1)})
    again = read_model(written(model, tmp_path))
    cup, share = again.materials["cup"], again.effects[-1].parameters["fraction"]
    found = (cup["ir_albedo"], cup["roughness"], again.nuisances["ambient_scale"], share)
    assert [(q.low, q.high) for q in found] == [(0.8, 1.0), (0.0, 0.3), (0.0, 5.0), (0.0, 0.1)]


def test_each_part_says_whether_the_engines_simulate_it(whole):
    root = model_json(whole.with_effect(EFFECTS["post_filter"], {"step_px": Quantity(0.1)}), "p.png")
    assert [root[part]["simulated"] for part in ("rig", "pattern", "imager")] == ["engine"] * 3
    assert [e["simulated"] for e in root["effects"]] == ["engine", "engine", "image"]
    assert "firmware" in root["effects"][2]["image_only"]


def test_version_1_loads(tmp_path):
    path = tmp_path / "old.json"
    effects = [{"id": "specular", "parameters": {"factor": 0.4, "surfaces": 5}}]
    nuisances = {"projector_scale": 7e4, "ambient_scale": 2e3, "black_dn": 4.0}
    old = {"format": "active-stereo-model", "version": 1, "effects": effects, "nuisances": nuisances}
    path.write_text(json.dumps(old))
    model = read_model(path)
    assert model.bound([]).effects[0][1] == {"factor": 0.4, "roughness": 0.5, "surfaces": 5.0}
    assert model.nuisances["black_dn"].value == 4.0


def test_surfaces_are_bound_by_name(whole):
    assert whole.bound(["plate", "cup", "wall"]).effects[1][1]["surfaces"] == 2.0
    assert whole.scene_measurement(["plate", "cup"]).albedo == {1: 1.03}
    assert whole.scene_measurement(["plate"]).albedo == {}
    with pytest.raises(ValueError, match="specular: the scene has no material 'cup'"):
        whole.bound(["plate", "wall"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.update(version=3), "version: is 3; this program reads versions 1 to 2"),
        (lambda r: r.update(format="other"), "format: is 'other'"),
        (
            lambda r: r["effects"][0].update(id="glow"),
            "unknown effect 'glow': 'activestereo effect list' has the built-in ones, --effects FILE",
        ),
        (lambda r: r["effects"][0]["parameters"].update(power=1.0), "vignetting has no such parameter"),
        (lambda r: r["effects"][0]["parameters"]["exponent"].update(value=99.0), "is 99 1, outside 0..8"),
        (lambda r: r["effects"][0]["parameters"]["exponent"].update(value="much"), "expected a finite number"),
        (lambda r: r["effects"].append(r["effects"][0]), "the effect 'vignetting' is there twice"),
        (lambda r: r["effects"][0].update(surfaces=["cup"]), "vignetting is not an effect of surfaces"),
        (lambda r: r["materials"]["cup"].update(shine=1.0), "materials.cup.shine: there is no such field"),
        (lambda r: r["nuisances"].update(warmth=1.0), "nuisances.warmth: there is no such field"),
        (lambda r: r["nuisances"]["projector_scale"].update(high=1.0), "outside of its interval, low ="),
        (lambda r: r.update(colour=1), "colour: this version knows no such key"),
        (lambda r: r["rig"]["left"].update(K=[1.0] * 9), "is no camera matrix"),
        (lambda r: r["pattern"].update(file="lost.png"), "lost.png does not exist"),
        (lambda r: r["imager"].pop("shot"), "imager.shot: is missing"),
        (lambda r: r.update(effects={"id": "haze"}), "effects"),
        (lambda r: r.update(effects=[{}]), "effects"),
        (lambda r: r.update(effects=[3]), "effects"),
        (lambda r: r["effects"][0].update(parameters=3), "effects"),
        (lambda r: r["effects"][0]["parameters"].update(exponent=None), "effects"),
    ],
)
def test_what_is_wrong_is_one_line_that_names_it(whole, tmp_path, change, message, capsys):
    path = edited(written(whole, tmp_path), change)
    with pytest.raises(ValueError) as error:
        read_model(path)
    assert message in str(error.value) and str(path) in str(error.value) and "\n" not in str(error.value)
    assert main(["model", "show", str(path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_file_that_is_not_there_or_no_json_is_one_line(tmp_path, capsys):
    (tmp_path / "text.json").write_text("{")
    for name in ("lost.json", "text.json"):
        assert name in refused(["model", "show", tmp_path / name], capsys)


def test_show_is_in_words(whole, tmp_path, capsys):
    rig = replace(whole.rig, left=replace(whole.rig.right, distortion=8 * (0.001234,)))
    text = run_here(capsys, "model", "show", written(replace(whole, rig=rig), tmp_path)).stdout
    told = ("baseline 50.000 mm", "vignetting: exponent = 1.2 (1.1 to 1.3)", "specular on cup")
    assert all(words in text for words in (*told, "engine: optics.vignetting_exponent"))
    assert "\n    0.001234 0.001234" in text, text
    assert all(len(line) <= 80 for line in text.splitlines()), text
    assert show(replace(whole, effects=())).count("effects: none") == 1


def test_add_edits_the_file_and_keeps_all_else(whole, tmp_path, capsys):
    path = written(whole, tmp_path)
    arguments = ["add", "lens_psf", "--set", "sigma_px=0.7", "--model", str(path), "-o", str(path)]
    assert main(arguments) == 0
    model = read_model(path)
    assert [e.effect.id for e in model.effects] == ["vignetting", "specular", "lens_psf"]
    assert model.rig is not None and model.nuisances["projector_scale"].high == 7.1e4
    arguments[3] = "corner_sigma_px=0.9"
    assert main(arguments) == 0
    assert [q.value for q in read_model(path).effects[-1].parameters.values()] == [0.7, 0.9]
    before = path.read_bytes()
    wrong = ("add", "lens_psf", "--set", "sigma_px=70", "--model", path, "-o", path)
    assert "outside 0.0..3.0" in refused(wrong, capsys)
    assert path.read_bytes() == before
    assert main(["add", "specular", "--set", "factor=0.2", "--on", "plate", "--model", str(path), "-o", str(path)]) == 0
    assert read_model(path).effects[-1].surfaces == ("plate",)
    assert main(["add", "lens_psf", "--on", "plate", "-o", str(path)]) == 2
    assert path.read_bytes() != before


def test_add_takes_what_a_diagnosis_found(tmp_path):
    parameters = {
        "factor": {"value": 0.3, "low": 0.2, "high": 0.4, "unit": "1"},
        "roughness": {"value": 0.4, "low": None, "high": None, "unit": "1"},
        "surfaces": {"value": 2.0, "low": None, "high": None, "unit": "bits", "materials": ["cup"]},
    }
    found = {"ranking": [{"effect": "specular", "parameters": parameters}]}
    (tmp_path / "diagnose.json").write_text(json.dumps(found))
    out = tmp_path / "model.json"
    assert main(["add", "specular", "--from", str(tmp_path / "diagnose.json"), "-o", str(out)]) == 0
    entry = read_model(out).effects[0]
    assert entry.surfaces == ("cup",)
    assert (entry.parameters["factor"].low, entry.parameters["factor"].high) == (0.2, 0.4)


def test_a_frames_laser_may_be_stated_in_any_unit():
    """The model's scale of the projector has the same one."""
    scales = {name: Quantity(value) for name, value in (("projector_scale", 400.0), ("ambient_scale", 9e3))}
    frame = Frame(0, None, None, 0.0, 0.008, np.eye(4), "train", projector_power=150.0)
    StereoDepthSensorConfig.from_model(SensorModel(nuisances=scales), frame=frame).check()
