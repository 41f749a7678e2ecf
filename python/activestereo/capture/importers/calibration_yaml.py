# SPDX-License-Identifier: Apache-2.0
"""Calibrations in YAML: ROS' camera_info of both cameras, and Kalibr's camera chain.

ROS: what camera_calibration's cameracalibrator saves (camera_matrix, distortion_coefficients, rectification_matrix,
projection_matrix), or what `rostopic echo` and `ros2 topic echo` print (K, D, R, P, in either case), of one camera in
each file or document. The right camera is the one whose P[3] is below 0: -fx x baseline (REP 104). Kalibr: cam0 and
cam1, with T_cn_cnm1 from cam0 to cam1. Reading needs PyYAML: python3-yaml of Debian, or pip install pyyaml.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Camera
from activestereo.capture.importers.realsense_text import DeviceText
from activestereo.common.input_files import read_bytes
from activestereo.common.limits import DISTORTION, FOCAL, PIXEL, SIDE, Limits
from activestereo.common.pose import printed_motion

SUFFIXES = (".yaml", ".yml")
_MOST_BYTES = 1 << 20
_SIDES = ("Infrared 1", "Infrared 2")
_NO_LENS = np.zeros(5)
_FISHEYE = ("equidistant", "fisheye")
_ROS_MODELS = ("plumb_bob", "rational_polynomial", *_FISHEYE)


@dataclass(frozen=True)
class _Entry:
    """One camera's mapping, with the name that errors have of it."""

    name: str
    values: dict[str, Any]

    def fail(self, key: str, what: str) -> NoReturn:
        raise ValueError(f"{self.name}: {key}: {what}")

    def named(self, *keys: str) -> tuple[str, Any]:
        """(key, value) of the first of some keys that is there."""
        for key in keys:
            if self.values.get(key) is not None:
                return key, self.values[key]
        self.fail(keys[0], "is missing")

    def numbers(self, counts: Sequence[int], limits: Limits, *keys: str) -> NDArray[np.float64]:
        """A list, or the data of a matrix, of as many numbers as one of `counts`."""
        key, value = self.named(*keys)
        if isinstance(value, dict):
            value = value.get("data")
        if not isinstance(value, list) or len(value) not in counts:
            has = f"{len(value)} entries" if isinstance(value, list) else "no list"
            self.fail(key, f"has {has}, expected {' or '.join(map(str, counts))} numbers")
        given = [_number(number) for number in value]
        for i, number in enumerate(given):
            fault = limits.fault(number)
            if fault is not None:
                self.fail(f"{key}[{i}]", fault)
        return np.array(given, dtype=np.float64)

    def side(self, *keys: str) -> int:
        key, value = self.named(*keys)
        fault = SIDE.fault(value) if isinstance(value, int) else f"is {value!r}, expected a whole number"
        if fault is not None:
            self.fail(key, fault)
        return int(value)


@dataclass(frozen=True)
class _Camera:
    """A camera as ROS has it; R and P are those of its rectified image."""

    name: str
    raw: Camera
    R: NDArray[np.float64]
    P: NDArray[np.float64]


def read_calibration_yaml(paths: Sequence[Path], are_rectified: bool = False) -> DeviceText:
    """The DeviceText of Kalibr's file, or of ROS' two (or one with two documents), in any order. are_rectified: ROS'
    images are image_rect's, which P describes, in place of image_raw's. ValueError names file, key and value of what is
    wrong, or the package where PyYAML is missing."""
    documents = [entry for path in paths for entry in _documents(Path(path))]
    chains = [entry for entry in documents if "cam0" in entry.values]
    if chains:
        if len(documents) > 1:
            raise ValueError(f"{chains[0].name}: is Kalibr's chain of all cameras: give it alone")
        if are_rectified:
            raise ValueError(f"{chains[0].name}: Kalibr calibrates images as they are: give no --rectified")
        return _kalibr(Path(paths[0]), chains[0])
    cameras = [_ros_camera(entry) for entry in documents]
    if len(cameras) != 2:
        raise ValueError(
            f"{paths[0]}: {len(cameras)} camera{'s' if len(cameras) != 1 else ''} of ROS, expected both cameras: give "
            "--calibration twice, for the left and for the right one's file"
        )
    return _ros_pair(Path(paths[0]), cameras, are_rectified)


def _documents(path: Path) -> list[_Entry]:
    """The file's mappings."""
    try:
        import yaml
    except ImportError as error:
        raise ValueError(
            f"{path}: YAML is read by the package PyYAML, which is missing: apt-get install python3-yaml, or pip "
            "install pyyaml"
        ) from error
    try:
        text = read_bytes(path, _MOST_BYTES).decode()
        found = [document for document in yaml.safe_load_all(text) if document is not None]
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is no text in UTF-8: {error}") from error
    except RecursionError:
        raise ValueError(f"{path}: is nested too deep") from None
    except (yaml.YAMLError, ValueError) as error:  # ValueError: a date that there is not
        raise ValueError(f"{path}: is not YAML: {' '.join(str(error).split())}") from error
    if not found or not all(isinstance(document, dict) for document in found):
        raise ValueError(f"{path}: has no mapping: ROS' camera_info or Kalibr's camchain is asked for")
    several = len(found) > 1
    return [_Entry(f"{path} ({i + 1})" if several else str(path), document) for i, document in enumerate(found)]


def _ros_camera(entry: _Entry) -> _Camera:
    width, height = entry.side("image_width", "width"), entry.side("image_height", "height")
    K = _matrix(entry, entry.numbers((9,), PIXEL, "camera_matrix", "K", "k").reshape(3, 3), "camera_matrix")
    model = str(entry.values.get("distortion_model", "plumb_bob")) or "plumb_bob"
    if model not in _ROS_MODELS:
        entry.fail("distortion_model", f"is {model!r}, expected {' or '.join(_ROS_MODELS)}")
    is_fisheye = model in _FISHEYE
    lens = entry.numbers((4,) if is_fisheye else (0, 4, 5, 8), DISTORTION, "distortion_coefficients", "D", "d")
    R = entry.numbers((9,), PIXEL, "rectification_matrix", "R", "r").reshape(3, 3)
    R = printed_motion(R, np.zeros(3), f"{entry.name}: rectification_matrix")[:3, :3]
    P = entry.numbers((12,), PIXEL, "projection_matrix", "P", "p").reshape(3, 4)
    _matrix(entry, P[:, :3], "projection_matrix")
    return _Camera(entry.name, Camera(width, height, K, lens if is_fisheye else _five_or_eight(lens)), R, P)


def _ros_pair(path: Path, cameras: list[_Camera], are_rectified: bool) -> DeviceText:
    left, right = sorted(cameras, key=lambda camera: -camera.P[0, 3])
    baseline_m = -right.P[0, 3] / right.P[0, 0]
    if baseline_m <= 0.0 or left.P[0, 3] != 0.0:
        raise ValueError(
            f"{right.name}: projection_matrix: P[3] of the cameras is {left.P[0, 3]:g} and {right.P[0, 3]:g}, expected "
            "0 of the left and -fx x baseline of the right one: calibrate both as a stereo pair"
        )
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -baseline_m
    lenses = [left.raw, right.raw]
    if are_rectified:
        lenses = [Camera(c.raw.width, c.raw.height, c.P[:, :3].copy(), _NO_LENS) for c in (left, right)]
    else:
        # R turns a camera's own axes into the rectified ones, which differ by the baseline alone.
        left_to_right[:3, :3] = right.R.T @ left.R
        left_to_right[:3, 3] = right.R.T @ (-baseline_m, 0.0, 0.0)
    return _device(path, lenses, left_to_right)


def _kalibr(path: Path, chain: _Entry) -> DeviceText:
    cameras = []
    for key in ("cam0", "cam1"):
        if not isinstance(chain.values.get(key), dict):
            chain.fail(key, "is missing: a pair has cam0 and cam1")
        cameras.append(_Entry(f"{chain.name}: {key}", chain.values[key]))
    lenses = [_kalibr_lens(camera) for camera in cameras]
    rows = cameras[1].named("T_cn_cnm1")[1]
    try:
        motion = np.array(rows, dtype=np.float64).reshape(4, 4)
    except (TypeError, ValueError):
        cameras[1].fail("T_cn_cnm1", "is not 4 rows of 4 numbers")
    to_second = printed_motion(motion[:3, :3], motion[:3, 3], f"{cameras[1].name}: T_cn_cnm1", motion[3])
    if to_second[0, 3] > 0.0:  # cam0 is the right camera
        return _device(path, lenses[::-1], np.linalg.inv(to_second))
    return _device(path, lenses, to_second)


def _kalibr_lens(camera: _Entry) -> Camera:
    for key, known in (("camera_model", ("pinhole",)), ("distortion_model", ("radtan", "equi", "none"))):
        value = camera.named(key)[1]
        if value not in known:
            camera.fail(key, f"is {value!r}, expected {' or '.join(known)}")
    width, height = camera.numbers((2,), SIDE, "resolution")
    fx, fy, cx, cy = camera.numbers((4,), PIXEL, "intrinsics")
    K = _matrix(camera, np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]), "intrinsics")
    model = camera.values["distortion_model"]
    lens = _NO_LENS if model == "none" else camera.numbers((4,), DISTORTION, "distortion_coeffs")
    return Camera(int(width), int(height), K, lens if model == "equi" else _five_or_eight(lens))


def _number(value: Any) -> Any:
    """The value, as a number where YAML 1.1 takes one for text: 1e-05, which has no point."""
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _matrix(entry: _Entry, K: NDArray[np.float64], key: str) -> NDArray[np.float64]:
    if min(K[0, 0], K[1, 1]) < FOCAL.low or np.any(K[2] != (0.0, 0.0, 1.0)) or K[1, 0] != 0.0:
        entry.fail(key, f"is no camera matrix [fx s cx, 0 fy cy, 0 0 1] with focal lengths of {FOCAL}")
    return K


def _five_or_eight(lens: NDArray[np.float64]) -> NDArray[np.float64]:
    """k1 k2 p1 p2 without the rest, or none, as five."""
    return lens if len(lens) == 8 else np.pad(lens, (0, 5 - len(lens)))


def _device(path: Path, lenses: Sequence[Camera], left_to_right: NDArray[np.float64]) -> DeviceText:
    modes = {(name, lens.width, lens.height): lens for name, lens in zip(_SIDES, lenses, strict=True)}
    return DeviceText(path, modes, {_SIDES: left_to_right})
