# SPDX-License-Identifier: Apache-2.0
"""activestereo import: a recording of another program becomes a capture."""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from activestereo.cli.arguments import CommandError, positive

_TEXT = """\
Makes a capture of a recording: a folder of PNG files of both infrared streams,
and of depth where it was saved as 16-bit PNG, or a bag: librealsense's .bag, or
one of ROS 1 or ROS 2 with the topics of realsense-ros (needs: pip install
rosbags). PNG names tell the stream (Infrared 1, Infrared 2, Depth, or left,
right, depth) and the time. A bag has its own calibration.

CALIBRATION is what rs-enumerate-devices -c prints, saved to a file, from the
same device. The pattern is the sensor preset's nominal one: acquire pattern
measures the device's own. Without --poses the camera stands still, and all
frames are repeats of one view, as acquire noise and acquire pattern want them.

example:
  rs-enumerate-devices -c > d435.txt
  activestereo import recording/ --calibration d435.txt --depth-scale 0.001 --out captures/desk
  activestereo import 20260101_120000.bag --out captures/desk
"""


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "import",
        help="make a capture of a librealsense recording",
        description=_TEXT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("recording", type=Path, metavar="RECORDING", help="folder of PNG files, or a bag")
    parser.add_argument(
        "--calibration", type=Path, metavar="FILE", help="output of rs-enumerate-devices -c; not needed for a bag"
    )
    parser.add_argument(
        "--out", required=True, type=Path, metavar="DIR", help="the capture's folder, which must not exist"
    )
    parser.add_argument(
        "--depth-scale", type=positive, metavar="M", help="metres per unit of the depth images, often 0.001"
    )
    parser.add_argument(
        "--poses",
        type=Path,
        metavar="FILE",
        help="camera_to_world over time: timestamp tx ty tz qx qy qz qw in each line",
    )
    parser.add_argument("--scene", type=Path, metavar="FILE", help="glTF scene of what is in view (default: nothing)")
    parser.add_argument(
        "--exposure", type=positive, default=0.008, metavar="S", help="exposure, seconds (default: 0.008)"
    )
    parser.add_argument(
        "--sensor",
        default="d435",
        metavar="NAME",
        help="whose nominal pattern it is, of 'activestereo presets' (default: d435)",
    )
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> None:
    from activestereo.importers.bag import extract_bag, is_bag
    from activestereo.importers.realsense_folder import import_realsense
    from activestereo.importers.realsense_text import read_device_text
    from activestereo.importers.trajectory import read_trajectory
    from activestereo.progress_bar import ProgressBar

    if args.out.exists():
        raise CommandError(f"{args.out} exists already: an import writes a new folder")
    if not args.out.absolute().parent.is_dir():
        raise CommandError(f"the folder {args.out.parent} does not exist: make it first")
    if args.depth_scale is not None and args.depth_scale <= 0:
        raise CommandError("--depth-scale is 0, expected metres per unit above 0")
    bag = is_bag(args.recording)
    if not bag and args.calibration is None:
        raise CommandError("--calibration is needed for a folder of PNG files: the output of rs-enumerate-devices -c")
    device = None if args.calibration is None else read_device_text(args.calibration)
    trajectory = None if args.poses is None else read_trajectory(args.poses)
    pattern, pattern_K = _pattern(args.sensor)
    with TemporaryDirectory(prefix=".import.", dir=args.out.absolute().parent) as temporary:
        folder, scale = args.recording, args.depth_scale
        if bag:
            with ProgressBar(f"reading {args.recording.name}") as bar:
                told, units = extract_bag(args.recording, Path(temporary), progress=bar)
            folder, scale, device = (
                Path(temporary),
                units if scale is None else scale,
                told if device is None else device,
            )
        assert device is not None  # a folder has --calibration, a bag its own
        with ProgressBar(f"importing {args.recording.name}") as bar:
            capture = import_realsense(
                folder, device, args.out, pattern, pattern_K, scale, args.scene, trajectory, args.exposure, progress=bar
            )
    rig, with_depth = capture.rig, sum(frame.depth_path is not None for frame in capture.frames)
    print(
        f"{len(capture.frames)} frames of {rig.left.width}x{rig.left.height}, {with_depth} with depth; baseline "
        f"{1e3 * rig.baseline_m:.2f} mm, f {rig.left.K[0, 0]:.2f} px"
    )
    print(
        "the pattern and the projector's place are nominal"
        + ("; the scene is empty: compare and diagnose need one" if args.scene is None else "")
    )
    print(f"written: {args.out}")


def _pattern(sensor: str) -> tuple[Any, Any]:
    """The preset's nominal pattern and its K; black where a camera has no projector."""
    import numpy as np

    from activestereo.presets import StereoDepthSensorConfig

    return StereoDepthSensorConfig(sensor).pattern() or (np.zeros((2, 2), np.uint8), np.eye(3))
