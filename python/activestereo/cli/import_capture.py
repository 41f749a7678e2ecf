# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo import`: converts a recording of another program into a capture."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import Capture, Projector
from activestereo.capture.images import image_size
from activestereo.cli import arguments as cli
from activestereo.cli import import_calibration as calibration
from activestereo.common.pose import rigid_motion
from activestereo.common.progress_bar import ProgressBar
from activestereo.report.screen import Step, command, screen

if TYPE_CHECKING:
    from activestereo.capture.importers.color_depth import ColorDepthRecording
    from activestereo.capture.importers.realsense_folder import RobotPoses

_MOST_WORDS = 2
# Options that recordings without infrared images do not take.
_OF_INFRARED = (
    "calibration", "rectified", "k_right", "baseline", "swap", "depth", "poses", "robot", "hand_eye", "exposure",
)  # fmt: skip
_WARM_UP_S = 300.0  # repeats that span longer, some with the projector off, count as a warm-up

_TEXT = """\
Makes a capture of a recording. RECORDING is one of

  a folder of PNG files of both infrared streams, of depth (16-bit) and colour where
    they were saved; names tell the stream (Infrared 1, Infrared 2, Depth, Color, or
    left, right, depth) and the time or number; names without one are the same in
    each stream but for that word. Folders inside with both cameras of their own are
    views of their own (walls/near, walls/far); one named off has frames with the
    projector off (desk/on, desk/off). --calibration is what rs-enumerate-devices -c
    prints, saved to a file, Middlebury's calib.txt, or YAML of Kalibr, ROS or OpenCV
    (needs: apt-get install python3-yaml); --k and --baseline do for other cameras'
    rectified images, and without either the preset's nominal figures
  a bag: librealsense's .bag or .db3, or one of ROS 1 or ROS 2 with the topics of
    realsense-ros (needs: pip install rosbags). It has its own calibration
  colour and depth alone: a TUM folder (rgb.txt, depth.txt), Open3D's
    (camera_intrinsic.json, color/, depth/), a bag, or one scene of a BOP dataset
    (scene_camera.json), whose models become the scene. Without infrared images such
    a capture places objects and holds depth; it tells nothing of noise or dots

The pattern is the sensor preset's nominal one: calibrate pattern measures the
device's own. Without --poses, frames of one folder whose pictures lie on each other are
repeats of one view, as calibrate noise and calibrate pattern want them. With --robot,
their gripper poses are equal, too.

example:
  rs-enumerate-devices -c > d435.txt
  activestereo import recording/ --calibration d435.txt --depth-scale 0.001 --out captures/desk
  activestereo import 20260101_120000.bag --out captures/desk
  activestereo import views/ --sensor d415 --k 903.5,903.5,631.9,369.3 \\
      --baseline 0.05475 --depth depth_laser --depth-scale 0.001 -o captures/views
  activestereo import views/ --calibration left.yaml --calibration right.yaml \\
      --rectified -o captures/views
  activestereo import views/ --calibration d435.txt --robot poses.csv \\
      --hand-eye model.hand_eye.json --out captures/views
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "import", "make a capture of a camera's or a data set's recording", _TEXT, run)
    add = parser.add_argument
    add("recording", type=Path, metavar="RECORDING", help="folder of PNG files, or a bag")
    cli.add_shared(parser, calibration="; not needed for a bag", rectified=True)
    cli.add_shared(parser, k=" of both rectified cameras, or of colour and depth, where no file tells it", k_right=True)
    cli.add_shared(parser, baseline=", where no file tells it (camera_info's P[3] is 0) or none in metres")
    add("--swap", action="store_true", help="the files named left are the right camera's")
    text = "what the depth images' names hold, where there are several kinds (default: depth)"
    add("--depth", metavar="WORD", help=text)
    add("-o", "--out", required=True, type=Path, metavar="DIR", help="the capture's folder, which must not exist")
    add("--depth-scale", type=cli.depth_scale, metavar="M", help="metres per unit of the depth images (default: 0.001)")
    text = "camera_to_world over time: timestamp tx ty tz qx qy qz qw in each line"
    add("--poses", type=Path, metavar="FILE", help=text)
    add("--robot", type=Path, metavar="FILE", help="CSV of gripper_to_base: name,x,y,z,qx,qy,qz,qw; needs --hand-eye")
    text = "the camera's place on the gripper: calibrate rig's .hand_eye.json"
    add("--hand-eye", type=Path, metavar="FILE", help=text)
    add("--scene", type=Path, metavar="FILE", help="glTF scene of what is in view (default: nothing)")
    text = "exposure, seconds, of all frames or T1,T2,... of each (default: a bag's metadata, else 0.008)"
    add(
        "--exposure", default=[], metavar="S", help=text,
        type=lambda given: [cli.exposure(each) for each in given.split(",")],
    )  # fmt: skip
    cli.add_shared(parser, sensor="whose nominal pattern it is, of 'activestereo presets'")
    cli.add_shared(parser, verbose="all that was assumed and left out")


def run(args: argparse.Namespace) -> None:
    sentence, notes, steps = convert(args)
    print(screen(f"{args.out}: {sentence}", (), notes, steps, verbose=args.verbose))


def convert(args: argparse.Namespace) -> tuple[str, list[str], list[Step]]:
    """Writes the capture. Returns a sentence on its frames, notes on what was found, assumed and left out, and the next
    commands. Raises CommandError, or ValueError with the recording and its fault."""
    if args.out.exists():
        raise cli.CommandError(f"{args.out} exists already: an import writes a new folder")
    if not args.out.absolute().parent.is_dir():
        raise cli.CommandError(f"the folder {args.out.parent} does not exist: make it first")
    if (args.recording / "capture.json").is_file():
        raise cli.CommandError(
            f"{args.recording} is a capture already: give it to compare, diagnose, calibrate or view"
        )
    with TemporaryDirectory(prefix=".import.", dir=args.out.absolute().parent) as temporary:
        recording = _color_depth(args, Path(temporary))
        if recording is None:
            capture, told, words = _infrared(args, Path(temporary))
        else:
            from activestereo.capture.importers.color_depth import write_color_depth

            cli.refuse(args, _OF_INFRARED, "for infrared pairs, not for colour and depth alone")
            config, words = StereoDepthSensorConfig(args.sensor), []
            nominal = config.baseline_m, *_nominal_projector(config)
            with ProgressBar(f"importing {args.recording.name}") as bar:
                capture = write_color_depth(recording, args.out, *nominal, args.scene, bar)
            told = [f"assumed: {line}" for line in recording.assumed]
            told.append("colour and depth alone: it tells nothing of noise and dots; the baseline is nominal")
    has_scene = args.scene is not None or (recording is not None and recording.scene is not None)
    rig, frames = capture.rig, capture.frames
    with_depth = sum(frame.depth_path is not None for frame in frames)
    with_color = sum(frame.color_path is not None for frame in frames) if rig.color is not None else 0
    sentence = (
        f"{len(frames)} frames of {rig.left.width}x{rig.left.height}, {with_depth} with depth, "
        f"{with_color} with colour; baseline {1e3 * rig.baseline_m:.2f} mm, f {rig.left.K[0, 0]:.2f} px."
    )
    empty = "" if has_scene else "; the scene is empty: compare and diagnose need one"
    notes = [*told, f"the pattern and the projector's place are nominal{empty}"]
    with_words = [command(*args.given, "--depth", word, "-o", f"{args.out}_{word}") for word in words[:_MOST_WORDS]]
    steps = [*with_words, command("view", args.out)]
    is_posed = bool(args.poses or args.robot) or len({frame.repeat_group for frame in frames}) == 1
    if has_scene and is_posed and any(frame.has_infrared for frame in frames):
        steps.insert(0, command("compare", args.out, "-o", f"{args.out}_compare"))
    elif any(frame.has_infrared and frame.depth_path is not None for frame in frames):
        steps.insert(0, command("calibrate", "world", args.out, "-o", f"{args.out}_world"))
    elif with_depth:
        steps.insert(0, command("calibrate", "scene", args.out, "-o", f"{args.out}_scene.gltf"))
    elif any(frame.repeat_group is not None for frame in frames):
        times = [frame.timestamp_s for frame in frames]
        if max(times) - min(times) > _WARM_UP_S and any(frame.projector_power == 0 for frame in frames):
            known = [] if frames[0].temperature_c is not None else ["--temperatures", "asic.csv"]
            steps.insert(0, command("calibrate", "drift", args.out, *known, "-o", f"{args.out}_model.json"))
        else:
            steps.insert(0, command("calibrate", "noise", args.out, "-o", f"{args.out}_model.json"))
    return sentence, notes, steps


def _color_depth(args: argparse.Namespace, temporary: Path) -> ColorDepthRecording | None:
    """Reads the recording if it has colour and depth without infrared: a bag, or a BOP, TUM or Open3D folder. Returns
    None for other recordings. temporary: folder for extracted files."""
    from activestereo.capture.importers.bag import has_color_depth_alone, is_bag, read_color_depth_bag
    from activestereo.capture.importers.color_depth import INTRINSICS, read_bop, read_open3d, read_tum

    if is_bag(args.recording) and has_color_depth_alone(args.recording):
        with ProgressBar(f"reading {args.recording.name}") as bar:
            return read_color_depth_bag(args.recording, temporary, args.k, args.depth_scale, bar)
    if (args.recording / "scene_camera.json").is_file():
        cli.refuse(args, ("k",), "for recordings without a K of their own, not for BOP's")
        return read_bop(args.recording, temporary / "scene.gltf", args.depth_scale)
    if (args.recording / "rgb.txt").is_file() and (args.recording / "depth.txt").is_file():
        return read_tum(args.recording, args.k, args.depth_scale)
    if (args.recording / "depth").is_dir() and any((args.recording / name).is_file() for name in INTRINSICS):
        return read_open3d(args.recording, args.k, args.depth_scale)
    return None


def _infrared(args: argparse.Namespace, temporary: Path) -> tuple[Capture, list[str], list[str]]:
    """Imports a recording with infrared pairs. Returns (capture, lines on found, assumed and missing data, words).
    `words` holds the values of --depth that select one of several kinds of depth images; it is empty for a single
    kind."""
    from activestereo.capture.importers.bag import extract_bag, image_streams, is_bag
    from activestereo.capture.importers.frames import read_trajectory
    from activestereo.capture.importers.realsense_folder import (
        DEPTH_SCALE_M,
        LEAST_TIME_MS,
        frame_files,
        import_realsense,
        swapped,
    )

    bag = is_bag(args.recording)
    if not bag and not args.recording.is_dir():
        raise cli.CommandError(
            f"{args.recording}: is neither a folder nor a bag; record a connected camera with rs-record"
        )
    robot = _robot(args)
    trajectory = None if args.poses is None else read_trajectory(args.poses)
    folder, depth_scale = args.recording, args.depth_scale
    if bag:
        with ProgressBar(f"reading {args.recording.name}") as bar:
            recorded, units, light = extract_bag(args.recording, temporary, bar, args.baseline)
        folder, depth_scale = temporary, depth_scale or units
    files = frame_files(folder, args.depth)
    assumed: list[str] = []
    if args.poses and files[0].number <= LEAST_TIME_MS:
        assumed.append("the frames are 1/30 s apart, from 0 s on: their names hold no times, milliseconds since 1970")
    words = (
        [] if args.depth or any("depth" in entry.files for entry in files) else calibration.depth_words(folder, files)
    )
    if len(words) == 1:
        files = frame_files(folder, words.pop())
    if depth_scale is None:
        depth_scale = DEPTH_SCALE_M
        if any("depth" in entry.files for entry in files):
            assumed.append(f"depth is in steps of {depth_scale:g} m, a D400's usual ones: --depth-scale tells others")
    if bag:
        files = [replace(entry, **light.get(entry.files["left"], {})) for entry in files]
    if args.swap:
        files = swapped(files)
    if untold := 0 if args.exposure else sum(entry.exposure_s is None for entry in files):
        number = "all" if untold == len(files) else f"{untold} of the {len(files)}"
        assumed.append(f"{number} frames have an exposure of 0.008 s: --exposure tells theirs")
    exposures = args.exposure or [entry.exposure_s or 0.008 for entry in files]
    if len(exposures) not in (1, len(files)):
        raise cli.CommandError(f"--exposure: has {len(exposures)} times for {len(files)} frames: give one, or each")
    size = image_size(files[0].files["left"], "Infrared 1")
    if bag:
        device = calibration.own_device(args, args.recording, size) or recorded
    else:
        device, nominal_figures = calibration.folder_device(args, size)
        assumed += nominal_figures
    if calibration.is_rectified(device, *size):
        offset_px = calibration.rectified_pair(device, *size).offset_px
        told = [calibration.sides_text(calibration.checked_sides(files, args.swap, offset_px))]
    else:
        told = ["cameras: not rectified, by this calibration: their order and rows are not looked at"]
    if bag and "Color" in image_streams(args.recording):
        told.append("left out: the bag's colour images, which are read only where it has no infrared ones")
    if rest := calibration.unused_images(folder, files):
        told.append(f"{len(rest)} images are not used, such as {rest[0].relative_to(folder)}")
    with ProgressBar(f"importing {args.recording.name}") as bar:
        nominal = _nominal_projector(StereoDepthSensorConfig(args.sensor))
        capture = import_realsense(
            files, device, args.out, *nominal, depth_scale, args.scene, trajectory, exposures, robot, bar
        )
    missing = calibration.missing_text(files, capture.frames, bool(args.poses or args.robot))
    told += [*(f"missing: {line}" for line in missing), *(f"assumed: {line}" for line in assumed)]
    return capture, told, words


def _robot(args: argparse.Namespace) -> RobotPoses | None:
    from activestereo.calibrate.hand_eye import read_poses
    from activestereo.capture.capture_json import JsonObject
    from activestereo.capture.importers.realsense_folder import RobotPoses

    if args.robot is None:
        cli.refuse(args, ("hand_eye",), "for --robot, which is not given")
        return None
    cli.refuse(args, ("poses",), "in place of --robot, not beside it")
    if args.hand_eye is None:
        raise cli.CommandError("--robot needs --hand-eye: the .hand_eye.json that calibrate rig --robot writes")
    return RobotPoses(read_poses(args.robot), JsonObject.read(args.hand_eye).rigid_transform("camera_to_gripper"))


def _nominal_projector(config: StereoDepthSensorConfig) -> tuple[Projector, NDArray[np.uint8]]:
    """Returns the preset's projector and its dot pattern; a black pattern if the camera has no projector."""
    from activestereo.camera.plan import pattern_of

    pattern, K = pattern_of(config) or (np.zeros((2, 2), np.uint8), np.eye(3))
    forward, left, up = (config.pose_rgb_irproj.p - config.trans_pose_l.p).tolist()
    return Projector(Path("pattern.png"), K, rigid_motion((left, up, -forward))), pattern
