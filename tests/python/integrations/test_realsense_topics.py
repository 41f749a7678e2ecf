# SPDX-License-Identifier: Apache-2.0
"""A recording of the simulated camera lists as one of realsense2_camera, and its messages have that one's fields."""

import json

import numpy as np
import pytest

reason = "the package rosbags is not installed (pip install rosbags)"
pytest.importorskip("rosbags.rosbag2", reason=reason)
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from activestereo.common.pose import rigid_motion
import activestereo.realsense as rs
from activestereo.integrations.realsense.frames import StreamRequest

_BASELINE_M, _FOCAL_PX = 0.05, 50.0
# What `ros2 bag info` of a D4xx with infrared shows, for two framesets: topic, message, count, and of the offered
# quality of service depth and whether it is latched. From realsense2_camera's source, and its issue 3472's recording
# for the topics that this one holds.
_EACH = [("image_rect_raw", "sensor_msgs/msg/Image", 1), ("camera_info", "sensor_msgs/msg/CameraInfo", 10)]
_EACH += [("metadata", "realsense2_camera_msgs/msg/Metadata", 10)]
_LISTING = {
    (f"/camera/camera/{name}/{topic}", kind, 2, depth, False)
    for name in ("depth", "infra1", "infra2", "color")
    for topic, kind, depth in (_EACH if name != "color" else [("image_raw", *_EACH[0][1:]), *_EACH[1:]])
}
_LISTING |= {
    (f"/camera/camera/extrinsics/depth_to_{name}", "realsense2_camera_msgs/msg/Extrinsics", 1, 1, True)
    for name in ("infra1", "infra2", "color")
}
_LISTING |= {("/tf_static", "tf2_msgs/msg/TFMessage", 1, 1, True)}


def frameset(number, unit_m=0.001):
    lens = rs.intrinsics(64, 48, 31.5, 23.5, _FOCAL_PX, _FOCAL_PX, rs.distortion.brown_conrady)
    frames = []
    for kind, index, form, shift_m in (
        (rs.stream.color, 0, rs.format.bgr8, -0.015),
        (rs.stream.depth, 0, rs.format.z16, 0.0),
        (rs.stream.infrared, 1, rs.format.y8, 0.0),
        (rs.stream.infrared, 2, rs.format.y8, -_BASELINE_M),
    ):
        request, place = StreamRequest(kind, index, 64, 48, form, 30), rigid_motion((shift_m, 0, 0))
        profile = rs.video_stream_profile(request, lens, place)
        depth = kind == rs.stream.depth
        shape = (48, 64, 3) if form == rs.format.bgr8 else (48, 64)
        pixels = np.random.default_rng(number).integers(0, 255, shape).astype(np.uint16 if depth else np.uint8)
        counted = {rs.frame_metadata_value.frame_timestamp: 7, rs.frame_metadata_value.frame_counter: number}
        made = rs.depth_frame if depth else rs.video_frame
        frames.append(made(pixels, profile, number, 1000.5 + 33.0 * number, counted, unit_m))
    return rs.composite_frame(frames)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("ros") / "out"
    assert rs.write_topics(path, [frameset(1), frameset(2)]) == 2
    return path


def messages(path):
    with AnyReader([path]) as reader:
        return {c.topic: reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()}


def test_a_listing_beside_a_real_recording_s_differs_in_nothing(recording):
    with AnyReader([recording]) as reader:
        found = set()
        for c in reader.connections:
            (quality,) = c.ext.offered_qos_profiles
            latched = quality.durability == QosDurability.TRANSIENT_LOCAL
            found.add((c.topic, c.msgtype, c.msgcount, quality.depth, latched))
            assert c.ext.serialization_format == "cdr"
    assert found == _LISTING


def test_images_and_their_camera_info_are_the_frames(recording):
    found, frames = messages(recording), frameset(2)
    image = found["/camera/camera/depth/image_rect_raw"]
    assert (image.encoding, image.step, image.is_bigendian) == ("16UC1", 128, 0)
    np.testing.assert_array_equal(image.data.view(np.uint16).reshape(48, 64), frames.get_depth_frame().get_data())
    assert found["/camera/camera/color/image_raw"].encoding == "bgr8"
    for name in ("depth", "infra1", "color"):
        info = found[f"/camera/camera/{name}/camera_info"]
        assert info.header.frame_id == f"camera_{name}_optical_frame" and info.distortion_model == "plumb_bob"
        assert info.header.stamp.sec == 1 and info.header.stamp.nanosec == 66_500_000
        assert len(info.d) == 5 and info.p[3] == 0 and info.k[0] == info.p[0] == _FOCAL_PX
    right = found["/camera/camera/infra2/camera_info"]
    assert right.header.frame_id == "camera_infra1_optical_frame"
    assert right.p[3] == pytest.approx(-_FOCAL_PX * _BASELINE_M)


def test_depth_of_other_units_is_published_in_millimetres(tmp_path):
    frames = frameset(1, unit_m=0.0001)
    rs.write_topics(tmp_path / "out", [frames])
    data = messages(tmp_path / "out")["/camera/camera/depth/image_rect_raw"].data.view(np.uint16)
    np.testing.assert_array_equal(data, np.rint(0.1 * frames.get_depth_frame().get_data()).ravel())


def test_metadata_is_realsense2_camera_s_json(recording):
    told = json.loads(messages(recording)["/camera/camera/infra1/metadata"].json_data)
    assert list(told)[:3] == ["frame_number", "clock_domain", "frame_timestamp"]
    assert told["clock_domain"] == "hardware_clock" and told["frame_timestamp"] == 1066.5
    assert told["hw_timestamp"] == 7 and told["frame_counter"] == 2


def test_places_hang_below_camera_link_in_ros_axes(recording):
    found = messages(recording)
    assert found["/camera/camera/extrinsics/depth_to_infra2"].translation[0] == -_BASELINE_M
    tree = {t.child_frame_id: (t.header.frame_id, t.transform) for t in found["/tf_static"].transforms}
    # The aligned frame's child is infra1's own optical frame, once more.
    assert len(found["/tf_static"].transforms) == 10
    parent, place = tree["camera_infra2_frame"]
    assert parent == "camera_link"
    offset = place.translation
    np.testing.assert_allclose([offset.x, offset.y, offset.z], [0.0, -_BASELINE_M, 0.0], atol=1e-12)
    assert (place.rotation.w, place.rotation.x) == (1.0, 0.0)
    parent, place = tree["camera_color_optical_frame"]
    assert parent == "camera_color_frame"
    assert [getattr(place.rotation, n) for n in "xyzw"] == [-0.5, 0.5, -0.5, 0.5]


def test_the_recording_s_pair_and_depth_are_read_again(recording):
    from activestereo.capture.importers.bag import read_calibration, read_pairs

    device = read_calibration(recording)
    assert -device.extrinsic("Infrared 1", "Infrared 2")[0, 3] == pytest.approx(_BASELINE_M)
    (_, left, right), (_, again, _) = read_pairs(recording)
    np.testing.assert_array_equal(left, frameset(1).get_infrared_frame(1).get_data())
    np.testing.assert_array_equal(right, frameset(1).get_infrared_frame(2).get_data())
    np.testing.assert_array_equal(again, frameset(2).get_infrared_frame(1).get_data())
