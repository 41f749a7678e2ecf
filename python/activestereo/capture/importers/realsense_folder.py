# SPDX-License-Identifier: Apache-2.0
"""Imports a folder of PNG files as a capture: infrared pairs, 16-bit depth if there is any, and colour.

A word anywhere in a file's name gives its stream: "Infrared 1" or left, "Infrared 2" or right, Depth, Color. The last
number beside it is the time in milliseconds, or since 1970 in s, ms, us or ns, or the frame's number. This covers the
names of rs-convert and of the viewer, and left/000001.png beside right/000001.png. Without such numbers, names of a
frame differ only in the stream's word: left/desk.png beside right/desk.png, desk_left.png beside desk_right.png."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Capture, ColorCamera, Frame, Projector, Rig
from activestereo.capture.images import image_size
from activestereo.capture.importers.frames import pose_at, write_frames
from activestereo.capture.importers.realsense_text import DeviceText
from activestereo.common.progress_bar import Progress, silent

_STREAMS = {
    "left": re.compile(r"infra(?:red)?(?:1|[ _-]1(?!\d))|left|ir1", re.I),  # infrared_1700000000123 is of either
    "right": re.compile(r"infra(?:red)?(?:2|[ _-]2(?!\d))|right|ir2", re.I),
    "depth": re.compile(r"depth", re.I),
    "color": re.compile(r"color|colour|rgb", re.I),
}
_NAMES = {"left": "Infrared 1", "right": "Infrared 2"}
# Folders of frames that were taken with the projector off.
_OFF = re.compile(r"(?:^|[ _-])off(?:$|[ _-])", re.I)
_BETWEEN_WORDS = re.compile(r"[ _-]+")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
# Streams of one frame differ by less than this, milliseconds.
SAME_FRAME_MS = 8.0
DEPTH_SCALE_M = 0.001  # of librealsense, unless the device was set otherwise
# Numbers in names between these are times, milliseconds; others count frames, or are dates of 14 digits or more.
LEAST_TIME_MS, _MOST_TIME_MS = 1e6, 1e13
_LEAST_DATE_MS = 1e12  # times since 1970 lie above it, in the year 2001


@dataclass(frozen=True)
class RobotPoses:
    """Poses of a robot that carries the camera. gripper_to_base: {name of a frame's left file without suffix: 4x4}.
    camera_to_gripper: 4x4 of the left camera."""

    gripper_to_base: dict[str, NDArray[np.float64]]
    camera_to_gripper: NDArray[np.float64]

    def at(self, left: Path) -> tuple[NDArray[np.float64], int]:
        """Returns (a frame's gripper_to_base, 4x4; the pose's index among the robot's different poses). left: the
        frame's left image. Raises ValueError if the frame is not listed."""
        if left.stem not in self.gripper_to_base:
            told = f"is missing in the robot's {len(self.gripper_to_base)} poses"
            raise ValueError(f"{left}: {told}: add one named {left.stem}")
        pose = self.gripper_to_base[left.stem]
        groups = list(dict.fromkeys(p.tobytes() for p in self.gripper_to_base.values()))
        return pose, groups.index(pose.tobytes())


@dataclass(frozen=True)
class FrameFiles:
    """The files of one frame by stream. number: the number in the left file's name, else the frame's index. view: index
    of the folder that the frame is from. projector_power: 0 below a folder that is named off. exposure_s: None if the
    recording does not tell it."""

    number: float
    files: dict[str, Path]
    view: int = 0
    projector_power: float = 1.0
    exposure_s: float | None = None
    gain: float = 1.0


def frame_files(folder: Path, depth_word: str | None = None) -> list[FrameFiles]:
    """Lists a folder's frames that have both infrared images, view by view in order of time. A subfolder with images of
    both cameras is a view, such as walls/near and walls/far, or desk/on and desk/off. depth_word: a word in the names
    of the depth images to take, if there are several kinds; None: "depth". Raises ValueError without frames."""
    folder = Path(folder)
    streams = _STREAMS if depth_word is None else _STREAMS | {"depth": re.compile(re.escape(depth_word), re.I)}
    out = []
    around = {folder.resolve(), *folder.resolve().parents}
    for number, view in enumerate(_views(folder, around)):
        power = 0.0 if any(_OFF.search(part) for part in view.relative_to(folder).parts) else 1.0
        out += [replace(entry, view=number, projector_power=power) for entry in _view_files(view, streams)]
    if depth_word is not None and not any("depth" in entry.files for entry in out):
        named = sum(bool(streams["depth"].search(file.name)) for file in folder.rglob("*.png"))
        told = f"{named} PNG files have '{depth_word}' in their names, but none belongs to one of the {len(out)}"
        remedy = f"give depth the number of its left image, or the same name but for '{depth_word}'"
        raise ValueError(f"{folder}: {told} left images: {remedy}")
    return out


def swapped(files: list[FrameFiles]) -> list[FrameFiles]:
    """Returns the frames with the left and the right images exchanged."""
    return [
        replace(entry, files=entry.files | {"left": entry.files["right"], "right": entry.files["left"]})
        for entry in files
    ]


def _views(folder: Path, seen: set[Path]) -> list[Path]:
    """Lists the innermost folders with both cameras' images, or the folder itself. seen: folders that were visited, to
    which links may lead back."""
    out = []
    for child in sorted(folder.iterdir()):
        if child.is_dir() and child.resolve() not in seen:
            names = [file.relative_to(child).as_posix() for file in child.rglob("*.png")]
            if all(any(_STREAMS[side].search(name) for name in names) for side in ("left", "right")):
                seen.add(child.resolve())
                out += _views(child, seen)
    return out or [folder]


def _view_files(folder: Path, streams: dict[str, re.Pattern[str]]) -> list[FrameFiles]:
    by_stream: dict[str, list[tuple[float | None, Path]]] = {stream: [] for stream in streams}
    for file in sorted(folder.rglob("*.png")):
        name = file.relative_to(folder).as_posix()
        stream = next((s for s, pattern in streams.items() if pattern.search(name)), None)
        if stream is not None:
            numbers = _NUMBER.findall(streams[stream].sub("", file.stem))
            by_stream[stream].append((_in_ms(float(numbers[-1])) if numbers else None, file))
    for stream in ("left", "right"):
        if not by_stream[stream]:
            raise ValueError(
                f"{folder}: {_NAMES[stream]}: no PNG file has a name with it: record both infrared streams"
            )
    # If every name has a number of its own, files are joined by equal numbers or near times.
    numbers = [[number for number, _ in files] for files in by_stream.values()]
    if any(None in own or len(set(own)) < len(own) for own in numbers):
        return _join_by_name(folder, by_stream, streams)
    numbered = {stream: [(number or 0.0, file) for number, file in files] for stream, files in by_stream.items()}
    frames = list[FrameFiles]()
    for time_ms, left in sorted(numbered["left"], key=_place_in_order):
        files, is_time = {"left": left}, LEAST_TIME_MS < time_ms < _MOST_TIME_MS
        for stream in ("right", "depth", "color"):
            number, file = min(numbered[stream], key=lambda item: abs(item[0] - time_ms), default=(np.inf, left))
            if number == time_ms or (is_time and abs(number - time_ms) < SAME_FRAME_MS):
                files[stream] = file
        if "right" in files:
            frames.append(FrameFiles(time_ms if time_ms < _MOST_TIME_MS else float(len(frames)), files))
    if not frames:
        told = f"the same number, or times less than {SAME_FRAME_MS:g} ms apart, in their names"
        raise ValueError(f"{folder}: no left and right image have {told}")
    return frames


def _in_ms(number: float) -> float:
    """Returns a time since 1970 in milliseconds, and other numbers as they are."""
    for unit_ms in (1e3, 1e-3, 1e-6):
        if _LEAST_DATE_MS <= number * unit_ms < _MOST_TIME_MS:
            return number * unit_ms
    return number


def _place_in_order(numbered: tuple[float, Path]) -> list[float]:
    """Returns what to sort frames by: the time since 1970, else all numbers of the name, of which the last may begin
    anew each second."""
    number, file = numbered
    if _LEAST_DATE_MS <= number < _MOST_TIME_MS:
        return [number]
    return [float(word) for word in _NUMBER.findall(file.stem)]


def _join_by_name(
    folder: Path, by_stream: dict[str, list[tuple[float | None, Path]]], streams: dict[str, re.Pattern[str]]
) -> list[FrameFiles]:
    """Joins files into frames whose names differ only in the stream's word, in natural order ('view 9' before 'view
    10')."""
    named: dict[str, dict[str, Path]] = {}
    for stream, files in by_stream.items():
        for _, file in files:
            # One frame's files share a part of their names: img_.png of img_left.png and img_depth_laser.png.
            name = streams[stream].sub("", file.relative_to(folder).as_posix())
            name = _BETWEEN_WORDS.sub("_", _STREAMS["depth"].sub("", name) if stream == "depth" else name)
            if stream in named.setdefault(name, {}):
                raise ValueError(f"{file}: is named as {named[name][stream]}, expected one image of a frame and stream")
            named[name][stream] = file
    for own in named.values():
        for side, other in (("left", "right"), ("right", "left")):
            if side in own and other not in own:
                raise ValueError(
                    f"{own[side]}: has no {other} image: names without a number of their own are the same in each "
                    "stream but for its word, such as left/desk.png and right/desk.png, or desk_left.png and "
                    "desk_right.png"
                )
    ordered = sorted(
        (name for name in named if "left" in named[name]),
        key=lambda name: [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)],
    )
    return [FrameFiles(float(index), named[name]) for index, name in enumerate(ordered)]


def import_realsense(
    files: list[FrameFiles], device: DeviceText, out: Path, projector: Projector, pattern: NDArray[np.uint8],
    depth_scale: float = DEPTH_SCALE_M, scene: Path | None = None,
    trajectory: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None, exposures_s: Sequence[float] = (0.008,),
    robot: RobotPoses | None = None, progress: Progress = silent,
) -> Capture:  # fmt: skip
    """Writes frames as the capture `out`, which must not exist, and returns it.

    files: from frame_files(). 16-bit images without pixels above 255 are stored with 8 bits. projector, pattern: the
    device's nominal ones. depth_scale: metres per unit of the depth images. scene: a glTF file, None for an empty one.
    trajectory: (times [n] in seconds, camera poses [n, 4, 4]). exposures_s: one for each frame, or one for all. robot:
    poses of a gripper that carries the camera. Without a trajectory, frames of one folder (and one gripper pose) whose
    pictures agree become a repeat group."""
    size = image_size(files[0].files["left"], "Infrared 1")
    left, right = (device.intrinsic(_NAMES[side], *size) for side in ("left", "right"))
    left_to_right = device.left_to_right()
    color, colored = None, next((entry.files["color"] for entry in files if "color" in entry.files), None)
    if colored is not None and any(stream == "Color" for stream, _, _ in device.intrinsics):
        lens = device.intrinsic("Color", *image_size(colored, "Color"))
        to_color = device.extrinsic("Infrared 1", "Color")
        color = ColorCamera(lens.width, lens.height, lens.K, lens.distortion, to_color)
    frames, views = [], []
    for number, entry in enumerate(files):
        time_s = 1e-3 * entry.number if entry.number > LEAST_TIME_MS else float(number) / 30.0
        exposure_s = exposures_s[number if len(exposures_s) > 1 else 0]
        pose, place, gripper_to_base = np.eye(4), 0, None
        if trajectory is not None:
            pose = pose_at(*trajectory, time_s, str(entry.files["left"]))
        elif robot is not None:
            gripper_to_base, place = robot.at(entry.files["left"])
            pose = gripper_to_base @ robot.camera_to_gripper
        frames.append(Frame(
            number, entry.files["left"], entry.files["right"], time_s, exposure_s, pose, "train",
            gain=entry.gain, projector_power=entry.projector_power, depth_path=entry.files.get("depth"),
            depth_scale=depth_scale, color_path=entry.files.get("color"), gripper_to_base=gripper_to_base,
        ))  # fmt: skip
        views.append((entry.view, place))
    rig = Rig(left, right, left_to_right, projector, color=color)
    notes = {"notes": "imported from librealsense"}
    capture = Capture(out, out.name, scene or out / "scene.gltf", rig, tuple(frames), notes)
    return write_frames(capture, pattern, views if trajectory is None else None, progress)
