# SPDX-License-Identifier: Apache-2.0
"""The ablation's measured materials: read from a model.json, put in place of the objects' own, and kept with a run."""

from pathlib import Path

import numpy as np
import pytest

from sim_to_real.ablate import ablate, variants
from sim_to_real.measured_materials import read_measured, read_imager, with_measured
from sim_to_real.files import RunFolder
from sim_to_real.objects import objects
from sim_to_real.settings import BenchmarkSettings
from activestereo import StereoDepthSensorConfig
from sim_to_real.stage import CameraSettings, NoiseModel, Stage, set_noise
from sim_to_real.views import round_of_views
from sim_to_real.worlds import WORLDS
from activestereo.model import Imager, Quantity, SensorModel
from activestereo.model.write import write_model


def model_with(path: Path, **materials: dict[str, float]) -> Path:
    named = {name.replace("_", " "): {k: Quantity(v, v, v) for k, v in own.items()} for name, own in materials.items()}
    write_model(path, SensorModel(materials=named))
    return path


def test_what_was_found_stands_in_place_of_what_the_objects_have(tmp_path: Path) -> None:
    path = model_with(tmp_path / "model.json", steel_block={"roughness": 0.4, "ir_albedo": 0.5}, spoon={"roughness": 1})
    found = read_measured(path, objects())
    assert found == {"steel block": {"roughness": 0.4, "ir_albedo": 0.5}}
    changed = {thing.name: thing.material for thing in with_measured(objects(), found)}
    before = {thing.name: thing.material for thing in objects()}
    steel = changed["steel block"]
    assert (steel.roughness, steel.ir_albedo, steel.metallic) == pytest.approx((0.4, 0.5, 1.0))
    assert before["steel block"].roughness == pytest.approx(0.3)
    assert changed["brass can"].roughness == before["brass can"].roughness
    with pytest.raises(ValueError, match="a material of none of the objects"):
        read_measured(model_with(tmp_path / "other.json", spoon={"roughness": 1}), objects())


def test_a_run_keeps_to_its_acquired_materials(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    folder.keep_measured({"glass": {"roughness": 0.1}})
    folder.keep_measured({"glass": {"roughness": 0.1}})
    with pytest.raises(ValueError, match="other measured materials"):
        folder.keep_measured({"glass": {"roughness": 0.2}})
    words = [world.materials for world in variants(("materials",), has_measured=True)]
    assert words == ["nominal", "random", "measured"]


def test_a_world_of_acquired_materials_is_not_rendered_without_them(tmp_path: Path) -> None:
    worlds = variants(("materials",), has_measured=True)
    for nothing in (None, {}):
        with pytest.raises(ValueError, match="give measured="):
            ablate(RunFolder(tmp_path), 8, worlds, measured=nothing)
    assert not any(tmp_path.iterdir())


def test_the_sensor_has_the_noise_that_was_acquired(tmp_path: Path) -> None:
    terms = [Quantity(value, value, value) for value in (0.3, 0.05, 0.0)]
    write_model(tmp_path / "model.json", SensorModel(imager=Imager(*terms)))
    noise_model = read_imager(tmp_path / "model.json")
    assert noise_model == NoiseModel(0.3, 0.05, 0.0)
    camera = CameraSettings("d435", scale=0.3, size_px=(64, 48), samples=1, imager=noise_model)
    stage = Stage(objects()[:1], WORLDS["full"], camera)
    views = round_of_views(objects(), 0, "test", 0)[:1]
    counts = []
    for number in range(12):  # one render, whose noise alone is drawn again
        if number == 0:
            stage.take_depth(views, 1)
        batch = stage.camera.sensors
        picture = batch._engines[0].picture()
        picture.taken = picture.taken._replace(frame=number)
        batch.compute_depth()
        counts.append(batch.get_ir_measured()[0][0].astype(float))
    mean, variance = np.mean(counts, axis=0), np.var(counts, axis=0, ddof=1)
    clear = (mean > 5) & (mean < 200)
    signal = mean - stage.config.ir_black_level_dn
    assert variance[clear].mean() == pytest.approx((0.3 + 0.05 * signal[clear]).mean(), rel=0.05)
    with pytest.raises(ValueError, match="has no imager"):
        read_imager(model_with(tmp_path / "other.json", spoon={"roughness": 1}))


def test_a_run_keeps_to_its_noise(tmp_path: Path) -> None:
    folder, noise_model = RunFolder(tmp_path), NoiseModel(0.3, 0.05)
    folder.keep_settings(BenchmarkSettings(camera=CameraSettings(imager=noise_model)).described())
    assert BenchmarkSettings.read(folder).camera.imager == noise_model
    with pytest.raises(ValueError, match="other settings: camera"):
        folder.keep_settings(BenchmarkSettings().described())
    assert "imager" not in BenchmarkSettings().described()["camera"]  # as runs before had it


def test_acquired_noise_takes_the_place_of_what_reads_the_pixels_and_keeps_their_wells() -> None:
    config = StereoDepthSensorConfig("D435")
    config.ir_signal = dict(config.ir_signal) | {"read_noise_e": 5.0, "full_well_e": 9000.0, "gain": 2.0}
    full_dn = 9000.0 * config.ir_signal["conversion_gain_dn_per_e"]
    set_noise(config, NoiseModel(0.3, 0.05))
    assert config.ir_signal["read_noise_e"] == 0.0
    assert config.ir_signal["conversion_gain_dn_per_e"] * 2.0 * config.ir_camera_gain == pytest.approx(0.05)
    assert config.ir_signal["full_well_e"] * config.ir_signal["conversion_gain_dn_per_e"] == pytest.approx(full_dn)
