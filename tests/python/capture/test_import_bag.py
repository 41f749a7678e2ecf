# SPDX-License-Identifier: Apache-2.0
"""Bags of librealsense and of ROS 2, written here by the package rosbags, become captures."""

import io
import json
import shlex
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from activestereo.capture.capture import read_capture
from activestereo.capture.importers import bag
from activestereo.capture.importers.bag import count_pairs, intrinsic_of, read_calibration, recorded_pairs
from activestereo.cli import main, make_parser
from activestereo.cli.view import shown_path
from activestereo.report.view.library import Library
from command_line import refused

pytest.importorskip("rosbags", reason="the package rosbags is not installed (pip install rosbags)")
from rosbags.rosbag1 import Writer as Writer1  # noqa: E402
from rosbags.rosbag2 import StoragePlugin  # noqa: E402
from rosbags.rosbag2 import Writer as Writer2  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

_SIZE = (48, 64)
_TOPICS1 = {1: "/device_0/sensor_0/Infrared_1", 2: "/device_0/sensor_0/Infrared_2", 0: "/device_0/sensor_0/Depth_0"}
_BASELINE_M = 0.05


def images(seed=1):
    rng = np.random.default_rng(seed)
    pair = [rng.integers(0, 256, _SIZE, np.uint8) for _ in range(2)]
    return {1: pair[0], 2: pair[1], 0: rng.integers(400, 900, _SIZE, np.uint16)}


def image_message(store, pixels, time_ns):
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](time_ns // 10**9, time_ns % 10**9)
    header = {"stamp": stamp, "frame_id": "0"}
    header |= {"seq": 0} if "seq" in types["std_msgs/msg/Header"].__annotations__ else {}
    encoding = "mono8" if pixels.dtype == np.uint8 else ("mono16" if "seq" in header else "16UC1")
    data = np.frombuffer(pixels.tobytes(), np.uint8)
    header = types["std_msgs/msg/Header"](**header)
    return types["sensor_msgs/msg/Image"](header, *_SIZE, encoding, 0, pixels.strides[0], data)


def camera_info(store, baseline_m, model="plumb_bob", d=(0.0,) * 5):
    types, (height, width) = store.types, _SIZE
    is_ros1 = "K" in types["sensor_msgs/msg/CameraInfo"].__annotations__
    stamp = types["builtin_interfaces/msg/Time"](0, 0)
    header = types["std_msgs/msg/Header"](**({"seq": 0} if is_ros1 else {}), stamp=stamp, frame_id="0")
    roi = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k = np.array([43.0, 0, 32.1, 0, 43.5, 24.2, 0, 0, 1])
    p = np.array([43.0, 0, 32.1, -43.0 * baseline_m, 0, 43.5, 24.2, 0, 0, 0, 1, 0])
    return types["sensor_msgs/msg/CameraInfo"](
        header, height, width, model, np.array(d), k, np.eye(3).ravel(), p, 0, 0, roi
    )


_COLOR_SIZE = (24, 32)
_TURN = Rotation.from_euler("xyz", (0.01, -0.02, 0.03))
# ITU-R BT.601, of 8 bits from 16 to 235.
_STUDIO_YUV = np.array([[65.738, 129.057, 25.064], [-37.945, -74.494, 112.439], [112.439, -94.154, -18.285]])
_TO_COLOR_M = (0.015, 0.001, -0.002)


def color_image(number):
    """Smooth, for formats that keep half of the colours."""
    y, x = np.mgrid[: _COLOR_SIZE[0], : _COLOR_SIZE[1]]
    return np.stack([60 + 3 * x, 80 + 4 * y, 100 + 2 * x + number], axis=-1).astype(np.uint8)


def encoded(rgb, encoding):
    """The bytes of an image in one of ROS' or librealsense's encodings."""
    name = encoding.lower()
    if name in ("yuyv", "yuv422_yuy2", "uyvy", "yuv422"):
        y, u, v = np.moveaxis(rgb @ _STUDIO_YUV.T / 256 + (16, 128, 128), -1, 0)
        chroma = np.empty_like(y)
        chroma[:, ::2], chroma[:, 1::2] = 0.5 * (u[:, ::2] + u[:, 1::2]), 0.5 * (v[:, ::2] + v[:, 1::2])
        return np.stack([chroma, y] if name in ("uyvy", "yuv422") else [y, chroma], -1).round().astype(np.uint8)
    if name == "mono8":
        return rgb[..., 0].copy()
    ordered = rgb[..., ::-1] if name.startswith("bgr") else rgb
    return np.dstack([ordered, np.full(_COLOR_SIZE, 255, np.uint8)]) if name.endswith("a8") else ordered.copy()


def color_message(store, pixels, encoding, time_ns):
    made = image_message(store, np.zeros(_SIZE, np.uint8), time_ns)
    data, (height, width) = np.frombuffer(pixels.tobytes(), np.uint8), _COLOR_SIZE
    return replace(made, height=height, width=width, encoding=encoding, step=data.size // height, data=data)


LIGHT = [  # metadata of two frames, the second with the projector off
    {"Actual Exposure": 4000, "Gain Level": 16, "Auto Exposure": 1, "Frame Laser Power": 300, "Frame Emitter Mode": 1},
    {"Actual Exposure": 8500, "Gain Level": 40, "Auto Exposure": 1, "Frame Laser Power": 300, "Frame Emitter Mode": 0},
]


def write_librealsense(path, frames=2, skip=(), color=None, color_tf=True, light=()):
    """color: the encoding of a colour stream; color_tf: whether its place is told; light: metadata of each frame."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:

        def add(topic, kind, message, time_ns=1):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            tail = b"tail" if kind.endswith("/Image") else b""  # as librealsense has it
            writer.write(known[topic], time_ns, bytes(store.serialize_ros1(message, kind)) + tail)

        known = {}
        vector, turn = store.types["geometry_msgs/msg/Vector3"], store.types["geometry_msgs/msg/Quaternion"]
        transform = store.types["geometry_msgs/msg/Transform"](vector(_BASELINE_M, 0.0, 0.0), turn(0.0, 0.0, 0.0, 1.0))
        if "tf" not in skip:
            add(f"{_TOPICS1[2]}/tf/0", "geometry_msgs/msg/Transform", transform)
        unit = store.types["std_msgs/msg/Float32"](0.0005)
        add("/device_0/sensor_0/option/Depth_Units/value", "std_msgs/msg/Float32", unit)
        for stream, topic in _TOPICS1.items():
            if stream not in skip:
                add(f"{topic}/info/camera_info", "sensor_msgs/msg/CameraInfo", camera_info(store, 0.0))
        if color is not None:
            info = replace(camera_info(store, 0.0), height=_COLOR_SIZE[0], width=_COLOR_SIZE[1])
            add("/device_0/sensor_1/Color_0/info/camera_info", "sensor_msgs/msg/CameraInfo", info)
            place = store.types["geometry_msgs/msg/Transform"](vector(*_TO_COLOR_M), turn(*_TURN.as_quat()))
            if color_tf:
                add("/device_0/sensor_1/Color_0/tf/0", "geometry_msgs/msg/Transform", place)
        for frame in range(frames):
            time_ns = 1_700_000_000_000_000_000 + 33_000_000 * frame
            if color is not None:
                message = color_message(store, encoded(color_image(frame), color), color, time_ns)
                add("/device_0/sensor_1/Color_0/image/data", "sensor_msgs/msg/Image", message, time_ns + 4_000_000)
            for stream, pixels in images(frame).items():
                if stream not in skip:
                    message = image_message(store, pixels, time_ns)
                    add(f"{_TOPICS1[stream]}/image/data", "sensor_msgs/msg/Image", message, time_ns)
            for name, value in light[frame].items() if light else ():
                kind = "diagnostic_msgs/msg/KeyValue"
                add(f"{_TOPICS1[1]}/image/metadata", kind, store.types[kind](name, str(value)), time_ns)


def add_ros2(writer, store, topic, message, time_ns):
    """A topic of one message."""
    connection = writer.add_connection(topic, message.__msgtype__, typestore=store)
    writer.write(connection, time_ns, store.serialize_cdr(message, connection.msgtype))


def write_ros2(path, storage=StoragePlugin.SQLITE3, second_later_ns=0, light=()):
    """light: metadata of the frame, which arrive 20 ms after its image."""
    store, metadata = get_typestore(Stores.ROS2_HUMBLE), "realsense2_camera_msgs/msg/Metadata"
    store.register(get_types_from_msg("std_msgs/Header header\nstring json_data", metadata))
    topics = {1: "/camera/infra1", 2: "/camera/infra2", 0: "/camera/depth"}
    with Writer2(path, version=8, storage_plugin=storage) as writer:
        for stream, topic in topics.items():
            time_ns = 1_700_000_000_000_000_000 + second_later_ns * (stream == 2)
            message = image_message(store, images()[stream], time_ns)
            add_ros2(writer, store, f"{topic}/camera_info", camera_info(store, _BASELINE_M * (stream == 2)), 1)
            add_ros2(writer, store, f"{topic}/image_rect_raw", message, time_ns)
            if light and stream == 1:
                told = json.dumps({name.lower().replace(" ", "_"): value for name, value in light[0].items()})
                made = store.types[metadata](message.header, told)
                add_ros2(writer, store, f"{topic}/metadata", made, time_ns + 20_000_000)


def write_lone_mcap(path, **more):
    folder = path.with_name(f"whole_{path.stem}")
    write_ros2(folder, StoragePlugin.MCAP, **more)
    next(folder.glob("*.mcap")).rename(path)


def write_lone_db3(path, light=()):
    """A file without metadata.yaml that begins at 0, with PNGs, the baseline an option: librealsense's since 2.58."""
    store, folder = get_typestore(Stores.ROS2_HUMBLE), path.parent / "whole"
    types = store.types
    with Writer2(folder, version=8) as writer:
        known = {}

        def add(topic, kind, message, time_ns=0):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(known[topic], time_ns, store.serialize_cdr(message, kind))

        text = types["std_msgs/msg/String"]
        add("/device_0/sensor_0/option/Stereo_Baseline/value", "std_msgs/msg/String", text("50.000000"))
        add("/device_0/sensor_0/option/Depth_Units/value", "std_msgs/msg/String", text("0.000500"))
        for stream, topic in _TOPICS1.items():
            for frame in range(2):
                pixels, time_ns = images(frame)[stream], 1000 * stream + 33_000_000 * frame
                add(f"{topic}/image/camera_info", "sensor_msgs/msg/CameraInfo", camera_info(store, 0.0), time_ns)
                buffer = io.BytesIO()
                Image.fromarray(pixels).save(buffer, "png")
                content = (b"" if stream else bytes(12)) + buffer.getvalue()  # depth has a header of its own
                header = image_message(store, pixels, time_ns).header
                made = types["sensor_msgs/msg/CompressedImage"](header, "png", np.frombuffer(content, np.uint8))
                add(f"{topic}/image/data/compressed", "sensor_msgs/msg/CompressedImage", made, time_ns)
                if light and stream == 1:
                    told = "".join(f"{name}={value};" for name, value in light[frame].items())
                    add(f"{topic}/image/metadata", "std_msgs/msg/String", text(told), time_ns)
    next(folder.glob("*.db3")).rename(path)


ORIGINS = [
    (write_librealsense, "a.bag", 2, 0.0005), (write_ros2, "bag", 1, 0.001), (write_lone_mcap, "a.mcap", 1, 0.001),
    (write_lone_db3, "a.db3", 2, 0.0005),
]  # fmt: skip


def check(path, frames, depth_scale, first):
    capture = read_capture(path)
    assert len(capture.frames) == frames
    assert capture.rig.baseline_m == pytest.approx(_BASELINE_M)
    np.testing.assert_allclose(capture.rig.left.K, [[43.0, 0, 32.1], [0, 43.5, 24.2], [0, 0, 1]])
    frame = capture.frames[0]
    np.testing.assert_array_equal(capture.ir(frame, "left"), first[1])
    np.testing.assert_array_equal(capture.ir(frame, "right"), first[2])
    assert frame.depth_scale == pytest.approx(depth_scale) and frame.depth_path is not None


def imported(path, *more):
    """The capture of a recording, beside it."""
    assert main(["import", str(path), "--out", str(path.parent / "capture"), *more]) == 0
    return path.parent / "capture"


def refusal(capsys, path, *more):
    """The line that refuses to import a recording."""
    line = refused(["import", path, "--out", path.parent / "capture", *more], capsys)
    assert not (path.parent / "capture").exists()
    return line


@pytest.mark.parametrize(("write", "name", "frames", "scale"), ORIGINS)
def test_recordings_become_captures(tmp_path, write, name, frames, scale):
    write(tmp_path / name)
    before = (tmp_path / name).read_bytes() if (tmp_path / name).is_file() else b""
    check(imported(tmp_path / name), frames, scale, images(0 if frames == 2 else 1))
    assert not before or (tmp_path / name).read_bytes() == before
    assert len(list(recorded_pairs(tmp_path / name))) == frames
    left = {path.name for path in tmp_path.iterdir() if not path.name.startswith("whole")}
    assert left == {name, "capture"}, "nothing else stays"


@pytest.mark.parametrize(("write", "name", "frames", "scale"), ORIGINS)
def test_exposure_gain_and_projector_are_those_of_the_metadata(tmp_path, capsys, write, name, frames, scale):
    write(tmp_path / name, light=LIGHT)
    found = read_capture(imported(tmp_path / name, "--verbose")).frames
    assert "have an exposure of 0.008" not in capsys.readouterr().out
    told = [(frame.exposure_s, frame.gain, frame.projector_power) for frame in found]
    assert told == [(0.004, 1.0, 2.0), (0.0085, 2.5, 0.0)][:frames]
    again = tmp_path / "again"
    assert main(["import", str(tmp_path / name), "--out", str(again), "--exposure", "0.001"]) == 0
    assert {(frame.exposure_s, frame.gain) for frame in read_capture(again).frames} == {
        (0.001, gain) for gain in (1.0, 2.5)[:frames]
    }


def test_frames_without_metadata_have_an_assumed_exposure_and_it_is_said(tmp_path, capsys):
    write_librealsense(tmp_path / "a.bag", light=[{"Actual Exposure": 0}, LIGHT[1]])
    found = read_capture(imported(tmp_path / "a.bag", "--verbose")).frames
    assert "assumed: 1 of the 2 frames have an exposure of 0.008 s" in capsys.readouterr().out
    assert [frame.exposure_s for frame in found] == [0.008, 0.0085]


def test_a_bag_is_shown_as_the_capture_that_it_becomes(tmp_path, capsys):
    write_librealsense(tmp_path / "a.bag")
    args = make_parser().parse_args(["view", str(tmp_path / "a.bag")])
    with ExitStack() as stack:
        shown = shown_path(args, stack)
        told = capsys.readouterr().out
        flat = " ".join(told.split())
        assert f"{args.path}: 2 frames" in flat and "next:" not in told and str(shown) not in told
        for note in ("assumed: all frames have an exposure", "the pattern and the projector's place are nominal"):
            assert note in flat, "without room on import's screen"
        check(shown, 2, 0.0005, images(0))
        assert Library(shown, lambda path: path).names == ["."]
    assert not shown.exists()
    again = told.split("to state what is assumed:")[1].replace("\\\n", " ")
    assert main(shlex.split(again)[1:]) == 0, "it may name what nothing tells"
    check(tmp_path / "a_capture", 2, 0.0005, images(0))
    args.path = tmp_path
    assert shown_path(args, ExitStack()) == tmp_path


ENCODING = "a.bag: /device_0/sensor_1/Color_0/image/data: encoding is 'bayer_rggb8', expected one of rgb8"


@pytest.mark.parametrize(
    ("made", "more", "words"),
    [
        ({"skip": (2,)}, (), "Infrared 2: no topic has its images"),
        ({"skip": ("tf",)}, (), "the baseline is nowhere in it"),
        ({"skip": (1, 2), "color": "bayer_rggb8"}, (), ENCODING),
        ({}, ("--k", "1,1,1,1"), "a.bag: has K of its own: leave out --k"),
    ],
)
def test_what_a_bag_lacks_or_has_is_told(tmp_path, capsys, made, more, words):
    write_librealsense(tmp_path / "a.bag", **made)
    error = refusal(capsys, tmp_path / "a.bag", *more)
    assert "a.bag" in error and words in error


@pytest.mark.parametrize(
    "encoding", ["rgb8", "bgr8", "rgba8", "bgra8", "YUYV", "yuv422_yuy2", "UYVY", "yuv422", "mono8"]
)
def test_librealsenses_own_sample_of_depth_and_colour_alone(tmp_path, capsys, encoding):
    write_librealsense(tmp_path / "a.bag", skip=(1, 2), color=encoding)
    imported(tmp_path / "a.bag")
    said = capsys.readouterr().out
    assert "2 with depth, 2 with colour" in said and "colour and depth alone" in said and "assumed" not in said
    capture = read_capture(tmp_path / "capture")
    np.testing.assert_allclose(capture.rig.left.K, [[43.0, 0, 32.1], [0, 43.5, 24.2], [0, 0, 1]])
    rig = capture.rig
    np.testing.assert_allclose(rig.color.left_to_color[:3, :3], _TURN.as_matrix(), atol=1e-6)
    np.testing.assert_allclose(rig.color.left_to_color[:3, 3], _TO_COLOR_M)
    assert (rig.color.height, rig.color.width) == _COLOR_SIZE
    for number, frame in enumerate(capture.frames):
        np.testing.assert_allclose(capture.depth(frame), 0.0005 * images(number)[0], rtol=1e-6)
        expected = color_image(number) if encoding != "mono8" else color_image(number)[..., :1].repeat(3, axis=-1)
        found = np.asarray(Image.open(frame.color_path))[..., :3].astype(int)
        assert np.abs(found - expected).max() <= (6 if encoding.lower().startswith(("yu", "uy")) else 0)


def test_the_place_of_a_colour_camera_that_nothing_tells_is_assumed_and_said(tmp_path, capsys):
    write_librealsense(tmp_path / "a.bag", skip=(1, 2), color="rgb8", color_tf=False)
    capture = imported(tmp_path / "a.bag")
    assert "assumed: colour is seen from depth's place" in capsys.readouterr().out
    np.testing.assert_array_equal(read_capture(capture).rig.color.left_to_color, np.eye(4))


def test_depth_alone_is_a_capture_and_colour_beside_infrared_is_told_to_be_left_out(tmp_path, capsys):
    write_librealsense(tmp_path / "a.bag", skip=(1, 2))
    assert main(["import", str(tmp_path / "a.bag"), "--out", str(tmp_path / "depth")]) == 0
    assert "2 with depth, 0 with colour" in capsys.readouterr().out
    write_librealsense(tmp_path / "b.bag", color="rgb8")
    assert main(["import", str(tmp_path / "b.bag"), "--out", str(tmp_path / "pair")]) == 0
    check(tmp_path / "pair", 2, 0.0005, images(0))
    assert "left out: the bag's colour images" in capsys.readouterr().out


def test_depth_that_ros_has_aligned_to_colour_lies_on_its_pixels(tmp_path):
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer2(tmp_path / "bag", version=8) as writer:
        for topic, pixels in (("aligned_depth_to_color", images()[0]), ("color", np.dstack([images()[1]] * 3))):
            message = image_message(store, images()[0], 10**18)
            if topic == "color":
                data = np.frombuffer(pixels.tobytes(), np.uint8)
                message = replace(message, encoding="rgb8", step=3 * _SIZE[1], data=data)
            add_ros2(writer, store, f"/camera/{topic}/camera_info", camera_info(store, 0.0), 1)
            add_ros2(writer, store, f"/camera/{topic}/image_raw", message, 10**18)
    capture = read_capture(imported(tmp_path / "bag"))
    np.testing.assert_array_equal(capture.rig.color.K, capture.rig.left.K)
    np.testing.assert_allclose(capture.depth(capture.frames[0]), 0.001 * images()[0], rtol=1e-6)


def test_a_bag_without_a_baseline_takes_that_of_the_option(tmp_path):
    write_librealsense(tmp_path / "a.bag", skip=("tf",))
    more = ["--baseline", str(_BASELINE_M)]
    check(imported(tmp_path / "a.bag", *more), 2, 0.0005, images(0))
    assert main(["depth", str(tmp_path / "a.bag"), "--out", str(tmp_path / "depth"), *more]) == 0


def test_a_damaged_bag_is_one_line(tmp_path, capsys):
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\nnothing")
    assert "a.bag: cannot be read as a bag" in refusal(capsys, tmp_path / "a.bag")


@pytest.mark.parametrize(
    ("model", "d"),
    [
        ("plumb_bob", (0.1, 0, 0, 0, 0, 0.1, 0, 0)),
        ("rational_polynomial", (0.1, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 0, 0, 0.01, 0)),
        ("Inverse Brown Conrady", (0.1, 0, 0, 0, 0)),
        ("equidistant", (0.1,)),
    ],
)
def test_a_lens_of_another_law_is_refused(model, d):
    message = camera_info(get_typestore(Stores.ROS1_NOETIC), 0.05, model, d)
    with pytest.raises(ValueError, match=f"distortion_model is '{model}'|a fisheye lens has d = .*, expected 4"):
        intrinsic_of("a.bag", "topic", message)


@pytest.mark.parametrize(
    ("model", "d", "read"),
    [
        ("rational_polynomial", (0.1, 0.2, 0, 0, 0.3, 0, 0, 0), [0.1, 0.2, 0, 0, 0.3]),
        ("rational_polynomial", (0.1, 0.2, 0, 0, 0.3, 0.1, 0, 0), [0.1, 0.2, 0, 0, 0.3, 0.1, 0, 0]),
        ("equidistant", (0.1, 0, 0, 0), [0.1, 0, 0, 0]),
    ],
)
def test_a_lens_has_as_many_numbers_as_its_law(model, d, read):
    """Eight of a rational lens with a denominator, five without; four of a fisheye lens."""
    message = camera_info(get_typestore(Stores.ROS1_NOETIC), 0.05, model, d)
    assert intrinsic_of("a.bag", "topic", message).distortion.tolist() == read


@pytest.mark.parametrize("write, name", [(write_librealsense, "a.bag"), (write_ros2, "a")])
def test_pairs_come_one_by_one_and_those_that_are_not_wanted_are_not_decoded(tmp_path, write, name):
    write(tmp_path / name)
    pairs = list(recorded_pairs(tmp_path / name))
    assert len(pairs) == count_pairs(tmp_path / name) == (2 if name == "a.bag" else 1)
    for number, pair in enumerate(pairs):
        expected = images(number if name == "a.bag" else 1)
        np.testing.assert_array_equal(pair.left, expected[1])
        np.testing.assert_array_equal(pair.right, expected[2])
    wanted = recorded_pairs(tmp_path / name, lambda n: n != pairs[0].name)
    assert [pair.name for pair in wanted] == [pair.name for pair in pairs[1:]]
    device = read_calibration(tmp_path / name)
    assert device.extrinsic("Infrared 1", "Infrared 2")[0, 3] == pytest.approx(-_BASELINE_M)


@pytest.mark.parametrize(
    ("write", "name", "mending"),
    [
        (write_librealsense, "a.bag", "rosbag reindex"), (write_lone_mcap, "a.mcap", "mcap recover"),
        (write_lone_db3, "a.db3", ".recover"),
    ],
)  # fmt: skip
def test_a_recording_that_was_cut_is_told_in_one_line(tmp_path, capsys, write, name, mending):
    write(tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    assert main(["depth", str(tmp_path / name), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and f"{name}: cannot be read as a bag" in error and mending in error


def test_streams_that_do_not_match_are_told(tmp_path, capsys, monkeypatch):
    write_lone_mcap(tmp_path / "a.mcap", second_later_ns=16_000_000)
    depth = ["depth", tmp_path / "a.mcap", "--out", tmp_path / "out"]
    assert "its two streams have no images of one time" in refused(depth, capsys)
    write_lone_mcap(tmp_path / "b.mcap")
    depth[1] = tmp_path / "b.mcap"
    device = read_calibration(tmp_path / "b.mcap")
    key = "Infrared 2", _SIZE[1], _SIZE[0]
    device.intrinsics[key] = replace(device.intrinsics[key], K=np.array([[50.0, 0, 32.1], [0, 50, 24.2], [0, 0, 1]]))
    monkeypatch.setattr(bag, "read_calibration", lambda path, baseline_m: device)
    assert "do not match: focal lengths of 43 and 50 px" in refused(depth, capsys)
