# SPDX-License-Identifier: Apache-2.0
"""Extracts bags of ROS 1 and ROS 2, and librealsense's .bag files, into a folder of PNG files. Returns the calibration
as a DeviceText, or a ColorDepthRecording of a bag without infrared streams. Needs rosbags (pip install rosbags).

Topics are recognised by name: librealsense's /device_0/sensor_0/Infrared_1/image/data, realsense-ros's
/camera/infra1/image_rect_raw, and others with the same words. The baseline comes from the right camera's camera_info
(-P[3] / P[0]), else from librealsense's transform of the stream. Infrared 1 is the left camera on every D4xx. A bag may
also be one .db3 file without metadata.yaml, as librealsense records since 2.58. Depth is in the depth camera's image,
or is realsense-ros' depth aligned to colour."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from activestereo.capture.capture import Camera, ColorCamera
from activestereo.capture.images import read_gray, write_gray
from activestereo.capture.importers.color_depth import ColorDepthFrame, ColorDepthRecording, nearest
from activestereo.capture.importers.frames import INFRARED
from activestereo.capture.importers.realsense_folder import LEAST_TIME_MS, SAME_FRAME_MS, frame_files
from activestereo.capture.importers.realsense_text import DeviceText
from activestereo.common.baseline import chosen_baseline_m
from activestereo.common.limits import EXPOSURE
from activestereo.common.optional import imported
from activestereo.common.output_files import write_png
from activestereo.common.pose import printed_motion
from activestereo.common.progress_bar import Progress, silent

_STREAMS = {
    "Aligned": re.compile(r"aligned_depth", re.I),  # to colour, or to an infrared stream
    "Infrared 1": re.compile(r"infra(?:red)?_?1", re.I),
    "Infrared 2": re.compile(r"infra(?:red)?_?2", re.I),
    "Color": re.compile(r"(?<!depth_to_)(?:color|rgb)", re.I),
    "Depth": re.compile(r"depth", re.I),
}
_TYPES = {"mono8": np.uint8, "8UC1": np.uint8, "mono16": np.uint16, "16UC1": np.uint16}
_OF_A_PAIR = (*INFRARED, "Depth")
_IMAGES = ("Image", "CompressedImage")
_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4}
# Two bytes a pixel: librealsense's names and ROS' (sensor_msgs/image_encodings.hpp).
_YUV = {
    "yuyv": cv2.COLOR_YUV2RGB_YUYV, "yuv422_yuy2": cv2.COLOR_YUV2RGB_YUYV, "uyvy": cv2.COLOR_YUV2RGB_UYVY,
    "yuv422": cv2.COLOR_YUV2RGB_UYVY,
}  # fmt: skip
_STEREO_BASELINE = "stereo_baseline"
_MENDED_BY = {".bag": "'rosbag reindex'", ".mcap": "'mcap recover'", ".db3": "sqlite3's '.recover'"}
_NUMBER = r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?"
_PLACE = re.compile(
    rf"rotation=(?P<rotation>{_NUMBER}(?:,{_NUMBER}){{8}});\s*translation=(?P<translation>{_NUMBER}(?:,{_NUMBER}){{2}})"
)
# Metadata of a frame: librealsense's message of each, its text of all since 2.58, and realsense-ros' JSON.
_LIGHT = re.compile(
    rf'\b(actual.exposure|gain.level|frame.laser.power|frame.emitter.mode)"?\s*[=:]\s*(?P<value>{_NUMBER})', re.I
)
_GAIN_STEPS, _LASER_MW = 16.0, 150.0  # of librealsense: a gain of 1, and the laser power that D400s start with
_PNG = b"\x89PNG\r\n"
_METADATA = "std_msgs/Header header\nstring json_data", "realsense2_camera_msgs/msg/Metadata"
_COLOR_WITHIN_S = 0.02
_ROS2_DEPTH_SCALE_M = 0.001  # realsense-ros publishes 16UC1 in millimetres (REP 118)


@dataclass
class _Content:
    """Collects a bag's content by stream, such as 'Infrared 1'. images: files by time in milliseconds. places: poses,
    4x4 from the axes of the device's first stream. baselines_m: baselines that the streams' camera_info states. left,
    light: the left camera's files and metadata by the frame's time in milliseconds."""

    path: Path
    images: dict[str, dict[float, Path]] = field(default_factory=dict)
    lenses: dict[str, Camera] = field(default_factory=dict)
    places: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    baselines_m: dict[str, float] = field(default_factory=dict)
    nominal_baseline_m: float | None = None  # librealsense's option, used if nothing else states the units
    depth_units_m: float | None = None
    left: dict[float, Path] = field(default_factory=dict)
    light: dict[float, dict[str, float]] = field(default_factory=dict)

    def note(self, topic: str, message: Any) -> None:
        """Stores the camera, the pose, the baseline or the unit of depth that a message states, if any."""
        stream, kind, name = stream_of(topic), type(message).__name__, topic.lower()
        if "depth_units" in name and hasattr(message, "data"):
            self.depth_units_m = float(message.data)
        elif kind.endswith("CameraInfo") and stream is not None:
            if stream not in self.lenses:
                self.lenses[stream] = intrinsic_of(self.path, topic, message)
                projection = np.asarray(_either(message, "p"), float)
                if projection[0] > 0 and projection[3] != 0:
                    self.baselines_m[stream] = float(-projection[3] / projection[0])
        elif _STEREO_BASELINE in name:
            self.nominal_baseline_m = 1e-3 * float(message.data)
        elif stream is not None and (place := _place(self.path, topic, message)) is not None:
            self.places.setdefault(stream, place)

    def device(self, streams: Container[str], given_m: float | None) -> DeviceText:
        """Returns the calibration of both infrared cameras. streams: those with images. given_m: the user's baseline,
        or None. Raises ValueError with the missing part, or if the bag states another baseline than given_m."""
        for stream in INFRARED:
            if stream not in streams:
                raise ValueError(f"{self.path}: {stream}: no topic has its images: record both infrared streams")
            if stream not in self.lenses:
                raise ValueError(f"{self.path}: {stream}: no camera_info topic: give --calibration, or record it")
        told_m = self.nominal_baseline_m or 0.0
        if "Infrared 2" in self.baselines_m:
            told_m = self.baselines_m["Infrared 2"]
        elif "Infrared 2" in self.places:
            told_m = abs(float(self.places["Infrared 2"][0, 3]))
        if told_m < 0:
            raise ValueError(
                f"{self.path}: Infrared 2: the baseline is {told_m:g} m, expected above 0: left and right are swapped"
            )
        baseline_m = chosen_baseline_m(f"{self.path}: Infrared 2", told_m, given_m)
        modes = {(name, lens.width, lens.height): lens for name, lens in self.lenses.items()}
        pair = DeviceText.of_pair(self.path, [self.lenses[stream] for stream in INFRARED], baseline_m)
        return replace(pair, intrinsics=modes)

    def frames_light(self) -> dict[Path, dict[str, float]]:
        """Returns {left file: {exposure_s, gain, projector_power}}, with what its metadata state."""
        out = {}
        for time, told in self.light.items():
            found = {"projector_power": told.get("frame_laser_power", _LASER_MW) / _LASER_MW}
            if told.get("frame_emitter_mode") == 0:
                found["projector_power"] = 0.0
            if EXPOSURE.low <= told.get("actual_exposure", 0.0) / 1e6 <= EXPOSURE.high:
                found["exposure_s"] = told["actual_exposure"] / 1e6
            if told.get("gain_level", 0.0) > 0:
                found["gain"] = told["gain_level"] / _GAIN_STEPS
            if time in self.left:
                out[self.left[time]] = found
        return out


def is_bag(path: Path) -> bool:
    """Returns whether the path is a ROS 1 bag, or the folder or a file of a ROS 2 bag."""
    return path.suffix in (".bag", ".db3", ".mcap") or (path / "metadata.yaml").is_file()


def image_streams(path: Path) -> dict[str, int]:
    """Returns {stream: number of its images} for a bag's streams Infrared 1, Infrared 2, Depth, Aligned and Color.
    Raises as extract_bag() does."""
    with _opened(path) as reader:
        images = [c for c in _wanted(reader) if c.msgtype.split("/")[-1] in _IMAGES]
        return {stream: c.msgcount for c in images if (stream := stream_of(c.topic)) is not None}


def has_color_depth_alone(path: Path) -> bool:
    """Returns whether a bag has depth but no infrared stream. Raises ValueError if it cannot be read."""
    streams = image_streams(path).keys()
    return not streams & set(INFRARED) and bool(streams & {"Depth", "Aligned"})


def extract_bag(
    path: Path, folder: Path, progress: Progress = silent, baseline_m: float | None = None
) -> tuple[DeviceText, float | None, dict[Path, dict[str, float]]]:
    """Writes a bag's infrared and depth images into `folder`, named by stream and time as realsense_folder reads them.
    Returns (calibration, metres per unit of depth or None, fields of FrameFiles that the metadata of left images
    state). baseline_m: the user's baseline, for a bag that states none. Raises ValueError, one line, with the bag and
    the missing part; also if rosbags is missing."""
    content = _extract(path, folder, _OF_A_PAIR, progress)
    return content.device(content.images, baseline_m), content.depth_units_m, content.frames_light()


def read_color_depth_bag(
    path: Path, folder: Path, K: NDArray[np.float64] | None = None, depth_scale: float | None = None,
    progress: Progress = silent,
) -> ColorDepthRecording:  # fmt: skip
    """Writes a bag's images into `folder` and returns them as a recording. K and depth_scale, if given, override the
    bag's. Raises ValueError, one line, with the bag and the missing part; also if rosbags is missing."""
    depth_stream = "Depth" if "Depth" in image_streams(path) else "Aligned"
    content = _extract(path, folder, (depth_stream, "Color"), progress)
    depths, colors = (content.images.get(stream, {}) for stream in (depth_stream, "Color"))
    if not depths:
        raise ValueError(f"{path}: Depth: its topic has no images: record depth")
    if K is None and depth_stream not in content.lenses:
        raise ValueError(f"{path}: Depth: no camera_info topic: give --k FX,FY,CX,CY, or record it")
    scale = depth_scale or content.depth_units_m
    if scale is None:
        raise ValueError(f"{path}: depth scale: is not in it: give --depth-scale, often 0.001")
    colors_s, frames = {1e-3 * time_ms: file for time_ms, file in colors.items()}, []
    for time_ms, depth in depths.items():
        at = nearest(colors_s, 1e-3 * time_ms, _COLOR_WITHIN_S)
        frames.append(ColorDepthFrame(1e-3 * time_ms, depth, None if at is None else colors_s[at], scale))
    own = content.lenses[depth_stream].K if K is None else K
    color, lens, assumed = None, content.lenses.get("Color"), []
    if depth_stream != "Aligned" and lens is not None:
        # Without a transform, the colour camera has the depth camera's pose.
        to_depth = content.places.get(depth_stream, np.eye(4))
        depth_to_color = content.places.get("Color", to_depth) @ np.linalg.inv(to_depth)
        color = ColorCamera(lens.width, lens.height, lens.K, lens.distortion, depth_to_color)
    if colors and depth_stream != "Aligned" and "Color" not in content.places:
        assumed.append("colour is seen from depth's place: the bag has no transform of it")
    if colors and depth_stream != "Aligned" and color is None:
        assumed.append("colour lies on depth's pixels: the bag has no camera_info of it")
    return ColorDepthRecording(path, "a bag", own, tuple(frames), color=color, assumed=tuple(assumed))


def _extract(path: Path, folder: Path, streams: Sequence[str], progress: Progress) -> _Content:
    """Writes the images of these streams into `folder`. Returns them with the calibration that the bag states."""
    content, start_ms = _Content(path), None
    for topic, message, time_ms, share in _messages(path, streams=streams):
        stream, frame_ms = stream_of(topic), time_ms
        if not topic.startswith("/device_") and hasattr(message, "header"):  # ROS records each topic at its own time
            frame_ms = 1e3 * message.header.stamp.sec + 1e-6 * message.header.stamp.nanosec
        if type(message).__name__.endswith(("sensor_msgs__msg__Image", "CompressedImage")) and stream is not None:
            if start_ms is None:  # names of files hold times, also of a recording whose time begins at 0
                start_ms = 0.0 if time_ms > LEAST_TIME_MS else LEAST_TIME_MS + 1.0
            file = folder / f"{stream} {start_ms + time_ms:.3f}.png"
            if stream == "Color":
                write_png(file, _color_pixels(path, topic, message))
            else:
                write_gray(file, _gray_pixels(path, topic, message))
            content.images.setdefault(stream, {})[time_ms] = file
            if stream == INFRARED[0]:
                content.left[frame_ms] = file
            if stream in ("Depth", "Aligned") and not content.depth_units_m and not topic.startswith("/device_"):
                content.depth_units_m = _ROS2_DEPTH_SCALE_M
        elif _is_light(topic):
            content.light.setdefault(frame_ms, {}).update(_light(message))
        else:
            content.note(topic, message)
        progress(share)
    return content


def _is_light(topic: str) -> bool:
    return topic.endswith("metadata") and stream_of(topic) == INFRARED[0]


def _light(message: Any) -> dict[str, float]:
    """Returns what a message of metadata states, by librealsense's names, such as actual_exposure, in its units."""
    text = next((str(getattr(message, key)) for key in ("json_data", "data") if hasattr(message, key)), None)
    found = _LIGHT.finditer(f"{message.key}={message.value}" if text is None else text)
    return {match[1].lower().replace(" ", "_"): float(match["value"]) for match in found}


def _place(path: Path, topic: str, message: Any) -> NDArray[np.float64] | None:
    """Returns the 4x4 from the device's first stream to this one, or None if the message does not state it. Reads
    librealsense's Transform, or its text since 2.58, whose rotation is column by column."""
    name = f"{path}: {topic}"
    if type(message).__name__.endswith("Transform"):
        q, t = message.rotation, message.translation
        rotation = Rotation.from_quat((q.x, q.y, q.z, q.w)) if any((q.x, q.y, q.z, q.w)) else Rotation.identity()
        return printed_motion(rotation.as_matrix(), (t.x, t.y, t.z), name)
    told = _PLACE.search(message.data) if "/tf/" in topic and isinstance(getattr(message, "data", None), str) else None
    if told is None:
        return None
    turn, shift = ([float(word) for word in told[key].split(",")] for key in ("rotation", "translation"))
    return printed_motion(np.reshape(turn, (3, 3), order="F"), shift, name)


def read_calibration(path: Path, baseline_m: float | None = None) -> DeviceText:
    """Reads a bag's calibration without its images. baseline_m: the user's, for a bag that states none. Raises
    ValueError with the bag and the missing part, or if both baselines exist and differ."""
    streams, content = image_streams(path), _Content(path)
    kinds = ("CameraInfo", "Transform", "String", "Float32")
    for topic, message, _, _ in _messages(path, kinds, is_first_enough=True):
        content.note(topic, message)
    return content.device(streams, baseline_m)


def read_pairs(
    path: Path, is_wanted: Callable[[str], bool] = lambda name: True
) -> Iterator[tuple[str, NDArray[np.generic], NDArray[np.generic]]]:
    """Yields (name, left, right) of each infrared pair in order of time, one pair in memory. The name is the left
    image's time in milliseconds. is_wanted(name): decides whether to decode a pair. Raises as extract_bag() does."""
    waiting: dict[str, tuple[float, str, Any]] = {}
    for topic, message, time_ms, _ in _messages(path, _IMAGES, INFRARED):
        stream = stream_of(topic) or ""
        waiting[stream] = time_ms, topic, message
        if len(waiting) < 2 or abs(waiting[INFRARED[0]][0] - waiting[INFRARED[1]][0]) > SAME_FRAME_MS:
            continue
        name = f"{waiting[INFRARED[0]][0]:.3f}"
        if is_wanted(name):
            left, right = (_gray_pixels(path, *waiting[side][1:]) for side in INFRARED)
            yield name, left, right
        waiting.clear()


def count_pairs(path: Path) -> int:
    """Returns an upper limit of the number of infrared pairs. Raises as extract_bag() does."""
    counts = image_streams(path)
    return min(counts.get(side, 0) for side in INFRARED)


def stream_of(topic: str) -> str | None:
    return next((name for name, words in _STREAMS.items() if words.search(topic)), None)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Opens a bag and yields its rosbags reader. Raises ValueError if it cannot be read, on opening or inside the
    block."""
    missing = f"{path}: bags are read by the package rosbags, which is missing: pip install rosbags"
    reading, types = (imported(name, missing, ValueError) for name in ("rosbags.highlevel", "rosbags.typesys"))
    is_part = path.suffix in (".db3", ".mcap") and (path.parent / "metadata.yaml").is_file()
    try:
        store = types.get_typestore(types.Stores.ROS2_HUMBLE)
        store.register(types.get_types_from_msg(*_METADATA))  # bags before Iron hold no definitions
        with reading.AnyReader([path.parent if is_part else path], default_typestore=store) as reader:
            yield reader
    except ValueError:
        raise
    except Exception as error:  # rosbags and its readers raise classes of their own
        reason, mending = " ".join(str(error).split()) or "it is damaged", _MENDED_BY.get(path.suffix)
        hint = f" (of one that was cut off, {mending} saves what is there)" if mending and path.is_file() else ""
        raise ValueError(f"{path}: cannot be read as a bag: {reason}{hint}") from error


def _messages(
    path: Path, kinds: Sequence[str] = (), streams: Sequence[str] = _OF_A_PAIR, is_first_enough: bool = False
) -> Iterator[tuple[str, Any, float, float]]:
    """Yields (topic, message, time in ms, share of the bag that is read). kinds: message types to read; () for all that
    this importer knows. streams: streams to read; topics that belong to no stream are read too. is_first_enough: stops
    once each topic has given a message."""
    with _opened(path) as reader:
        wanted = [
            c
            for c in _wanted(reader)
            if (not kinds or c.msgtype.split("/")[-1] in kinds) and stream_of(c.topic) in (*streams, None)
        ]
        total, seen = max(1, sum(c.msgcount for c in wanted)), set()
        for number, (connection, time_ns, raw) in enumerate(reader.messages(wanted)):
            if path.suffix == ".bag" and connection.msgtype.endswith("/Image"):
                # Librealsense writes further bytes behind the message: find the end of the header's frame_id, of
                # encoding (behind height and width), and of the pixels (behind is_bigendian and step).
                at = 12  # behind the header's number and time
                for behind in (8, 5, 0):
                    at += 4 + int.from_bytes(raw[at : at + 4], "little") + behind
                raw = raw[:at]
            message = reader.deserialize(raw, connection.msgtype)
            yield connection.topic, message, 1e-6 * time_ns, (number + 1) / total
            seen.add(connection.topic)
            if is_first_enough and len(seen) == len({c.topic for c in wanted}):
                return


# Lens models by ROS's and librealsense's names; _BROWN: the largest number of k1, k2, p1, p2, k3, k4, k5, k6.
_FISHEYE = ("equidistant", "fisheye", "kannala brandt4")
_BROWN = {"": 5, "plumb_bob": 5, "none": 5, "brown conrady": 5, "modified brown conrady": 5, "rational_polynomial": 8}


def _wanted(reader: Any) -> list[Any]:
    """Lists the connections to read. A stream that exists both raw and compressed is read raw."""
    found = []
    for c in reader.connections:
        kind, topic = c.msgtype.split("/")[-1], c.topic.lower()
        is_of_stream = stream_of(c.topic) is not None
        is_place = kind == "String" and "/tf/" in topic and is_of_stream
        is_option = kind == "Float32" or (kind == "String" and "/tf/" not in topic)
        is_known = is_option and any(f"{option}/value" in topic for option in ("depth_units", _STEREO_BASELINE))
        is_light = _is_light(c.topic) and kind in ("KeyValue", "String", "Metadata")
        if is_place or is_known or is_light or (kind in (*_IMAGES, "CameraInfo", "Transform") and is_of_stream):
            found.append(c)
    plain = {stream_of(c.topic) for c in found if c.msgtype.endswith("/Image")}
    return [c for c in found if not (c.msgtype.endswith("/CompressedImage") and stream_of(c.topic) in plain)]


def _either(message: Any, name: str) -> Any:
    """Returns a field of CameraInfo, whose name is upper-case in ROS 1 and lower-case in ROS 2."""
    return getattr(message, name) if hasattr(message, name) else getattr(message, name.upper())


def _unpacked(path: Path, topic: str, content: bytes, mode: str | None = None) -> NDArray[Any]:
    try:
        image = Image.open(io.BytesIO(content))
        return np.asarray(image.convert(mode) if mode else image)
    except (OSError, SyntaxError) as error:
        raise ValueError(f"{path}: {topic}: a compressed image is damaged: {error}") from error


def _gray_pixels(path: Path, topic: str, message: Any) -> NDArray[np.generic]:
    """Decodes an image message's pixels, uint8 or uint16 [height, width]. A compressed image is a PNG file; a depth
    image has a header before it."""
    content = np.asarray(message.data, np.uint8).tobytes()
    if hasattr(message, "format"):
        start = content.find(_PNG)
        if start < 0:
            raise ValueError(f"{path}: {topic}: format is '{message.format}', expected PNG: what is lossy is not read")
        pixels = _unpacked(path, topic, content[start:])
        return pixels if pixels.dtype == np.uint8 else pixels.astype(np.uint16)
    kind = _TYPES.get(message.encoding)
    if kind is None:
        raise ValueError(f"{path}: {topic}: encoding is '{message.encoding}', expected one of {', '.join(_TYPES)}")
    row = message.step // np.dtype(kind).itemsize
    values = np.frombuffer(content, kind)
    if values.size != row * message.height or row < message.width:
        raise ValueError(f"{path}: {topic}: {values.size} pixels do not fill {message.width}x{message.height}")
    pixels = values.reshape(message.height, row)[:, : message.width]
    return np.ascontiguousarray(pixels.byteswap() if message.is_bigendian and kind == np.uint16 else pixels)


def intrinsic_of(path: Path, topic: str, message: Any) -> Camera:
    """Returns the camera that a CameraInfo describes. Raises ValueError for a lens model that is not supported."""
    K, given = (np.asarray(_either(message, name), float) for name in ("k", "d"))
    K, model = K.reshape(3, 3), message.distortion_model.lower()
    if model in _FISHEYE:
        distortion = given[:4]
        if len(distortion) != 4:
            raise ValueError(f"{path}: {topic}: a fisheye lens has d = {distortion.tolist()}, expected 4 numbers")
    else:
        coefficients = np.trim_zeros(given, "b")
        if len(coefficients) > _BROWN.get(model, 0):
            raise ValueError(
                f"{path}: {topic}: distortion_model is {message.distortion_model!r} with d = {coefficients.tolist()}; "
                "only the five numbers of plumb_bob (Brown and Conrady), the eight of rational_polynomial and the four "
                "of equidistant (a fisheye lens) are read: record rectified infrared images"
            )
        distortion = np.zeros(8 if len(coefficients) > 5 else 5)
        distortion[: len(coefficients)] = coefficients
    if not (K[0, 0] > 0 and K[1, 1] > 0):
        raise ValueError(f"{path}: {topic}: K is {K.ravel().tolist()}, expected focal lengths above 0")
    return Camera(int(message.width), int(message.height), K, distortion)


def _color_pixels(path: Path, topic: str, message: Any) -> NDArray[np.uint8]:
    """Decodes a colour image message as RGB, uint8 [height, width, 3]."""
    content = np.asarray(message.data, np.uint8)
    if hasattr(message, "format"):
        return _unpacked(path, topic, content.tobytes(), "RGB")
    name, size = message.encoding.lower(), (message.height, message.width)
    depth = 2 if name in _YUV else _CHANNELS.get(name, 1)
    if depth == 1 and name not in ("mono8", "8uc1", "y8"):
        known = ", ".join([*_CHANNELS, *_YUV, "mono8"])
        raise ValueError(f"{path}: {topic}: encoding is '{message.encoding}', expected one of {known}")
    if message.step < depth * message.width or content.size != message.step * message.height:
        raise ValueError(f"{path}: {topic}: {content.size} bytes do not fill {message.width}x{message.height}")
    pixels = content.reshape(message.height, message.step)[:, : depth * message.width].reshape(*size, depth)
    if name in _YUV:
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), _YUV[name]), np.uint8)
    if depth == 1:
        return np.repeat(pixels, 3, axis=2)
    return np.ascontiguousarray(pixels[..., 2::-1] if name.startswith("bgr") else pixels[..., :3])


_MOST_OF_8_BITS = 255


class Pair(NamedTuple):
    """Two rectified images of one size, uint8, or uint16 if the first pair has counts above 255. name: unique in the
    recording and usable as a file name."""

    name: str
    left: NDArray[np.generic]
    right: NDArray[np.generic]


def recorded_pairs(path: Path, is_wanted: Callable[[str], bool] = lambda name: True) -> Iterator[Pair]:
    """Yields a recording's infrared pairs in order of time. is_wanted(name): decides whether to decode a pair. Raises
    ValueError, one line, with the recording and its fault, after it has yielded the pairs before the fault."""
    if is_bag(path):
        pairs = read_pairs(path, is_wanted)
    else:
        pairs = (
            (name, read_gray(entry.files["left"], key="left"), read_gray(entry.files["right"], key="right"))
            for number, entry in enumerate(frame_files(path))
            if is_wanted(name := f"{number:06d}")
        )
    first: NDArray[np.generic] | None = None
    for name, left, right in pairs:
        if left.shape != right.shape or (first is not None and left.shape != first.shape):
            sizes = " and ".join(f"{image.shape[1]}x{image.shape[0]}" for image in (left, right))
            expected = "" if first is None else f", the pairs before {first.shape[1]}x{first.shape[0]}"
            raise ValueError(f"{path}: {name}: left and right are {sizes}{expected}: they must be of one size")
        if first is None:
            is_byte = max(int(left.max()), int(right.max())) <= _MOST_OF_8_BITS
            first = left.astype(np.uint8 if is_byte else np.uint16)
        elif first.dtype == np.uint8 and max(int(left.max()), int(right.max())) > _MOST_OF_8_BITS:
            told = "has counts above 255, where the pairs before have 8 bits"
            raise ValueError(f"{path}: {name}: {told}: give pairs of one bit depth")
        yield Pair(name, left.astype(first.dtype), right.astype(first.dtype))
