# SPDX-License-Identifier: Apache-2.0
"""The ablation's acquired materials: read from a model.json, put in place of the objects' own, and kept with a run."""

from pathlib import Path

import pytest

from activestereo.cli import main
from activestereo.gap.ablate import ablate, variants
from activestereo.gap.acquired import read_acquired, with_acquired
from activestereo.gap.files import RunFolder
from activestereo.gap.objects import objects
from activestereo.sensor_model import Quantity, SensorModel
from activestereo.sensor_model.write import write_model


def model_with(path: Path, **materials: dict[str, float]) -> Path:
    named = {name.replace("_", " "): {k: Quantity(v, v, v) for k, v in own.items()} for name, own in materials.items()}
    write_model(path, SensorModel(materials=named))
    return path


def test_what_was_found_stands_in_place_of_what_the_objects_have(tmp_path: Path) -> None:
    path = model_with(tmp_path / "model.json", steel_block={"roughness": 0.4, "ir_albedo": 0.5}, spoon={"roughness": 1})
    found = read_acquired(path, objects())
    assert found == {"steel block": {"roughness": 0.4, "ir_albedo": 0.5}}
    changed = {thing.name: thing.material for thing in with_acquired(objects(), found)}
    before = {thing.name: thing.material for thing in objects()}
    steel = changed["steel block"]
    assert (steel.roughness, steel.ir_albedo, steel.metallic) == pytest.approx((0.4, 0.5, 1.0))
    assert before["steel block"].roughness == pytest.approx(0.3)
    assert changed["brass can"].roughness == before["brass can"].roughness
    with pytest.raises(ValueError, match="a material of none of the objects"):
        read_acquired(model_with(tmp_path / "other.json", spoon={"roughness": 1}), objects())


def test_a_run_keeps_to_its_acquired_materials(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = RunFolder(tmp_path)
    folder.keep_acquired({"glass": {"roughness": 0.1}})
    folder.keep_acquired({"glass": {"roughness": 0.1}})
    with pytest.raises(ValueError, match="other acquired materials"):
        folder.keep_acquired({"glass": {"roughness": 0.2}})
    words = [world.materials for world in variants(("materials",), has_acquired=True)]
    assert words == ["nominal", "random", "acquired"]
    assert main(["gap", "ablate", str(tmp_path), "--only", "noise", "--acquired", "model.json"]) == 2
    assert "--only leaves out" in capsys.readouterr().err


def test_a_world_of_acquired_materials_is_not_rendered_without_them(tmp_path: Path) -> None:
    worlds = variants(("materials",), has_acquired=True)
    for nothing in (None, {}):
        with pytest.raises(ValueError, match="give acquired="):
            ablate(RunFolder(tmp_path), 8, worlds, acquired=nothing)
    assert not any(tmp_path.iterdir())
