# SPDX-License-Identifier: Apache-2.0
"""Frames in the real pyrealsense2's software device, and our filters beside its own."""

import gc
import time
from importlib.metadata import version

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

reason = "the package pyrealsense2 is not installed (pip install pyrealsense2)"
real = pytest.importorskip("pyrealsense2", reason=reason)

from activestereo.common.pose import rigid_motion
import activestereo.realsense as rs
from activestereo.integrations.realsense.frames import StreamRequest
from real_software_device import SoftwareDevice
from realsense_frames import frameset

SUFFIX = ".db3" if tuple(map(int, version("pyrealsense2").split(".")[:2])) >= (2, 58) else ".bag"


@pytest.fixture(scope="module")
def pairs():
    """(ours, the real one's) framesets; the real syncer's first one lacks a stream."""
    ours = [frameset(number) for number in range(1, 6)]
    device = SoftwareDevice([one.profile for one in ours[0]])
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
        lambda m: m.spatial_filter(),
        lambda m: m.spatial_filter(0.6, 8, 1, 1),
        lambda m: m.spatial_filter(0.5, 20, 2, 3),
        lambda m: m.spatial_filter(0.5, 20, 3, 5),
    ],
)
def test_a_filter_is_the_real_one_to_the_count(pairs, make):
    mine, theirs = make(rs), make(real)
    for ours, there in pairs:
        expected = np.asanyarray(theirs.process(there.get_depth_frame()).get_data())
        np.testing.assert_array_equal(mine.process(ours.get_depth_frame()).get_data(), expected)


@pytest.mark.parametrize("values", [(0.5, 20, 2, 0), (0.6, 8, 1, 1), (0.5, 20, 3, 5)])
def test_disparities_are_smoothed_and_filled_as_the_real_ones(pairs, values):
    for ours, there in pairs:
        disparity = real.disparity_transform(True).process(there.get_depth_frame())
        expected = np.asanyarray(real.spatial_filter(*map(float, values)).process(disparity).get_data())
        mine = rs.spatial_filter(*values).process(rs.disparity_transform(True).process(ours.get_depth_frame()))
        expected = expected.view(np.float32)[:, :-1]  # its last column fills from the next row's first pixel
        np.testing.assert_allclose(mine.get_data()[:, :-1], expected, atol=1e-4)


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


def recorded(folder, whole):
    """The real recorder's file of three framesets, whole(1) to whole(3)."""
    device = SoftwareDevice([one.profile for one in whole(1)])
    path = folder / f"recorded{SUFFIX}"
    recorder = real.recorder(str(path), device.device)
    for number in range(1, 4):
        device.send(whole(number))
        time.sleep(0.05)  # or the recorder drops frames
    recorder.pause()
    device.stop()
    del recorder, device  # closes the file
    gc.collect()
    return path


def test_what_the_real_recorder_writes_is_played_and_imported(tmp_path):
    """Four streams of the simulated camera's shapes; since 2.58 recordings are .db3 files."""
    pytest.importorskip("rosbags", reason="the package rosbags is not installed (pip install rosbags)")
    from activestereo.capture.importers.bag import extract_bag

    baseline_m, lens = 0.055, frameset(1)[0].profile.get_intrinsics()
    streams = []
    for index in (1, 2):
        place = rigid_motion((-baseline_m * (index - 1), 0, 0))
        request = StreamRequest(rs.stream.infrared, index, 64, 48, rs.format.y8, 30)
        streams.append(rs.video_stream_profile(request, lens, place))

    def whole(number):
        pixels = np.random.default_rng(number).integers(0, 255, (2, 48, 64), np.uint8)
        pair = [rs.video_frame(p, s, number, 33.0 * number) for p, s in zip(pixels, streams)]
        return rs.composite_frame([*frameset(number), *pair])

    path = recorded(tmp_path, whole)
    found, unit_m, _ = extract_bag(path, tmp_path)
    assert unit_m == pytest.approx(0.001)
    assert -found.extrinsic("Infrared 1", "Infrared 2")[0, 3] == pytest.approx(baseline_m)
    assert len(list(tmp_path.glob("Infrared 2*.png"))) == len(list(tmp_path.glob("Depth*.png"))) == 3
    config, again = real.config(), real.pipeline()
    config.enable_device_from_file(str(path), repeat_playback=False)
    again.start(config)
    played = np.asanyarray(again.wait_for_frames(2000).get_infrared_frame(2).get_data())
    assert any((played == whole(number).get_infrared_frame(2).get_data()).all() for number in range(1, 4))
    again.stop()


def test_what_the_real_recorder_writes_of_depth_and_colour_is_imported_with_its_place(tmp_path):
    pytest.importorskip("rosbags", reason="the package rosbags is not installed (pip install rosbags)")
    from activestereo.capture.importers.bag import has_color_depth_alone, read_color_depth_bag

    lens = frameset(1)[0].profile.get_intrinsics()
    place = rigid_motion((-0.015, 0.001, -0.002), Rotation.from_euler("xyz", (0.1, -0.2, 0.3)).as_matrix())
    color = rs.video_stream_profile(StreamRequest(rs.stream.color, 0, 64, 48, rs.format.rgb8, 30), lens, place)

    def whole(number):
        pixels = np.random.default_rng(number).integers(0, 255, (48, 64, 3), np.uint8)
        return rs.composite_frame([frameset(number)[0], rs.video_frame(pixels, color, number, 33.0 * number)])

    path = recorded(tmp_path, whole)
    assert has_color_depth_alone(path)
    found = read_color_depth_bag(path, tmp_path)
    np.testing.assert_allclose(found.color.left_to_color, place, atol=1e-5)
    np.testing.assert_allclose(found.color.K, [[50.0, 0, 31.5], [0, 50.0, 23.5], [0, 0, 1]])
    images = [(np.asarray(Image.open(f.depth)), np.asarray(Image.open(f.color))) for f in found.frames if f.color]
    sent = [[one.get_data() for one in whole(number)] for number in range(1, 4)]
    assert len(images) >= 2
    for depth, seen in images:
        assert any((depth == z).all() and (seen == rgb).all() for z, rgb in sent)
