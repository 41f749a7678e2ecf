# SPDX-License-Identifier: Apache-2.0
"""Frames that arrive late, unevenly, or never."""

import numpy as np
import pytest

from activestereo.sensor.delivery import Delivery


def frames(count, period_s=0.02, **how):
    """[steps, E] when the newest frame of each environment was taken, asked for at each frame and just before it."""
    delivery, seen = Delivery(count, **how), []
    for n in range(400):
        delivery.put(np.full((count, 2), n + 1.0), n * period_s)
        images, taken_s = delivery.get(n * period_s)
        np.testing.assert_array_equal(np.where(np.isnan(taken_s), 0, np.rint(taken_s / period_s) + 1), images[:, 0])
        seen.append(taken_s)
    return np.array(seen)


def test_frames_are_late_in_each_environment_by_its_own_latency():
    times = np.arange(400)[:, None] * 0.02
    late_s = (times - frames(3, latency_ms=[0.0, 30.0, 50.0]))[10:]
    np.testing.assert_allclose(late_s, np.broadcast_to([0.0, 0.04, 0.06], late_s.shape), atol=1e-9)


def test_jitter_varies_the_delay_and_no_frame_overtakes():
    seen = frames(50, latency_ms=50.0, jitter_ms=10.0)[20:]
    assert (np.diff(seen, axis=0) >= 0).all()
    late_s = np.arange(20, 400)[:, None] * 0.02 - seen
    assert 0.05 < late_s.mean() < 0.08 and late_s.std() > 0.005


def test_dropped_frames_leave_the_last_one_and_seeds_repeat():
    seen = frames(50, drop_share=0.3, seed=4)[1:]
    assert (np.diff(seen, axis=0) == 0).mean() == pytest.approx(0.3, abs=0.02)
    np.testing.assert_array_equal(seen, frames(50, drop_share=0.3, seed=4)[1:])
    assert not np.array_equal(seen, frames(50, drop_share=0.3, seed=5)[1:])
    assert np.isnan(frames(2, drop_share=1.0)).all()


def test_what_no_frame_has_is_told():
    with pytest.raises(ValueError, match="latency_ms of environment 1 is -1, expected 0 to 1e"):
        Delivery(2, latency_ms=[1.0, -1.0])
    with pytest.raises(ValueError, match=r"drop_share is \[3\], expected a number or \[2\]"):
        Delivery(2, drop_share=[0.1] * 3)
    with pytest.raises(RuntimeError, match="no image was put in"):
        Delivery(2).get(0.0)
    with pytest.raises(ValueError, match="images are of 3 environments, expected 2"):
        Delivery(2).put(np.zeros((3, 4)), 0.0)
