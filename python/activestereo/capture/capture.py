# SPDX-License-Identifier: Apache-2.0
"""Reads a capture: an active stereo sensor's measurements and the known facts of the scene (capture format, version 1).
Units are metres, seconds and radians. Camera axes: x right, y down, z forward; pixel centres are at integers. A
transform `a_to_b` is a 4x4 array that maps coordinates in a to coordinates in b. Images are digital numbers (DN), read
from disk on each call."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.capture.capture_json import CaptureError, JsonObject
from activestereo.capture.images import block_means, image_size, read_color, read_gray
from activestereo.common import limits
from activestereo.common.computed_once import computed_once
from activestereo.common.grouped import grouped
from activestereo.common.input_files import read_json_object
from activestereo.common.lens import is_distorting
from activestereo.common.output_files import flat
from activestereo.common.parameter import MATCHER
from activestereo.common.shown import counted, shown

FORMAT = "active-stereo-capture"
VERSION = 1
_WHAT_IT_IS = "; a capture is a folder with a capture.json"
SIDES = ("left", "right")
# The matcher's parameters that a capture's depth_engine may state.
DEPTH_ENGINE = (
    "max_disparity", "census_width", "census_height", "block_width", "block_height", "p1", "p2", "uniqueness_ratio",
    "lr_max_diff", "median_size", "path_count", "min_disparity", "min_depth_m", "max_depth_m",
    "min_detection_sigma", "noise_dn2", "noise_dn2_per_dn",
)  # fmt: skip
ImageKey = tuple[int, str]  # a frame's id and the camera, one of SIDES
SPLITS = ("train", "test")
# Repeats' exposures differ by at most this factor: a camera's metadata jitters by microseconds. Between two frames it
# adds 2e-6 of the squared signal to the variance, a fiftieth of the photon noise of 10 000 electrons.
SAME_EXPOSURE = 1.002


class CaptureWarning(UserWarning):
    """Issued if the reader ignores a part of a capture."""


@dataclass(frozen=True)
class Camera:
    """A camera's nominal intrinsics. K: 3x3, pixels. distortion: five, eight or four coefficients, see
    activestereo/common/lens.py."""

    width: int
    height: int
    K: np.ndarray
    distortion: np.ndarray = field(default_factory=lambda: np.zeros(5))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its images, pixels."""
        return self.width, self.height

    @property
    def is_pinhole(self) -> bool:
        return not is_distorting(self.distortion)

    def as_json(self) -> dict[str, Any]:
        """Returns the object that read_camera() reads."""
        K, distortion = flat(self.K), flat(self.distortion)
        return {"width": self.width, "height": self.height, "K": K, "distortion": distortion}


@dataclass(frozen=True)
class Projector:
    """A projector, modelled as a point source that casts an image. K: 3x3, from directions to the image's pixels.
    measured: the image, as pattern() returns it, in place of the file's."""

    pattern_path: Path
    K: np.ndarray
    left_to_projector: np.ndarray
    measured: np.ndarray | None = None

    @computed_once
    def pattern(self) -> np.ndarray:
        """Returns the image's relative radiant intensity, float32 [height, width], 0..1."""
        if self.measured is not None:
            return self.measured
        image = read_gray(self.pattern_path, key="rig.projector.pattern")
        if image.dtype != np.uint8:
            raise CaptureError(f"{self.pattern_path}: rig.projector.pattern: is a 16-bit image, expected 8-bit gray")
        return image.astype(np.float32) / 255.0


@dataclass(frozen=True)
class ColorCamera(Camera):
    """The colour camera in the same housing. left_to_color: 4x4 from the left camera's axes."""

    left_to_color: np.ndarray = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True)
class KnownLight:
    """A room lamp of known position and unknown brightness. position_m: in the world's axes."""

    name: str
    position_m: np.ndarray
    radius_m: float = 0.0


@dataclass(frozen=True)
class Rig:
    """The nominal calibration, as the user states it. black_dn: (measured black level, its standard deviation), DN;
    None if it is not measured, and fits estimate it."""

    left: Camera
    right: Camera
    left_to_right: np.ndarray
    projector: Projector
    bit_depth: int = 8
    line_time_s: float | None = None
    color: ColorCamera | None = None
    black_dn: tuple[float, float] | None = None

    def camera(self, side: str) -> Camera:
        return {"left": self.left, "right": self.right}[side]

    @property
    def baseline_m(self) -> float:
        return float(np.linalg.norm(self.left_to_right[:3, 3]))

    @property
    def max_dn(self) -> int:
        """The largest digital number that the sensor can give."""
        return 2**self.bit_depth - 1


@dataclass(frozen=True)
class Frame:
    """One exposure of the rig. camera_to_world: the left camera's pose at mid-exposure. left_path, right_path: None in
    recordings of colour and depth alone. repeat_group: a number that frames of the same view share, or None.
    left_mask_path, right_mask_path: images with 0 where the scene is unknown; None: all is known."""

    id: int
    left_path: Path | None
    right_path: Path | None
    timestamp_s: float
    exposure_s: float
    camera_to_world: np.ndarray
    split: str
    gain: float = 1.0
    projector_power: float = 1.0
    ambient: float | None = None
    temperature_c: float | None = None
    camera_velocity: np.ndarray = field(default_factory=lambda: np.zeros(6))
    repeat_group: int | None = None
    depth_path: Path | None = None
    depth_scale: float | None = None
    color_path: Path | None = None
    gripper_to_base: np.ndarray | None = None
    left_mask_path: Path | None = None
    right_mask_path: Path | None = None

    def path(self, side: str) -> Path:
        """Returns the path of the 'left' or 'right' image. Raises CaptureError if the recording has none."""
        path = {"left": self.left_path, "right": self.right_path}[side]
        if path is None:
            raise CaptureError(f"frames[id={self.id}].{side}: there are no infrared images, only colour and depth")
        return path

    @property
    def has_infrared(self) -> bool:
        return self.left_path is not None and self.right_path is not None

    @property
    def exposure_gain(self) -> float:
        """Exposure in seconds times gain, by which all light in this frame is scaled."""
        return self.exposure_s * self.gain

    @property
    def is_moving(self) -> bool:
        return bool(np.any(self.camera_velocity))


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of a capture's stated values: poses of views, the projector's pose, focal lengths (relative)
    and albedos (relative). The defaults suit a good hand-eye and rig calibration, and albedos compared with a reference
    card. exposure: of each frame's exposure (relative), which a comparison then fits; None: exposures are exact."""

    pose_m: float = 1e-3
    pose_rad: float = 1.5e-3
    projector_m: float = 3e-4
    projector_rad: float = 1e-3
    focal: float = 6e-4
    albedo: float = 0.03
    exposure: float | None = None


@dataclass(frozen=True)
class Capture:
    """A recording in the capture format: rig, frames in the file's order, and scene. measured: results of `calibrate
    world` on camera, poses, pattern and light, with covariances (calibrate/README.md). binning: side in pixels of the
    blocks that images are averaged over, see binned(). whole: the capture before binning; None if it is not binned."""

    path: Path
    name: str
    scene_path: Path
    rig: Rig
    frames: tuple[Frame, ...]
    depth_engine: dict[str, Any] = field(default_factory=dict)
    lights: tuple[KnownLight, ...] = ()
    measured: dict[str, Any] = field(default_factory=dict)
    uncertainty: Uncertainty = Uncertainty()
    binning: int = 1
    whole: Capture | None = None

    def split(self, name: str) -> list[Frame]:
        return [frame for frame in self.frames if frame.split == name]

    def check_train(self) -> None:
        """Raises CaptureError unless a model can be fitted to a frame. Called before long renders."""
        if not self.split("train"):
            text = "is 'test' in all frames: say 'train' in those that a model is fitted to"
            raise CaptureError(f"{self.path / 'capture.json'}: frames: split: {text}")

    def check_scene(self) -> None:
        """Raises CaptureError if the scene is empty, as `import` without --scene writes it."""
        if self.scene_path.suffix.lower() == ".gltf" and not read_json_object(self.scene_path).get("meshes"):
            made = "'activestereo calibrate world' or 'calibrate scene' make one of measured depth"
            raise CaptureError(f"{self.scene_path}: the scene is empty: import --scene FILE takes yours; {made}")

    def ir(self, frame: Frame, side: str) -> np.ndarray:
        """Reads a frame's 'left' or 'right' infrared image, float32 [height, width], DN; averaged if the capture is
        binned."""
        if self.whole is not None:
            return block_means(self.whole.ir(frame, side), self.binning)
        image = read_gray(frame.path(side), self.rig.camera(side).size, f"frames[id={frame.id}].{side}")
        return image.astype(np.float32)

    def known(self, frame: Frame, side: str) -> np.ndarray | None:
        """Reads the mask of an infrared image's pixels where the scene is known, bool [height, width]; None: all are
        known."""
        path = {"left": frame.left_mask_path, "right": frame.right_mask_path}[side]
        if path is None:
            return None
        size = (self.whole or self).rig.camera(side).size
        known = read_gray(path, size, f"frames[id={frame.id}].{side}_mask") > 0
        return known if self.whole is None else block_means(known, self.binning) == 1.0

    def depth(self, frame: Frame) -> np.ndarray | None:
        """Reads the device's own depth in metres, float32 [height, width], 0 = no measurement; None if the frame has
        none."""
        if frame.depth_path is None:
            return None
        image = read_gray(frame.depth_path, self.rig.left.size, f"frames[id={frame.id}].depth")
        return image.astype(np.float32) * np.float32(frame.depth_scale)

    def color(self, frame: Frame) -> np.ndarray | None:
        """Reads the colour image as stored, sRGB uint8 [height, width, 3]; None if the frame has none."""
        if frame.color_path is None or self.rig.color is None:
            return None
        return read_color(frame.color_path, self.rig.color.size, f"frames[id={frame.id}].color")

    def repeats(self, split: str | None = None) -> list[list[Frame]]:
        """Returns the frames of each of repeat_keys() that two frames or more of the split have; None: of any split."""
        keys = repeat_keys(self.frames)
        groups = grouped((keys[f.id], f) for f in self.frames if f.id in keys and split in (None, f.split))
        return [frames for frames in groups if len(frames) > 1]


def repeat_keys(frames: Iterable[Frame]) -> dict[int, tuple[int, float, float]]:
    """Returns {frame id: what its repeats have in common}: the group, the projector's power and, within SAME_EXPOSURE,
    exposure times gain. Frames without a group are left out."""
    keys: dict[int, tuple[int, float, float]] = {}
    key = None
    grouped = [(f.repeat_group, f.projector_power, f.exposure_gain, f.id) for f in frames if f.repeat_group is not None]
    for group, power, exposure, number in sorted(grouped):
        if key is None or key[:2] != (group, power) or exposure > SAME_EXPOSURE * key[2]:
            key = group, power, exposure
        keys[number] = key
    return keys


def read_capture(path: str | Path) -> Capture:
    """Reads and checks the capture.json of a folder. Raises CaptureError with the file and the key; unknown keys give a
    CaptureWarning."""
    folder = Path(path)
    if folder.name == "capture.json":
        folder = folder.parent
    elif folder.is_file():
        raise CaptureError(f"{folder}: is a file{_WHAT_IT_IS}")
    root = JsonObject.read(folder / "capture.json", _WHAT_IT_IS)
    capture = capture_from(root)
    unknown: dict[str, list[str]] = {}  # a key that all frames have is told once
    for key in root.unknown_keys():
        unknown.setdefault(re.sub(r"\[[^]]*\]", "", key), []).append(key)
    for first, *others in unknown.values():
        more = f", and {counted(len(others), 'other')} like it" if others else ""
        warnings.warn(f"{root.path}: unknown key {first} is ignored{more}", CaptureWarning, stacklevel=2)
    return capture


def capture_from(root: JsonObject) -> Capture:
    """Makes the Capture from the content of a capture.json. Raises CaptureError as read_capture() does."""
    root.check_format(FORMAT, _WHAT_IT_IS)
    if root.integer("version") != VERSION:
        root.fail("version", f"is {root.integer('version')}; this program reads version {VERSION}")
    rig = _read_rig(root.object("rig"))
    frames = tuple(_read_frame(entry, rig) for entry in root.objects("frames"))
    if not frames:
        root.fail("frames", "is empty")
    repeated = [number for number, count in Counter(frame.id for frame in frames).items() if count > 1]
    if repeated:
        root.fail("frames", f"id {min(repeated)} is used more than once")
    lights = tuple(
        KnownLight(
            entry.text("name"), entry.numbers("position_m", [limits.LENGTH] * 3),
            entry.number("radius_m", limits.RADIUS, optional=True) or 0.0,
        )
        for entry in (root.objects("lights") if root.has("lights") else ())
    )  # fmt: skip
    stated = root.object("uncertainty", optional=True)
    names = [own.name for own in fields(Uncertainty)] if stated else []
    deviations = {name: stated.number(name, limits.UNCERTAINTY, optional=True) for name in names}
    return Capture(
        root.path.parent, root.text("name"), root.file("scene"), rig, frames, read_hints(root), lights,
        root.free_form("measured"),
        Uncertainty(**{name: value for name, value in deviations.items() if value is not None}),
    )  # fmt: skip


def read_hints(root: JsonObject) -> dict[str, Any]:
    """Reads depth_engine, {} if it is missing. A hint of DEPTH_ENGINE must be a number as the matcher takes; other
    keys are free. Numbers that it refuses are ignored later, with a warning."""
    hints = root.free_form("depth_engine")
    for p in MATCHER:
        value = hints.get(p.name) if p.name in DEPTH_ENGINE else None
        is_number = isinstance(value, int if p.kind is int else (int, float)) and not isinstance(value, bool)
        if value is not None and not is_number:
            root.fail(f"depth_engine.{p.name}", f"is {shown(value)}, expected {p.possible or 'a number'}")
    return hints


def read_camera(entry: JsonObject, side: limits.Limits = limits.SIDE, needs_lens: bool = True) -> Camera:
    """Reads a camera's width, height, K and distortion. side: limits of width and height. needs_lens: distortion must
    be there; else, if it is missing, it is zero."""
    width, height = entry.integer("width", side), entry.integer("height", side)
    lens = entry.lens("distortion") if needs_lens or entry.has("distortion") else np.zeros(5)
    key = "cam_K" if entry.has("cam_K") and not entry.has("K") else "K"  # as BOP's files have it
    return Camera(width, height, entry.camera_matrix(key), lens)


def _read_rig(entry: JsonObject) -> Rig:
    projector, color = entry.object("projector"), entry.object("color", optional=True)
    black_dn = entry.numbers("black_dn", [limits.BLACK, limits.BLACK_DEVIATION], optional=True)
    readout = entry.object("readout", optional=True)
    return Rig(
        left=read_camera(entry.object("left")),
        right=read_camera(entry.object("right")),
        left_to_right=entry.rigid_transform("left_to_right"),
        projector=Projector(
            projector.file("pattern"), projector.camera_matrix("K"), projector.rigid_transform("left_to_projector")
        ),
        bit_depth=entry.integer("bit_depth", limits.BITS),
        line_time_s=readout.number("line_time_s", limits.LINE_TIME, optional=True) if readout else None,
        color=ColorCamera(**vars(read_camera(color)), left_to_color=color.rigid_transform("left_to_color"))
        if color
        else None,
        black_dn=None if black_dn is None else (float(black_dn[0]), float(black_dn[1])),
    )


def _read_frame(entry: JsonObject, rig: Rig) -> Frame:
    frame_id = entry.integer("id")
    entry.name = f"frames[id={frame_id}]"
    depth_path = entry.file("depth", optional=True)
    if depth_path is not None:
        _check_size(entry, "depth", rig.left)
    has_infrared = depth_path is None or any(entry.has(side) for side in SIDES)
    for side in SIDES if has_infrared else ():
        _check_size(entry, side, rig.camera(side))
    color_path = entry.file("color", optional=True)
    if color_path is not None:
        if rig.color is None:
            entry.fail("color", "rig.color is missing: say which camera took it")
        _check_size(entry, "color", rig.color)
    split = entry.text("split")
    if split not in SPLITS:
        entry.fail("split", f"is {split!r}, expected 'train' or 'test'")
    masks = {side: entry.file(f"{side}_mask", optional=True) for side in SIDES}
    for side in SIDES:
        if masks[side] is not None:
            _check_size(entry, f"{side}_mask", rig.camera(side))
    velocity = entry.numbers("camera_velocity", [limits.SPEED] * 3 + [limits.TURN_RATE] * 3, optional=True)
    return Frame(
        id=frame_id,
        left_path=entry.file("left") if has_infrared else None,
        right_path=entry.file("right") if has_infrared else None,
        timestamp_s=entry.number("timestamp_s", limits.TIME),
        exposure_s=entry.number("exposure_s", limits.EXPOSURE),
        gain=entry.number("gain", limits.GAIN),
        projector_power=entry.number("projector_power", limits.POWER),
        ambient=entry.number("ambient", limits.POWER, optional=True),
        temperature_c=entry.number("temperature_c", limits.TEMPERATURE, optional=True),
        camera_to_world=entry.rigid_transform("camera_to_world"),
        camera_velocity=np.zeros(6) if velocity is None else velocity,
        repeat_group=entry.integer("repeat_group", optional=True),
        split=split,
        depth_path=depth_path,
        # A scale may stand without a depth image, but not the other way round.
        depth_scale=entry.number("depth_scale", limits.DEPTH_SCALE, optional=depth_path is None),
        color_path=color_path,
        gripper_to_base=entry.rigid_transform("gripper_to_base") if entry.has("gripper_to_base") else None,
        left_mask_path=masks["left"],
        right_mask_path=masks["right"],
    )


def _check_size(entry: JsonObject, key: str, camera: Camera) -> None:
    path = entry.file(key)
    width, height = image_size(path, entry.key(key))
    if (width, height) != camera.size:
        entry.fail(key, f"{path.name} is {width}x{height}, the rig says {camera.width}x{camera.height}")


# Images up to the first size stay whole, larger ones are binned to it. Images up to the second one get full samples.
_WHOLE_PIXELS, _SAMPLED_PIXELS = 480 * 270, 848 * 480


def usual_samples(capture: Capture) -> int:
    """Returns the default samples per pixel: 64 for images of up to _SAMPLED_PIXELS. Larger ones get fewer, for the
    same sum."""
    return max(4, round(64 * min(1.0, _SAMPLED_PIXELS / _pixels(capture.rig))))


def usual_binning(capture: Capture) -> int:
    """Returns the default side, in pixels, of the square blocks over which a capture's images are averaged."""
    return int(np.ceil(np.sqrt(_pixels(capture.rig) / _WHOLE_PIXELS)))


def _pixels(rig: Rig) -> int:
    return max(camera.width * camera.height for camera in (rig.left, rig.right))


def binned(capture: Capture, size: int) -> Capture:
    """Returns the capture with infrared images averaged over size x size pixels, and K and line time to match. It has
    no device depth, which was matched on whole images. Raises CaptureError if too few pixels remain."""
    if size == 1:
        return capture
    least = min(*capture.rig.left.size, *capture.rig.right.size)
    most = least // 16
    if size > most:
        raise CaptureError(f"{capture.path}: images of {least} pixels cannot be averaged over {size}: give 1 to {most}")
    rig, cameras = capture.rig, {}
    for side in SIDES:
        camera = rig.camera(side)
        K = camera.K.copy()
        K[:2] /= size
        K[:2, 2] += 0.5 / size - 0.5  # pixel centres are whole numbers
        cameras[side] = replace(camera, width=camera.width // size, height=camera.height // size, K=K)
    rig = replace(rig, **cameras, line_time_s=None if rig.line_time_s is None else size * rig.line_time_s)
    frames = tuple(replace(frame, depth_path=None, depth_scale=None) for frame in capture.frames)
    return replace(capture, rig=rig, frames=frames, binning=size, whole=capture)


def unbinned(capture: Capture) -> Capture:
    """Returns the whole capture from which binned() made this one. It takes over this one's poses, focal lengths and
    projector, which may have been fitted. A capture that is not binned is returned unchanged."""
    if capture.whole is None:
        return capture
    whole, rig = capture.whole, capture.rig
    stated = binned(whole, capture.binning).rig
    cameras = {}
    for side in SIDES:
        K = whole.rig.camera(side).K.copy()
        K[:2, :2] *= rig.camera(side).K[0, 0] / stated.camera(side).K[0, 0]
        cameras[side] = replace(whole.rig.camera(side), K=K)
    rig = replace(whole.rig, **cameras, left_to_right=rig.left_to_right, projector=rig.projector)
    pose_of = {frame.id: frame.camera_to_world for frame in capture.frames}
    frames = tuple(replace(frame, camera_to_world=pose_of[frame.id]) for frame in whole.frames)
    return replace(whole, rig=rig, frames=frames)
