# SPDX-License-Identifier: Apache-2.0
"""A model's rig and pattern take the place of a capture's nominal values."""

from pathlib import Path

import numpy as np
import pytest

from activestereo.capture.capture import Camera, Capture, Projector, Rig
from activestereo.common.pose import rigid_motion
from activestereo.model import Pattern, SensorModel, read_model, write_model
from activestereo.model.diagnosed import calibrated, pattern_image
from activestereo.model.model import Rig as ModelRig

_K = np.array([[100.0, 0, 31.5], [0, 100.0, 23.5], [0, 0, 1.0]])
_NEW = np.array([[101.0, 0, 32.0], [0, 102.0, 23.0], [0, 0, 1.0]])


def capture():
    camera, right = Camera(64, 48, _K), rigid_motion((-0.05, 0, 0))
    return Capture(
        Path("c"), "c", Path("s.gltf"), Rig(camera, camera, right, Projector(Path("none.png"), _K, np.eye(4))), ()
    )


def model_rig(width=64):
    side = Camera(width, 48, _NEW, (0.1, 0.0, 0.0, 0.0, 0.0))
    return ModelRig(side, side, rigid_motion((-0.0502, 0, 0)), rigid_motion((-0.03, 0, 0)))


def test_the_rig_is_the_models_and_one_that_says_nothing_changes_nothing():
    rig = calibrated(capture(), SensorModel(rig=model_rig())).rig
    assert np.array_equal(rig.left.K, _NEW) and rig.right.distortion[0] == 0.1
    assert rig.baseline_m == pytest.approx(0.0502) and rig.projector.left_to_projector[0, 3] == -0.03
    assert rig.projector.pattern_path == Path("none.png")  # the model has no pattern
    assert np.array_equal(calibrated(capture(), SensorModel()).rig.left.K, _K)


def test_a_rig_of_another_size_is_refused():
    with pytest.raises(ValueError, match="left camera is 32x48, c has 64x48"):
        calibrated(capture(), SensorModel(rig=model_rig(width=32)))


def test_dots_become_gaussians_with_their_power():
    dots = np.array([[20.3, 11.6, 2.0], [40.0, 30.0, 1.0], [0.2, 0.1, 5.0]])
    pattern = Pattern(_K, dots=dots, size=(64, 48), dot_sigma_px=1.5)
    found = calibrated(capture(), SensorModel(pattern=pattern)).rig.projector.pattern()
    assert np.array_equal(found, pattern_image(pattern)) and found.shape == (48, 64) and found.max() == 1.0
    v, u = np.mgrid[0:48, 0:64]
    near = [(np.hypot(u - x, v - y) < 7) for x, y, _ in dots[:2]]
    power = [found[mask].sum() for mask in near]
    assert power[0] / power[1] == pytest.approx(2.0, rel=1e-3)
    centre = [(found * grid)[near[0]].sum() / power[0] for grid in (u, v)]
    assert centre == pytest.approx([20.3, 11.6], abs=5e-3)


def test_the_background_of_dots_is_everywhere(tmp_path):
    dots = np.array([[20.0, 12.0, 2.0]])
    pattern = Pattern(_K, dots=dots, size=(64, 48), dot_sigma_px=1.5, background=0.01)
    alone = pattern_image(Pattern(_K, dots=dots, size=(64, 48), dot_sigma_px=1.5))
    found = pattern_image(pattern)
    assert found.max() == 1.0 and found.min() == pytest.approx(0.01 / (0.01 + 2.0 / (2 * np.pi * 1.5**2)), rel=1e-5)
    assert np.corrcoef(found.ravel(), alone.ravel())[0, 1] > 1 - 1e-9
    write_model(tmp_path / "model.json", SensorModel(pattern=pattern))
    assert read_model(tmp_path / "model.json").pattern.background == 0.01
