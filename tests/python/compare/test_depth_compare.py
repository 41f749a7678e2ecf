# SPDX-License-Identifier: Apache-2.0
"""Depth beside the device's: the model's own repeat is at the floor, and a device that is wrong by a known amount shows
that amount."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lab_worlds import WorldRenderer, with_device_depth
from activestereo.capture.capture import CaptureWarning, read_capture
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from activestereo.compare.depth_compare import DepthFrame, DepthModel, depth_scores, expose
from activestereo.compare.noise import NoiseModel


@pytest.fixture(scope="module")
def layers(tmp_path_factory):
    return LayerCache(tmp_path_factory.mktemp("cache"))


def test_a_device_that_is_the_model_is_at_the_floor(wide_world, depth_capture, layers):
    scores = compare(depth_capture, renderer=WorldRenderer(wide_world, grid=2), cache=layers).scores
    for split in ("train", "test"):
        depth = scores["depth"][split]
        assert depth["fill_measured"] > 0.6
        assert depth["fill_model"] == pytest.approx(depth["fill_measured"], abs=0.02)
        assert depth["validity_iou"] > depth["noise_floor_validity_iou"] - 0.03
        assert depth["median_abs_px"] == pytest.approx(depth["noise_floor_median_abs_px"], rel=0.25)
        assert depth["rmse_px"] < 1.6 * depth["noise_floor_px"]
        assert depth["noise_floor_from"] == "model"
        assert depth["truth"]["measured"]["median_abs_px"] < 0.25


def test_a_stretched_device_shows_its_bias(wide_world, layers, tmp_path):
    def compared(stretch):
        copy = with_device_depth(wide_world, tmp_path / str(stretch), ids=(0, 4), stretch=stretch)
        return compare(copy, renderer=WorldRenderer(wide_world, grid=2), cache=layers)

    plain, stretched = compared(1.0), compared(1.04)
    for split in ("train", "test"):
        own = [depth for depth in plain.depths if depth.frame.split == split]
        both = [np.mean(d.measured[(d.measured > 0) & (d.model[0] > 0)]) for d in own]
        shift = stretched.scores["depth"][split]["bias_m"] - plain.scores["depth"][split]["bias_m"]
        assert shift == pytest.approx(0.04 * np.mean(both), rel=0.02)


def test_repeated_device_frames_give_the_floor(wide_world, layers, tmp_path):
    copy = with_device_depth(wide_world, tmp_path / "capture", ids=(0, 1))
    comparison = compare(copy, renderer=WorldRenderer(wide_world, grid=2), cache=layers)
    a, b = comparison.depths
    error, both = a.disparity_error(a.measured, b.measured)
    depth = comparison.scores["depth"]["train"]
    assert depth["noise_floor_from"] == "repeats"
    assert depth["noise_floor_px"] == pytest.approx(np.sqrt(np.mean(error[both] ** 2)))
    assert "test" not in comparison.scores["depth"]


def test_without_device_depth_there_are_no_depth_scores(wide_world, layers):
    scores = compare(wide_world.capture_path, renderer=WorldRenderer(wide_world, grid=2), cache=layers).scores
    assert scores["depth"] == {}
    assert {t["channel"] for t in scores["where"]} == {"infrared"}


def test_figures_by_hand():
    """Two pixels valid in both, one in each alone: disparities 10 and 5 px against 10 and 4 px."""
    measured, model = np.array([[1.0, 2.0, 3.0, 0.0]]), np.array([[1.0, 2.5, 0.0, 4.0]])
    truth, still = np.array([[1.0, 2.0, 3.0, 4.0]]), SimpleNamespace(id=0, split="train", repeat_group=None)
    depth = depth_scores([DepthFrame(still, measured, (model, model), truth, 10.0)])["train"]
    assert depth["rmse_m"] == pytest.approx(np.sqrt(0.125)) and depth["bias_m"] == pytest.approx(-0.25)
    assert depth["rmse_px"] == pytest.approx(np.sqrt(0.5)) and depth["median_abs_px"] == pytest.approx(0.5)
    assert depth["fill_measured"] == depth["fill_model"] == 0.75 and depth["validity_iou"] == 0.5
    assert depth["noise_floor_px"] == 0.0 and depth["noise_floor_validity_iou"] == 1.0
    assert depth["truth"]["measured"]["rmse_m"] == 0.0
    assert depth["truth"]["model"]["rmse_px"] == pytest.approx(np.sqrt(1 / 3))
    # Nothing in common is unknown, not zero.
    one, none = np.ones((2, 2)), np.zeros((2, 2))
    depth = depth_scores([DepthFrame(still, one, (none, none), none, 10.0)])["train"]
    assert depth["rmse_px"] is None and depth["validity_iou"] == 0.0 and depth["fill_model"] == 0.0


def test_hints_are_followed_where_they_can_be(wide_world):
    capture = read_capture(wide_world.capture_path)
    hints = {"max_disparity": 16, "census_width": 9, "notes": "SGM", "p1": None}
    good = DepthModel(replace(capture, depth_engine=hints)).parameters
    assert good["max_disparity"] == 16 and good["census_width"] == 9 and "p1" not in good
    with pytest.warns(CaptureWarning, match="hints cannot be followed"):
        bad = DepthModel(replace(capture, depth_engine={"census_width": 4}))
    assert "census_width" not in bad.parameters


@pytest.mark.parametrize(
    "noise_model", [NoiseModel(4.0, 0.0, 0.0, 5.0), NoiseModel(1.0, 0.3, 0.0, 5.0), NoiseModel(1.0, 0.0, 0.02, 5.0)]
)
def test_exposures_have_the_laws_mean_and_variance(noise_model):
    expected = np.full((400, 500), 60.0)
    image = expose(expected, 2.0, noise_model, 255, np.random.default_rng(2)).astype(np.float64)
    assert image.mean() == pytest.approx(60.0, abs=0.05)
    assert image.var() == pytest.approx(noise_model.variance(60.0, 2.0), rel=0.02)
