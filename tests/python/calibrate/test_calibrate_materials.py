# SPDX-License-Identifier: Apache-2.0
"""A ball's paint from pictures of it: the loss is least at the truth, the command finds it, and the sensor takes it."""

import json
import shutil

import numpy as np
import pytest
from material_worlds import NOMINAL, PAINTS, record, seen_of

from activestereo.calibrate import materials
from activestereo.calibrate.material_fit import MaterialFit, MaterialScene, refine
from activestereo.capture.capture import read_capture
from activestereo.cli import main
from activestereo.effects.core.model import Model
from activestereo.effects.core.surfaces import surface_names, surfaces_of_object
from activestereo.effects.engines import CaptureRenderer
from activestereo.model import Quantity, SensorModel
from command_line import led_on, refused


@pytest.fixture(scope="module")
def plastic(tmp_path_factory):
    return record(tmp_path_factory.mktemp("plastic"), PAINTS["plastic"], scale=0.5, samples=64, poses=1)


@pytest.fixture(scope="module")
def fit(plastic):
    return MaterialFit(*seen_of(plastic, "ball"))


def loss(fit, **changed):
    names = ("roughness", "metallic", "specular", "transmission", "ir_albedo")
    surface = dict(zip(names, PAINTS["plastic"], strict=True)) | changed
    return fit.residuals(np.array([surface[name] for name in names]), 16).loss


def test_the_loss_is_least_at_the_truth(fit):
    least = loss(fit)
    others = {"roughness": (0.15, 0.55), "metallic": (0.4,), "specular": (0.3,), "ir_albedo": (0.35, 0.65)}
    for name, values in (others | {"transmission": (0.4,)}).items():
        assert all(loss(fit, **{name: value}) > 1.02 * least for value in values), name


def test_the_renderers_noise_has_no_part_in_the_loss(fit):
    theta = np.array(PAINTS["plastic"])
    few, many = (fit.residuals(theta, samples) for samples in (8, 64))
    plain = [float(np.mean((0.5 * (r.first + r.second)) ** 2)) for r in (few, many)]
    assert plain[0] > 1.1 * plain[1]  # a plain square counts it
    assert abs(few.loss / many.loss - 1.0) < 0.6 * (plain[0] / plain[1] - 1.0)


def test_the_scene_is_where_the_fit_starts(plastic):
    capture = read_capture(plastic)
    surfaces = surfaces_of_object(capture.scene_path, "ball")
    assert [surface_names(capture.scene_path)[k] for k in surfaces] == ["paint"]
    assert np.allclose(MaterialFit(MaterialScene(capture), [], surfaces).start(), NOMINAL, atol=1e-6)


def test_the_command_finds_the_paint(plastic, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(materials, "_SAMPLES", (4, 16))  # fewer than a user's, for one small picture
    monkeypatch.setattr(materials, "_FINE_SAMPLES", 16)
    monkeypatch.setattr(materials, "_REACHES", (0.15,))
    out = tmp_path / "model.json"
    table = {"table": {"roughness": 0.9}}
    out.write_text(json.dumps({"format": "active-stereo-model", "version": 2, "materials": table}))
    assert main(["calibrate", "materials", str(plastic), "--object", "ball", "-o", str(out)]) == 0
    measured = json.loads(out.read_text())["materials"]
    assert measured["table"] == {"roughness": 0.9}  # what it did not measure stays
    assert abs(measured["paint"]["ir_albedo"]["value"] - 0.5) < 0.1
    assert abs(measured["paint"]["roughness"]["value"] - 0.35) < 0.15
    assert "calibrate materials" in measured["paint"]["roughness"]["source"]
    said = capsys.readouterr().out
    assert f"materials in {out}: ball, from" in " ".join(said.split()), said
    assert [words[:2] for words in led_on(said)] == [["compare", str(plastic)]]


def test_a_part_without_a_colour_gets_the_one_that_is_seen(plastic, tmp_path):
    folder = shutil.copytree(plastic, tmp_path / "white")
    document = json.loads((folder / "scene.gltf").read_text())
    document["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] = [1.0, 1.0, 1.0, 1.0]
    (folder / "scene.gltf").write_text(json.dumps(document))
    fit = MaterialFit(*seen_of(folder, "ball"))
    assert [name for _, name in fit.parameters][5:] == ["red", "green", "blue"]
    gray = np.array([*PAINTS["plastic"], 0.5, 0.5, 0.5])
    assert np.allclose(fit.with_colors(gray, 16), [*PAINTS["plastic"], 0.6, 0.25, 0.2], atol=0.06)


def test_designed_renders_lead_to_the_truth(fit):
    start = np.array([0.45, 0.1, 0.8, 0.1, 0.42])
    found = refine(fit, start, (0.15,), 16)
    assert found.residuals.loss < fit.residuals(start, 64).loss
    sure = found.sigma < 0.1
    assert sure[[0, 4]].all()
    assert (np.abs(found.theta - PAINTS["plastic"])[sure] < 3.0 * found.sigma[sure]).all()


def test_a_models_materials_take_the_scenes_place(plastic):
    capture = read_capture(plastic)
    fields = {"roughness": Quantity(0.2), "ir_albedo": Quantity(0.7), "transmission": Quantity(0.1)}
    scene_measurement = SensorModel(materials={"paint": fields}).scene_measurement(surface_names(capture.scene_path))
    renderer = CaptureRenderer(samples_per_pixel=1)
    [(_, inputs)] = renderer.inputs(capture, Model(), capture.frames[:1], scene_measurement)
    material = inputs.material(1)
    assert (material.roughness, material.transmission_roughness) == pytest.approx((0.2, 0.2))
    assert (material.ir_albedo, material.transmission, material.metallic) == pytest.approx((0.7, 0.1, 0.0))


def test_what_is_wrong_is_told(plastic, tmp_path, capsys):
    out = tmp_path / "model.json"
    arguments = ["calibrate", "materials", str(plastic), "-o", str(out), "--object"]
    assert "there is no object 'cup' (there are: table, ball)" in refused([*arguments, "cup"], capsys)
    arguments[2] = str(shutil.copytree(plastic, tmp_path / "changed"))
    scene = tmp_path / "changed/scene.gltf"
    document = json.loads(scene.read_text())
    [ball] = [node for node in document["nodes"] if node["name"] == "ball"]
    ball["matrix"][13] = -3.0
    scene.write_text(json.dumps(document))
    assert "the object is out of view in all 1 poses" in refused([*arguments, "ball"], capsys)
    del document["meshes"][1]["primitives"][0]["material"]
    scene.write_text(json.dumps(document))
    assert "has a part without a material" in refused([*arguments, "ball"], capsys)
    assert not out.exists()
