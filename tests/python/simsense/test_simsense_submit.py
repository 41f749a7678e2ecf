# SPDX-License-Identifier: Apache-2.0
"""Depth that Python does not wait for, and computes that other threads end."""

import threading

import numpy as np
import pytest

import simsense

K = [[300, 0, 159.5], [0, 300, 119.5], [0, 0, 1]]
SHAPE = (240, 320)


def engine_of(device: simsense.Device, batch_count: int = 1, back_end: str = "auto") -> simsense.Engine:
    camera = simsense.Camera(SHAPE[1], SHAPE[0], K)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    return simsense.Engine(
        device, camera, camera, left_to_right, rectified=True, batch_count=batch_count, back_end=back_end
    )


def test_a_wait_gives_up_and_may_be_repeated() -> None:
    device = simsense.Device("cpu")
    engine = engine_of(device, back_end="vulkan")
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
    device = simsense.Device("host")
    pairs = 400
    engine = engine_of(device, pairs)
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
