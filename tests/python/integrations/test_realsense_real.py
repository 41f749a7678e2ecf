# SPDX-License-Identifier: Apache-2.0
"""Frames in the real pyrealsense2's software device, and our filters beside its own."""

import numpy as np
import pytest

reason = "the package pyrealsense2 is not installed (pip install pyrealsense2)"
real = pytest.importorskip("pyrealsense2", reason=reason)

import activestereo.realsense as rs
from activestereo.integrations.realsense.profiles import StreamRequest


def frameset(number):
    lens = rs.intrinsics(64, 48, 31.5, 23.5, 50.0, 50.0, rs.distortion.brown_conrady)
    moved = np.eye(4)
    moved[0, 3] = -0.015
    depth = rs.video_stream_profile(StreamRequest(rs.stream.depth, 0, 64, 48, rs.format.z16, 30), lens)
    color = rs.video_stream_profile(StreamRequest(rs.stream.color, 0, 64, 48, rs.format.bgr8, 30), lens, moved)
    rng = np.random.default_rng(number)
    z = np.round(1000 + 200 * np.sin(np.arange(64) / 9)[None] + 3 * np.arange(48)[:, None] + rng.normal(0, 3, (48, 64)))
    z[rng.random(z.shape) < 0.1] = 0
    image = rng.integers(0, 255, (48, 64, 3), np.uint8)
    return rs.composite_frame(
        [
            rs.depth_frame(z.astype(np.uint16), depth, number, 33.0 * number),
            rs.video_frame(image, color, number, 33.0 * number),
        ]
    )


@pytest.fixture(scope="module")
def pairs():
    """(ours, the real one's) framesets; the real syncer's first one lacks a stream."""
    ours = [frameset(number) for number in range(1, 6)]
    device = rs.to_software_device([one.profile for one in ours[0]])
    found = []
    for frames in ours:
        device.send(frames)
        there = device.syncer.wait_for_frames(2000)
        if there.size() == 2:
            found.append((frames, there))
    yield found
    device.stop()


def test_the_real_device_has_our_frames(pairs):
    assert len(pairs) >= 3
    for ours, there in pairs:
        found = np.asanyarray(there.get_depth_frame().get_data())
        np.testing.assert_array_equal(found, ours.get_depth_frame().get_data())
        assert there.get_depth_frame().get_units() == pytest.approx(0.001)


@pytest.mark.parametrize(
    "make",
    [
        lambda m: m.decimation_filter(2),
        lambda m: m.decimation_filter(3),
        lambda m: m.decimation_filter(5),
        lambda m: m.temporal_filter(),
        lambda m: m.temporal_filter(0.4, 20.0, 8),
        lambda m: m.hole_filling_filter(0),
        lambda m: m.hole_filling_filter(1),
        lambda m: m.hole_filling_filter(2),
        lambda m: m.threshold_filter(0.9, 1.1),
    ],
)
def test_a_filter_is_the_real_one_to_the_count(pairs, make):
    mine, theirs = make(rs), make(real)
    for ours, there in pairs:
        expected = np.asanyarray(theirs.process(there.get_depth_frame()).get_data())
        np.testing.assert_array_equal(mine.process(ours.get_depth_frame()).get_data(), expected)


def test_point_clouds_and_texture_are_the_real_ones(pairs):
    ours, there = pairs[-1]
    clouds = rs.pointcloud(), real.pointcloud()
    clouds[0].map_to(ours.get_color_frame())
    clouds[1].map_to(there.get_color_frame())
    mine = clouds[0].calculate(ours.get_depth_frame())
    theirs = clouds[1].calculate(there.get_depth_frame())
    vertices = np.asanyarray(theirs.get_vertices()).view(np.float32).reshape(-1, 3)
    np.testing.assert_allclose(mine.get_vertices(2), vertices, atol=1e-6)
    texels = np.asanyarray(theirs.get_texture_coordinates()).view(np.float32).reshape(-1, 2)
    seen = vertices[:, 2] > 0
    np.testing.assert_allclose(mine.get_texture_coordinates(2)[seen], texels[seen], atol=1e-6)


def test_align_is_the_real_one_in_nine_pixels_of_ten(pairs):
    ours, there = pairs[-1]
    mine = rs.align(rs.stream.color).process(ours).get_depth_frame().get_data()
    theirs = np.asanyarray(real.align(real.stream.color).process(there).get_depth_frame().get_data())
    assert (mine == theirs).mean() > 0.9
