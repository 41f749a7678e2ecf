# SPDX-License-Identifier: Apache-2.0
"""Renders that Python does not wait for: bits, two under way, cancel, and scenes that stay meanwhile."""

import threading

import numpy as np
import pytest

import kuafu
from sensor_scenes import lit_triangle

CAMERA = kuafu.Camera(64, 48, np.array([[60, 0, 32], [0, 60, 24], [0, 0, 1.0]]))
HOURS = 10**8  # samples


@pytest.fixture
def renderer(device: kuafu.Device) -> kuafu.Renderer:
    return kuafu.Renderer(device)


@pytest.fixture
def scene(device: kuafu.Device) -> kuafu.Scene:
    return lit_triangle(device)


def test_two_under_way_have_the_bits_of_two_in_turn(renderer: kuafu.Renderer, scene: kuafu.Scene) -> None:
    submissions = [renderer.submit(scene, CAMERA, ["radiance", "depth"], spp=2, seed=seed) for seed in (3, 4)]
    images = [submission.wait() for submission in submissions]
    for seed, image in zip((3, 4), images, strict=True):
        expected = renderer.render(scene, CAMERA, ["radiance", "depth"], spp=2, seed=seed)
        for name in expected:
            np.testing.assert_array_equal(image[name], expected[name])
    assert not np.array_equal(images[0]["radiance"], images[1]["radiance"])


def test_a_wait_gives_up_and_cancel_ends_the_render(renderer: kuafu.Renderer, scene: kuafu.Scene) -> None:
    submission = renderer.submit(scene, CAMERA, spp=HOURS)
    with pytest.raises(TimeoutError, match="goes on"):
        submission.wait(timeout_s=0.1)
    assert not submission.ended
    renderer.cancel()
    with pytest.raises(kuafu.CancelledError):
        submission.wait()


def test_cancel_reaches_a_render_of_another_thread(renderer: kuafu.Renderer, scene: kuafu.Scene) -> None:
    ended = []

    def work() -> None:
        with pytest.raises(kuafu.CancelledError):
            renderer.render(scene, CAMERA, spp=HOURS)
        ended.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    for _ in range(200):
        thread.join(0.3)
        if ended:
            break
        renderer.cancel()  # one that comes before the call ends nothing
    assert ended


def test_a_renderer_that_is_dropped_ends_its_renders(device: kuafu.Device, scene: kuafu.Scene) -> None:
    kuafu.Renderer(device).submit(scene, CAMERA, spp=HOURS)
    scene.next_frame()


def test_what_submit_refuses(renderer: kuafu.Renderer, scene: kuafu.Scene) -> None:
    with pytest.raises(ValueError, match="progress"):
        renderer.submit(scene, CAMERA, progress=lambda fraction: None)
    with pytest.raises(ValueError, match="timeout_s"):
        renderer.submit(scene, CAMERA, spp=1).wait(timeout_s=-1)
