# SPDX-License-Identifier: Apache-2.0
"""Baselines: what other simulators put on depth."""

import numpy as np
import pytest

from activestereo.sensor.rival_noise import IsaacSettings, datasheet, isaac, redwood, simkinect

_WALL_M = np.full((1, 120, 160), 1.0, np.float32)


def _isaac(gray, **settings):
    return isaac(_WALL_M, gray, 400.0, 0.05, IsaacSettings(**settings), np.random.default_rng(0))


def test_isaac_sees_nothing_of_an_untextured_wall_by_default():
    assert not _isaac(np.full(_WALL_M.shape, 0.5, np.float32)).any()


def test_isaac_sees_a_textured_wall_in_steps_of_a_quarter_of_a_pixel():
    depth = _isaac(np.random.default_rng(1).random(_WALL_M.shape, np.float32))
    assert (depth[..., 20:] > 0).all() and not depth[..., :20].any()  # 20 px: beyond the second view
    steps = 20.0 / depth[..., 20:] / 0.25
    assert np.allclose(steps, np.rint(steps), atol=1e-3)
    assert np.std(20.0 / depth[..., 20:]) == pytest.approx(np.hypot(0.25, 0.25 / np.sqrt(12.0)), rel=0.05)


def test_isaac_sees_nothing_nearer_than_half_a_metre_or_beyond_its_disparities():
    gray = np.random.default_rng(1).random(_WALL_M.shape, np.float32)
    assert not _isaac(gray, min_distance_m=1.1).any()
    assert not _isaac(gray, max_disparity_px=19.0).any()


def test_the_datasheets_noise_grows_with_the_square_of_depth():
    random = np.random.default_rng(0)
    near, far = (datasheet(np.full_like(_WALL_M, z), 20.0, random).std() for z in (1.0, 3.0))
    assert near == pytest.approx(0.08 / 20.0, rel=0.05)
    assert far == pytest.approx(9.0 * near, rel=0.05)


def test_kinects_give_depth_in_eighths_of_a_pixel():
    for rival in (simkinect, redwood):
        depth = rival(_WALL_M, 35.0, np.random.default_rng(0))
        eighths = 8.0 * 35.0 / depth[depth > 0]
        assert np.allclose(eighths, np.rint(eighths), atol=1e-2)
    assert not redwood(11.0 * _WALL_M, 35.0, np.random.default_rng(0)).any()
    assert redwood(11.0 * _WALL_M, 35.0, np.random.default_rng(0), farthest_m=np.inf).all()
