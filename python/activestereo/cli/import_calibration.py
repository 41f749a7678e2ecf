# SPDX-License-Identifier: Apache-2.0
"""Finds the infrared cameras' calibration for an import. Checks that pairs are rectified and not exchanged."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import Camera, Frame
from activestereo.capture.images import image_size, read_gray
from activestereo.cli import arguments as cli
from activestereo.common.lens import is_distorting

if TYPE_CHECKING:
    from activestereo.capture.camera_order import CameraOrder
    from activestereo.capture.importers.realsense_folder import FrameFiles
    from activestereo.capture.importers.realsense_text import DeviceText

# Rows of rectified images match to about 0.2 px on real devices; beyond this limit a matcher loses pixels.
_MOST_ROWS_PX = 0.5


def folder_device(args: argparse.Namespace, size: tuple[int, int]) -> tuple[DeviceText, list[str]]:
    """Returns (calibration, lines on assumptions) for images of size (width, height). The calibration is
    --calibration's, else that of --k and --baseline; the preset of --sensor gives missing values."""
    from activestereo.capture.importers.realsense_text import DeviceText

    device = given_device(args, size)
    if device is not None:
        return device, []
    width, height = size
    config, assumed = StereoDepthSensorConfig(args.sensor), []
    K, baseline_m = args.k, args.baseline
    if baseline_m is None:
        baseline_m = config.baseline_m
        assumed.append(f"the baseline is {args.sensor}'s nominal {1e3 * baseline_m:.2f} mm: --baseline tells better")
    if K is None:
        own_width, own_height = config.ir_resolution
        factor = width / own_width
        if abs(height - factor * own_height) > 1.0:
            sizes = f"the images are {width}x{height}, {args.sensor}'s {own_width}x{own_height}: they are not scaled "
            raise cli.CommandError(f"{sizes}alike, so that its focal length tells nothing: give --k FX,FY,CX,CY")
        K = config.scaled(factor).ir_intrinsic
        figures = f"f {K[0, 0]:.1f} px and centre {K[0, 2]:.1f}, {K[1, 2]:.1f}: devices differ by 1 to 2 %"
        assumed.append(f"K is {args.sensor}'s nominal one, {figures}, --k or --calibration tells better")
    right_K = K if args.k_right is None else args.k_right
    for option, own in (("--k", K), ("--k-right", right_K)):
        if not (0 <= own[0, 2] < width and 0 <= own[1, 2] < height):
            raise cli.CommandError(
                f"{option} has its centre at {own[0, 2]:g}, {own[1, 2]:g}, outside of the images' {width}x{height}: "
                "were they rescaled? K is scaled along with them"
            )
    assumed.append("both cameras are rectified to this K")
    return DeviceText.of_pair(Path("--k"), [Camera(width, height, own) for own in (K, right_K)], baseline_m), assumed


def given_device(args: argparse.Namespace, size: tuple[int, int] | None) -> DeviceText | None:
    """Reads the calibration file of --calibration; --baseline is used if the file has no baseline. Returns None without
    the option. size: (width, height) of the images, or None."""
    from activestereo.capture.importers.calibration import read_calibration_files

    if not args.calibration:
        if args.rectified:
            raise cli.CommandError("--rectified is about ROS' and OpenCV's YAML: give it with --calibration FILE.yaml")
        return None
    if args.k is not None or args.k_right is not None:
        raise cli.CommandError("--calibration tells K of both cameras: give it, or --k")
    return read_calibration_files(args.calibration, args.rectified, args.baseline, size)


def own_device(args: argparse.Namespace, recording: Path, size: tuple[int, int] | None) -> DeviceText | None:
    """Returns given_device() for a recording that includes a calibration. Raises CommandError if --k or --k-right is
    given."""
    if args.k is not None or args.k_right is not None:
        raise cli.CommandError(f"{recording}: has K of its own: leave out --k, or give --calibration FILE")
    return given_device(args, size)


@dataclass(frozen=True)
class RectifiedPair:
    """Holds two rectified cameras, which differ only by the baseline and by cx. left_K, right_K: 3x3, pixels."""

    left_K: NDArray[np.float64]
    right_K: NDArray[np.float64]
    baseline_m: float

    @property
    def offset_px(self) -> float:
        """Right cx minus left cx, pixels. Depth is z = f x baseline / (disparity + offset)."""
        return float(self.right_K[0, 2] - self.left_K[0, 2])

    @property
    def focal_baseline_px_m(self) -> float:
        return float(self.left_K[0, 0]) * self.baseline_m


def rectified_pair(device: DeviceText, width: int, height: int) -> RectifiedPair:
    """Returns the two cameras of a calibration, for images of width x height. Raises CommandError if they are not
    rectified."""
    left, right = (device.intrinsic(name, width, height) for name in ("Infrared 1", "Infrared 2"))
    if np.abs(left.K - right.K)[[0, 1, 1], [0, 1, 2]].max() > _MOST_ROWS_PX:
        focal = f"{left.K[0, 0]:g} and {right.K[0, 0]:g} px, cy {left.K[1, 2]:g} and {right.K[1, 2]:g} px"
        told = f"the two images do not match: focal lengths of {focal}; record rectified ones"
        raise cli.CommandError(f"{device.path}: {told}")
    if not is_rectified(device, width, height):
        raise cli.CommandError(
            f"{device.path}: the pairs are not rectified, its cameras have a lens or are turned: record the rectified "
            "streams, or give --rectified where ROS' or OpenCV's YAML describes images that are"
        )
    return RectifiedPair(left.K, right.K, -float(device.left_to_right()[0, 3]))


def checked_sides(files: Sequence[FrameFiles], are_exchanged: bool, offset_px: float) -> CameraOrder:
    """Measures on up to three pairs whether left and right images are swapped, and returns the measured order. Raises
    CommandError if they are swapped. are_exchanged: whether --swap was given. offset_px: right cx minus left cx."""
    from activestereo.capture.camera_order import camera_order

    some = [files[i].files for i in sorted({0, len(files) // 2, len(files) - 1})]
    pairs = [(read_gray(own["left"], key="Infrared 1"), read_gray(own["right"], key="Infrared 2")) for own in some]
    order = camera_order([(left, right) for left, right in pairs if left.shape == right.shape], offset_px)
    if order.is_swapped:
        raise cli.CommandError(
            f"left and right are swapped: {100 * order.nearer_right:.0f} % of {order.patches} patches lie further "
            f"right in the right image, where nothing can: {'leave out' if are_exchanged else 'give'} --swap"
        )
    return order


def is_rectified(device: DeviceText, width: int, height: int) -> bool:
    """Returns whether images of this calibration are rectified: no lens distortion, matching rows, and no difference
    but baseline and cx."""
    left, right = (device.intrinsic(name, width, height) for name in ("Infrared 1", "Infrared 2"))
    left_to_right = device.extrinsic("Infrared 1", "Infrared 2")
    turned = np.abs(left_to_right[:3, :3] - np.eye(3)).max() * left.K[0, 0]
    across = np.abs(left_to_right[1:3, 3]).max() / max(1e-9, abs(left_to_right[0, 3]))
    differing = np.abs(left.K - right.K)
    differing[0, 2] = 0.0  # cx may differ: it shifts all disparities alike
    has_lens = is_distorting(left.distortion) or is_distorting(right.distortion)
    return bool(max(turned, differing.max()) < _MOST_ROWS_PX and across < 0.01 and not has_lens)


def sides_text(order: CameraOrder) -> str:
    if not order.is_told:
        return f"cameras: only {order.patches} patches are alike in both images, which tells neither order nor rows"
    row = f"rows {order.row_offset_px:+.2f} px apart (spread {order.row_spread_px:.2f}) in {order.patches} patches"
    is_wrong = abs(order.row_offset_px) > _MOST_ROWS_PX or order.row_spread_px > 1.0
    return f"cameras: {row}" + ": they do not match, so the pair is not rectified by this calibration" * is_wrong


def missing_text(files: Sequence[FrameFiles], frames: Sequence[Frame], has_poses: bool) -> list[str]:
    """Returns lines that name what a recording lacks, depth or poses, and what needs these."""
    out = []
    if not any("depth" in entry.files for entry in files):
        out.append("no depth, which poses, pattern and albedo need: record it, too, or name it by --depth WORD")
    if not has_poses:
        views = len({f.repeat_group for f in frames if f.repeat_group is not None})
        views += sum(f.repeat_group is None for f in frames)
        how = "state them by --poses or --robot, or let calibrate world measure them (two or more views with depth)"
        out.append(f"no poses, which compare and diagnose need: {how}; here are {len(frames)} frames of {views} views")
    return out


def unused_images(folder: Path, files: Sequence[FrameFiles]) -> list[Path]:
    """Lists the folder's PNG files that belong to no frame."""
    used = {file for entry in files for file in entry.files.values()}
    return sorted(set(folder.rglob("*.png")) - used)


def depth_words(folder: Path, files: Sequence[FrameFiles]) -> list[str]:
    """Returns the words for --depth that give every frame a 16-bit image of its size, in order of the files' names.
    For example, img_depth_laser.png gives "laser"."""
    from activestereo.capture.importers.realsense_folder import frame_files

    found = []
    names = (file.relative_to(folder).with_suffix("").as_posix() for file in unused_images(folder, files))
    for word in dict.fromkeys(word for name in names for word in re.findall(r"[A-Za-z]{2,}", name)):
        with suppress(ValueError):
            own = [entry.files.get("depth") for entry in frame_files(folder, word)]
            if own[0] and None not in own and read_gray(own[0], image_size(files[0].files["left"])).dtype == np.uint16:
                found.append(word)
    return found
