# SPDX-License-Identifier: Apache-2.0
"""Measures of simulated depth find what was put in."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from real_views import (
    PATCH_PX,
    RealView,
    depth_measures,
    fitted_light,
    planar_patches,
    statistics,
)
from bench_realism import DEVICE, HOLES, NOISE, Board, Figure, verdicts

_FB_PX_M, _SIZE = 50.0, (192, 288)


def _view(truth_px, device_px):
    rig = SimpleNamespace(left=SimpleNamespace(K=np.diag([1000.0, 1000.0, 1.0])), baseline_m=_FB_PX_M / 1000.0)
    depths = [np.nan_to_num(_FB_PX_M / disparity).astype(np.float32) for disparity in (device_px, truth_px)]
    return RealView("v", SimpleNamespace(rig=rig), None, None, None, *depths, None)


def _measures(found_px, truth_px, device_px, again_px=None):
    view = _view(truth_px, device_px)
    patches = planar_patches(view.disparity(view.truth_m), _FB_PX_M)
    again_m = None if again_px is None else np.nan_to_num(_FB_PX_M / again_px).astype(np.float32)
    return depth_measures(view, np.nan_to_num(_FB_PX_M / found_px).astype(np.float32), again_m, patches)


def test_noise_bias_and_its_correlation_are_those_that_were_put_in():
    truth = np.full(_SIZE, 50.0, np.float32)
    random = np.random.default_rng(1)
    white = [0.1 * random.standard_normal(_SIZE) for _ in range(2)]
    found = _measures(truth + 0.3 + white[0], truth, truth, truth + 0.3 + white[1])
    assert found["bias, px: 0.8-1.2 m"] == pytest.approx(0.3, abs=0.01)
    assert found["spatial noise, px: 0.8-1.2 m"] == pytest.approx(0.1, rel=0.05)
    assert found["temporal noise, px: 0.8-1.2 m"] == pytest.approx(0.1, rel=0.05)
    assert np.isnan(found["spatial noise, px: 1.7-2.3 m"])
    smooth = gaussian_filter(white[0], 2.0)  # whose autocorrelation is exp(-lag^2 / 16): 1/e at 4
    wide = _measures(truth + smooth, truth, truth)
    assert wide["noise's correlation, px"] == pytest.approx(4.0, rel=0.15)
    assert found["noise's correlation, px"] < 1.0


def test_holes_edges_and_flying_pixels_are_counted():
    truth = np.full(_SIZE, 40.0, np.float32)
    truth[:, 150:220] = 60.0
    found, device = truth.copy(), truth.copy()
    found[:, :10] = np.nan
    device[:, :20] = np.nan
    found[:, 147:150] = 60.0  # three pixels fatter on the left
    found[:, 220] = 50.0  # one flying on the right
    own = _measures(found, truth, device)
    assert own["hole IoU"] == pytest.approx(0.5)
    assert own["invented, %"] == pytest.approx(400.0 / (_SIZE[1] - 10))
    assert own["dead band, px"] == 10
    assert own["edge width, px"] == pytest.approx(1.5, abs=0.6)
    assert own["flying pixels, %"] == pytest.approx(100.0 / 22, rel=0.1)
    assert _measures(device, truth, device)["hole IoU"] == 1.0


def test_a_square_lattice_shows_its_pitch_and_equal_eyes_leave_nothing():
    y, x = np.mgrid[:PATCH_PX, : PATCH_PX + 20].astype(np.float32)
    wall = (20.0 + 8.0 * np.cos(2 * np.pi * x / 12.0) * np.cos(2 * np.pi * y / 12.0)).astype(np.float32)
    truth = np.full((PATCH_PX, PATCH_PX), 20.0, np.float32)
    patch = planar_patches(truth, _FB_PX_M)[0]
    left, right = np.pad(wall[:, :PATCH_PX], 0), np.roll(wall, -20, axis=1)[:, :PATCH_PX]
    found = statistics(left, right, patch, black_dn=0.0)
    assert found["side peak"] > 0.9
    assert found["its lag, px"] == pytest.approx(12.0 / np.sqrt(2.0), abs=0.8), "the lattice lies on its corner"
    assert found["dots' RMS, DN"] == pytest.approx(4.0, rel=0.05)
    assert found["dots' share of light, %"] == pytest.approx(20.0, rel=0.05)
    assert statistics(left * np.linspace(0.2, 2, PATCH_PX, dtype=np.float32), right, patch, 0.0) is None


def test_a_verdict_says_whether_intervals_lie_apart():
    def rows(low, high):
        others = {DEVICE: Figure(1.0, 1.0, 1.0), "clean": Figure(0.1, 0.0, 0.2)}
        return {name: others | {"calibrated": Figure(0.5, low, high)} for name in (HOLES, NOISE)}

    apart, noise = verdicts(Board(("a", "b"), rows(0.4, 0.6), {}))
    assert "calibrated is closest" in apart and apart.endswith("lie apart")
    assert "clean is closest" in noise, "of a factor less is better"
    assert verdicts(Board(("a", "b"), rows(0.15, 0.6), {}))[0].endswith("overlap")
    assert "one view has no interval" in verdicts(Board(("a",), rows(0.4, 0.6), {}))[0]


def test_the_light_s_levels_are_those_of_the_real_image():
    laser = np.random.default_rng(0).uniform(0.0, 1.0, (70, 70)).astype(np.float32)
    room = np.linspace(0.5, 1.0, 70, dtype=np.float32) * np.ones((70, 1), np.float32)
    settings = SimpleNamespace(
        ir_camera_exposure=0.01, ir_camera_gain=1.0, ir_responsivity_dn=100.0, ir_black_level_dn=4.0,
        samples_per_pixel=1,
    )  # fmt: skip
    pictures = {"projector_direct": laser, "projector_indirect": 0.0 * laser, "radiance": laser + room}
    taken = SimpleNamespace(get_config=lambda: settings, get_picture=lambda name, side: pictures[name][..., None])
    left = 4.0 + 30.0 * laser + 20.0 * room
    left[:7, :7] += 100.0  # which no light of the scene explains
    rig = SimpleNamespace(max_dn=255.0)
    depths = np.ones_like(laser), np.ones_like(laser)
    view = RealView("v", SimpleNamespace(rig=rig), None, left, left, *depths, None)
    light, own = fitted_light(view, taken)
    np.testing.assert_allclose(own[0], 30.0 * laser, rtol=0.01)
    np.testing.assert_allclose(light[1], 30.0 * laser + 20.0 * room, rtol=0.01)
