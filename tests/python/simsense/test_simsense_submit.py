# SPDX-License-Identifier: Apache-2.0
"""Depth that Python does not wait for, and computes that other threads end."""

import threading

import numpy as np
import pytest

import simsense
from depth_engines import depth_engine

SHAPE = (240, 320)


def test_a_wait_gives_up_and_may_be_repeated() -> None:
    device = simsense.Device("cpu")
    engine = depth_engine(SHAPE[::-1], 300, device, back_end="vulkan")
    pixels = SHAPE[0] * SHAPE[1]
    buffer = simsense.Buffer(device, 6 * pixels)
    left, right = (buffer.image("uint8", SHAPE, side * pixels) for side in (0, 1))
    depth = buffer.image("float32", SHAPE, 2 * pixels)
    left.array()[:] = np.random.default_rng(1).integers(0, 255, SHAPE)
    right.array()[:, :-8] = left.array()[:, 8:]
    expected = engine.compute(left.array(), right.array())["depth"]
    submission = engine.submit(left, right, {"depth": depth})
    with pytest.raises(TimeoutError, match="goes on"):
        submission.wait(timeout_s=0)
    with pytest.raises(ValueError, match="timeout_s"):
        submission.wait(timeout_s=-1)
    submission.wait()
    np.testing.assert_array_equal(depth.array(), expected)
    assert submission.wait(timeout_s=0) is not None


def test_cancel_reaches_a_compute_of_another_thread() -> None:
    pairs = 400
    engine = depth_engine(SHAPE[::-1], 300, batch_count=pairs)
    images = np.random.default_rng(2).integers(0, 255, (pairs, *SHAPE), dtype=np.uint8)
    begun, ended = threading.Event(), []

    def work() -> None:
        with pytest.raises(simsense.CancelledError):
            engine.compute(images, images, ["disparity"], progress=lambda _: begun.set())
        ended.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    assert begun.wait(60)
    engine.cancel()
    thread.join(60)
    assert ended
