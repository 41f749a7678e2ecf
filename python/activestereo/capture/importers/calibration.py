# SPDX-License-Identifier: Apache-2.0
"""Reads a calibration of both infrared cameras, whichever program wrote it.

ROS: files of camera_calibration's cameracalibrator (camera_matrix, distortion_coefficients, rectification_matrix,
projection_matrix), or output of `rostopic echo` and `ros2 topic echo` (K, D, R, P, in either case). Each file or
document holds one camera. The right camera is the one whose P[3] is below 0: -fx x baseline (REP 104). Kalibr: cam0 and
cam1, with T_cn_cnm1 from cam0 to cam1. OpenCV: a FileStorage with the names of its sample stereo_calib: M1 D1 M2 D2
with R T, which maps camera 1 to camera 2, or P1 P2 of both rectified images. Middlebury's stereo sets of 2014 and later
and ETH3D's two-view sets: a calib.txt with cam0 and cam1 as [f 0 cx; 0 f cy; 0 0 1], doffs = cx1 - cx0 in pixels,
baseline in millimetres, width and height.

Values of YAML stay texts until a number is asked for, and tags build no objects. So `!!bool foo`, `!!opencv-matrix`,
merge keys and numbers in base 60 do no harm. Aliases share their targets, and nothing here walks deeper than a matrix.
Reading YAML needs PyYAML: python3-yaml of Debian, or pip install pyyaml."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Camera
from activestereo.capture.importers.frames import INFRARED
from activestereo.capture.importers.realsense_text import DeviceText, read_device_text
from activestereo.common.baseline import with_baseline
from activestereo.common.input_files import read_bytes, read_text
from activestereo.common.limits import DISTORTION, LENGTH, PIXEL, SIDE, Limits, camera_matrix_fault
from activestereo.common.optional import imported
from activestereo.common.pose import printed_motion, rigid_motion
from activestereo.common.shown import shown

_NO_LENS = np.zeros(5)
_FISHEYE = ("equidistant", "fisheye")
_ROS_MODELS = ("plumb_bob", "rational_polynomial", *_FISHEYE)
# Parts of names of the right camera. Its P[3], if not 0, decides before the name.
_RIGHT = re.compile(r"right|infra(?:red)?[ _-]?2|ir2", re.I)
# Names of the matrices of OpenCV's cameras 1 and 2 in several programs.
_MATRICES, _LENSES = ("M{}", "K{}", "cameraMatrix{}"), ("D{}", "distCoeffs{}")
_MOST_BYTES = 1 << 18  # a calibration has some thousand bytes
_NOTHING = (None, "", "~", "null")
# OpenCV's FileStorage writes this first, which YAML has otherwise: %YAML 1.0.
_OPENCV_DIRECTIVE = re.compile(r"%YAML:[\d.]+")


@dataclass(frozen=True)
class Entry:
    """A YAML mapping with checked reads by key. name: the file and the mapping's place in it, for error messages."""

    name: str
    values: dict[str, Any]

    def fail(self, key: str, what: str) -> NoReturn:
        raise ValueError(f"{self.name}: {key}: {what}")

    def has(self, key: str) -> bool:
        value = self.values.get(key)
        return isinstance(value, dict | list) or value not in _NOTHING

    def named(self, *keys: str) -> tuple[str, Any]:
        """Returns (key, value) of the first of `keys` that exists. Raises ValueError if none does."""
        for key in keys:
            if self.has(key):
                return key, self.values[key]
        self.fail(keys[0], "is missing")

    def entry(self, key: str) -> Entry | None:
        """Returns the mapping under a key; None if there is none."""
        value = self.values.get(key)
        return Entry(f"{self.name}: {key}", value) if isinstance(value, dict) else None

    def one_of(self, known: Sequence[str], key: str, default: str | None = None) -> str:
        """Reads a text that must be one of `known`. default: used if the key is missing."""
        value = self.named(key)[1] if default is None or self.has(key) else default
        if value not in known:
            self.fail(key, f"is {shown(value)}, expected {' or '.join(known)}")
        return str(value)

    def numbers(self, counts: Sequence[int], limits: Limits, *keys: str) -> NDArray[np.float64]:
        """Reads numbers from a list, a list of rows, or a matrix' data, under the first of `keys` that exists. Their
        count must be one of `counts`."""
        key, value = self.named(*keys)
        if isinstance(value, dict):
            value = value.get("data")
        if not isinstance(value, list):
            self.fail(key, f"has no list, expected {' or '.join(map(str, counts))} numbers")
        most = max(counts)
        # The entries of the list, or of the lists in it: at most one more than `most`.
        rows = [row[: most + 1] if isinstance(row, list) else [row] for row in value[: most + 1]]
        texts = [text for row in rows for text in row][: most + 1]
        if len(texts) not in counts:
            has = f"more than {most}" if len(texts) > most else str(len(texts))
            self.fail(key, f"has {has} entries, expected {' or '.join(map(str, counts))} numbers")
        given = [(_whole if limits.whole else _number)(text) for text in texts]
        for i, number in enumerate(given):
            if (fault := limits.fault(number)) is not None:
                self.fail(f"{key}[{i}]", fault)
        return np.array(given, dtype=np.float64)

    def side(self, *keys: str) -> int:
        """Reads a width or a height in pixels, under the first of `keys` that exists."""
        key, value = self.named(*keys)
        if (fault := SIDE.fault(_whole(value))) is not None:
            self.fail(key, fault)
        return int(value)

    def lens(self, is_fisheye: bool, *keys: str) -> NDArray[np.float64]:
        """Reads distortion coefficients: four of a fisheye lens, else five or eight in OpenCV's order k1 k2 p1 p2 k3 k4
        k5 k6."""
        if is_fisheye:
            return self.numbers((4,), DISTORTION, *keys)
        given = self.numbers((0, 4, 5, 8, 12, 14), DISTORTION, *keys)
        if np.any(given[8:]):
            self.fail(keys[0], "has a thin prism or a tilted sensor (its ninth number and on), which is not read")
        return given[:8] if len(given) >= 8 else np.pad(given, (0, 5 - len(given)))


_READ = "ROS' camera_info, Kalibr's camchain or OpenCV's matrices are read"


def read_entries(path: Path) -> list[Entry]:
    """Reads a YAML file's mappings, one for each document. Raises ValueError with the file and the fault."""
    mending = "apt-get install python3-yaml, or pip install pyyaml"
    yaml = imported("yaml", f"{path}: YAML is read by the package PyYAML, which is missing: {mending}", ValueError)
    try:
        text = _OPENCV_DIRECTIVE.sub("", read_bytes(path, _MOST_BYTES).decode("utf-8-sig"), count=1)
        found = [document for document in yaml.load_all(text, yaml.BaseLoader) if document not in _NOTHING]
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is no text in UTF-8: {error}") from error
    except RecursionError:
        raise ValueError(f"{path}: is nested too deep") from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # such as "\\UFFFFFFFF", which no character is
        raise ValueError(f"{path}: is not YAML: {' '.join(str(error).split())}") from error
    if not found or not all(isinstance(document, dict) for document in found):
        raise ValueError(f"{path}: has no mapping: {_READ}")
    several = len(found) > 1
    return [Entry(f"{path} ({i + 1})" if several else str(path), document) for i, document in enumerate(found)]


def _number(text: Any) -> Any:
    """Converts a text to its number; any other value returns unchanged."""
    try:
        return float(text) if isinstance(text, str) else text
    except ValueError:
        return {".inf": np.inf, "-.inf": -np.inf, ".nan": np.nan}.get(text.lower(), text)


def _whole(text: Any) -> Any:
    return int(text) if isinstance(text, str) and text.isascii() and text.isdecimal() and len(text) < 10 else text


def read_calibration_yaml(
    paths: Sequence[Path],
    are_rectified: bool = False,
    baseline_m: float | None = None,
    size: tuple[int, int] | None = None,
) -> DeviceText:
    """Reads the calibration from Kalibr's file, from ROS' two in any order (or one with two documents), or from
    OpenCV's. are_rectified: the images are ROS' image_rect, described by P, instead of image_raw. baseline_m: used if
    ROS' P[3] are 0. size: (width, height) of the images, used if OpenCV's files have none. Raises ValueError with file,
    key and value, or with the package if PyYAML is missing."""
    entries = [entry for path in paths for entry in read_entries(Path(path))]
    path = Path(paths[0])
    chain = next((entry for entry in entries if entry.has("cam0")), None)
    if chain is not None:
        if len(entries) > 1:
            raise ValueError(f"{chain.name}: is Kalibr's chain of all cameras: give it alone")
        if are_rectified:
            raise ValueError(f"{chain.name}: Kalibr calibrates images as they are: give no --rectified")
        lenses, cameras = [], []
        for key in ("cam0", "cam1"):
            camera = chain.entry(key)
            if camera is None:
                chain.fail(key, "is missing: a pair has cam0 and cam1")
            cameras.append(camera)
            camera.one_of(("pinhole",), "camera_model")
            model = camera.one_of(("radtan", "equi", "none"), "distortion_model")
            width, height = camera.numbers((2,), SIDE, "resolution")
            fx, fy, cx, cy = camera.numbers((4,), PIXEL, "intrinsics")
            K = _matrix(camera, np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]), "intrinsics")
            lens = _NO_LENS if model == "none" else camera.lens(model == "equi", "distortion_coeffs")
            lenses.append(Camera(int(width), int(height), K, lens))
        motion = cameras[1].numbers((16,), LENGTH, "T_cn_cnm1").reshape(4, 4)
        to_second = printed_motion(motion[:3, :3], motion[:3, 3], f"{cameras[1].name}: T_cn_cnm1", motion[3])
    elif any(entry.has(key) for entry in entries for key in ("P1", *(name.format(1) for name in _MATRICES))):
        whole = Entry(entries[0].name, {key: value for entry in entries for key, value in entry.values.items()})
        lenses, to_second = _opencv(whole, are_rectified, size)
    else:
        return _ros(path, entries, are_rectified, baseline_m)
    if to_second[0, 3] > 0.0:  # the cameras are given in either order
        lenses, to_second = lenses[::-1], np.linalg.inv(to_second)
    return DeviceText.of_pair(path, lenses, to_second)


def _ros(path: Path, entries: Sequence[Entry], are_rectified: bool, baseline_m: float | None) -> DeviceText:
    # 1. Each camera as ROS describes it: before rectification, the rotation R to its rectified image, and that image's
    # 3x4 projection P.
    cameras = []
    for entry in entries:
        if not (entry.has("image_width") or entry.has("width")):
            entry.fail("image_width", f"is missing: {_READ}")
        width, height = entry.side("image_width", "width"), entry.side("image_height", "height")
        K = _matrix(entry, entry.numbers((9,), PIXEL, "camera_matrix", "K", "k").reshape(3, 3), "camera_matrix")
        is_fisheye = entry.one_of(_ROS_MODELS, "distortion_model", default="plumb_bob") in _FISHEYE
        raw = Camera(width, height, K, entry.lens(is_fisheye, "distortion_coefficients", "D", "d"))
        turn = entry.numbers((9,), PIXEL, "rectification_matrix", "R", "r")
        R = printed_motion(turn, np.zeros(3), f"{entry.name}: rectification_matrix")[:3, :3]
        P = entry.numbers((12,), PIXEL, "projection_matrix", "P", "p").reshape(3, 4)
        _matrix(entry, P[:, :3], "projection_matrix")
        header = entry.entry("header")
        names = (entry.values.get("camera_name"), None if header is None else header.values.get("frame_id"))
        is_right = any(isinstance(name, str) and _RIGHT.search(name) for name in names)
        cameras.append((-P[0, 3], is_right, entry.name, raw, R, P))
    if len(cameras) != 2:
        raise ValueError(
            f"{path}: {len(cameras)} camera{'s' if len(cameras) != 1 else ''} of ROS, expected both cameras: give "
            "--calibration twice, for the left and for the right one's file"
        )
    # 2. The right one has the lower P[3], else the name of a right one.
    (*_, left, left_R, left_P), (*_, name, right, right_R, right_P) = sorted(cameras, key=lambda camera: camera[:2])
    told_m = -right_P[0, 3] / right_P[0, 0]
    if told_m < 0.0 or left_P[0, 3] != 0.0:
        raise ValueError(
            f"{name}: projection_matrix: P[3] of the cameras is {left_P[0, 3]:g} and {right_P[0, 3]:g}, expected "
            "0 of the left and -fx x baseline of the right one: calibrate both as a stereo pair"
        )
    length_m = told_m or baseline_m or 0.0  # the caller raises for 0
    if are_rectified:
        lenses = [Camera(c.width, c.height, P[:, :3].copy(), _NO_LENS) for c, P in ((left, left_P), (right, right_P))]
        return DeviceText.of_pair(path, lenses, float(length_m))
    # R turns a camera's own axes into the rectified ones, which differ by the baseline alone.
    left_to_right = rigid_motion(right_R.T @ (-length_m, 0.0, 0.0), right_R.T @ left_R)
    return DeviceText.of_pair(path, [left, right], left_to_right)


def _opencv(
    entry: Entry, are_rectified: bool, size: tuple[int, int] | None
) -> tuple[list[Camera], NDArray[np.float64]]:
    """Returns the two cameras, and the motion from the first one's axes to the second one's."""
    if size is None or entry.has("image_width"):
        size = entry.side("image_width"), entry.side("image_height")
    width, height = size
    if are_rectified:
        P1, P2 = (entry.numbers((12,), PIXEL, key).reshape(3, 4) for key in ("P1", "P2"))
        lenses = [
            Camera(width, height, _matrix(entry, P[:, :3], key)) for P, key in ((P1.copy(), "P1"), (P2.copy(), "P2"))
        ]
        return lenses, rigid_motion(((P2[0, 3] - P1[0, 3]) / P2[0, 0], 0.0, 0.0))
    is_fisheye = entry.one_of(_ROS_MODELS, "distortion_model", default="plumb_bob") in _FISHEYE
    lenses = []
    for number in (1, 2):
        keys = [name.format(number) for name in _MATRICES]
        K = _matrix(entry, entry.numbers((9,), PIXEL, *keys).reshape(3, 3), entry.named(*keys)[0])
        lenses.append(Camera(width, height, K, entry.lens(is_fisheye, *(name.format(number) for name in _LENSES))))
    for key in ("R", "T"):
        if not entry.has(key):
            entry.fail(key, "is missing: give --calibration twice, for OpenCV's intrinsics.yml and its extrinsics.yml")
    turn, place = entry.numbers((9,), PIXEL, "R"), entry.numbers((3,), LENGTH, "T")
    return lenses, printed_motion(turn, place, f"{entry.name}: R and T")


def _matrix(entry: Entry, K: NDArray[np.float64], key: str) -> NDArray[np.float64]:
    if (fault := camera_matrix_fault(K)) is not None:
        entry.fail(key, fault)
    return K


_LINE = re.compile(r"^\s*(\w+)\s*=\s*(.*?)\s*$", re.M)
_MOST_ROUNDING_PX = 0.01


def read_middlebury(path: Path) -> DeviceText:
    """Reads both rectified cameras from a calib.txt. Raises ValueError with file, key and value."""
    texts = _LINE.findall(read_text(path))
    entry = Entry(str(path), {key: text.strip("[]").replace(";", " ").split() for key, text in texts})
    K = [_matrix(entry, entry.numbers((9,), PIXEL, key).reshape(3, 3), key) for key in ("cam0", "cam1")]
    apart_px = K[1][0, 2] - K[0][0, 2]
    doffs = entry.numbers((1,), PIXEL, "doffs")[0] if entry.has("doffs") else apart_px
    if abs(apart_px - doffs) > _MOST_ROUNDING_PX:
        entry.fail("doffs", f"is {doffs:g}, expected cx1 - cx0, which is {apart_px:g} px")
    (width,), (height,), (baseline_mm,) = (
        entry.numbers((1,), limits, key) for key, limits in (("width", SIDE), ("height", SIDE), ("baseline", LENGTH))
    )
    cameras = [Camera(int(width), int(height), own) for own in K]
    return DeviceText.of_pair(path, cameras, float(1e-3 * baseline_mm))


# JSON is YAML, and OpenCV's FileStorage writes both.
_YAML = (".yaml", ".yml", ".json")


def read_calibration_files(
    paths: Sequence[Path], are_rectified: bool, baseline_m: float | None, size: tuple[int, int] | None
) -> DeviceText:
    """Reads the calibration from one file, or from the two that ROS or OpenCV write. are_rectified: the images are
    already rectified, so that the file's P describes them. baseline_m: the user's baseline, or None. size: (width,
    height) of the images, for files without it. Raises ValueError with file, key, value and remedy."""
    texts = [read_text(path, errors="replace") for path in paths]
    if any(p.suffix.lower() in _YAML or text.startswith("%YAML") for p, text in zip(paths, texts, strict=True)):
        device = read_calibration_yaml(paths, are_rectified, baseline_m, size)
    elif len(paths) > 1:
        raise ValueError(f"{paths[1]}: --calibration is given twice: only ROS' and OpenCV's YAML has two files")
    elif re.search(r"^\s*cam0\s*=", texts[0], re.M):
        device = read_middlebury(paths[0])
    elif are_rectified:
        raise ValueError(f"{paths[0]}: --rectified is about ROS' and OpenCV's YAML: leave it out")
    else:
        device = read_device_text(paths[0])
    is_told = INFRARED in device.extrinsics or INFRARED[::-1] in device.extrinsics
    if not is_told and baseline_m is None:
        return device  # extrinsic() raises later if it is asked for
    told = device.extrinsic(*INFRARED) if is_told else np.eye(4)
    motion = with_baseline(str(device.path), told, baseline_m)
    return replace(device, extrinsics=device.extrinsics | {INFRARED: motion})
