# SPDX-License-Identifier: Apache-2.0
"""The foreign world of Mitsuba 3: its surfaces, what is told where it is missing, and, where it is installed, that its
pictures are of the same things as ours."""

from pathlib import Path

import numpy as np
import pytest

from bench_sim_to_real import main
from sim_to_real.foreign_mitsuba import MitsubaStage, foreign_bsdf
from sim_to_real.objects import objects
from sim_to_real.settings import BenchmarkSettings
from sim_to_real.stage import CameraSettings, Stage
from sim_to_real.views import round_of_views

CAMERA = CameraSettings(samples=1)


def test_each_object_has_a_surface_of_mitsubas_own_laws() -> None:
    far = np.array([0.0, 0.0, 100.0])
    made = {thing.name: foreign_bsdf(thing.mesh, thing.material, index, far) for index, thing in enumerate(objects())}
    inner = {name: own.get("bsdf", own) for name, (own, _) in made.items()}
    assert {name: own["type"] for name, own in inner.items()} == {
        "clay block": "diffuse", "steel block": "roughconductor", "glazed vase": "roughplastic",
        "brass can": "roughconductor", "glass": "conductor", "rubber bracket": "roughplastic",
        "plastic mug": "roughplastic", "lacquered stairs": "plastic",
    }  # fmt: skip
    glass = next(thing for thing in objects() if thing.name == "glass")
    reflected, up = made["glass"][1]["opacity"], glass.mesh.normals[:, 2]
    # Fresnel at a right angle: ((n - 1) / (n + 1))^2; almost all at a grazing one.
    assert reflected[np.abs(up) > 0.9999] == pytest.approx(0.04, abs=1e-4)
    assert reflected[np.abs(up) < 1e-3].min() > 0.9


def test_a_run_without_mitsuba_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mitsuba", None)
    with pytest.raises(ValueError, match="pip install mitsuba"):
        main(["run", str(tmp_path / "run"), "--foreign", "mitsuba", "--views", "8"])
    assert not (tmp_path / "run" / "settings.json").exists()


def test_settings_tell_the_foreign_world() -> None:
    assert BenchmarkSettings(foreign="mitsuba").described()["foreign"] == "mitsuba"


def test_mitsuba_sees_what_the_simulation_sees() -> None:
    pytest.importorskip("mitsuba", reason="the package mitsuba is not installed (pip install mitsuba)")
    views = round_of_views(objects(), 0, "test", 0)[:1]  # the block of clay
    stage = MitsubaStage(objects(), CAMERA, samples=9)
    depth = stage.take_depth(views, 3)
    truth = Stage(objects(), "clean", CAMERA).take_depth(round_of_views(objects(), 0, "test", 0), 3)[:1]
    right = np.abs(depth - truth) < 0.01
    assert right[0, 50:70, 70:90].mean() > 0.9  # the camera looks at the object
    assert right.mean() > 0.5
    assert np.array_equal(stage.take_depth(views, 3), depth)  # the same under one seed
    assert not np.array_equal(stage.take_depth(views, 4), depth)
