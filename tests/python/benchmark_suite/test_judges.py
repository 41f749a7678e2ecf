# SPDX-License-Identifier: Apache-2.0
"""Recordings of other cameras are judged by figures that drawn disparities give back."""

import pickle

import numpy as np
import pytest

import judges


def test_noise_is_about_planes_and_a_truth_is_read_without_running_it(tmp_path):
    rng, (v, u) = np.random.default_rng(0), np.mgrid[:200, :200]
    disparity = 40.0 + 0.02 * u - 0.01 * v + rng.normal(0.0, 0.1, u.shape)
    disparity[::20, ::20] += 5.0
    assert judges.noise_px(disparity) == pytest.approx(0.1, rel=0.05)
    assert np.isnan(judges.noise_px(np.zeros((200, 200))))
    truth, depth_mm = disparity.astype("<f4"), np.rint(1000.0 * 50.0 / disparity)
    (tmp_path / "left_disp.pkl").write_bytes(pickle.dumps(truth, protocol=4))
    np.save(tmp_path / "depth.npy", depth_mm.astype(np.uint16))
    assert np.array_equal(judges.disparity_of(tmp_path / "left_disp.pkl", 50.0, u.shape), truth)
    assert np.abs(judges.disparity_of(tmp_path / "depth.npy", 50.0, u.shape) - disparity).max() < 0.025
