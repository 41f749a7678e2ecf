# SPDX-License-Identifier: Apache-2.0
"""activestereo import: a recording of another program becomes a capture."""

import argparse
from pathlib import Path

from activestereo.cli.arguments import CommandError, positive

_TEXT = """\
Makes a capture of a librealsense recording: a folder of PNG files of both
infrared streams, and of depth where it was saved as 16-bit PNG. Names tell the
stream (Infrared 1, Infrared 2, Depth, or left, right, depth) and the time.

CALIBRATION is what rs-enumerate-devices -c prints, saved to a file, from the
same device. The pattern is the sensor preset's nominal one: acquire pattern
measures the device's own. Without --poses the camera stands still, and all
frames are repeats of one view, as acquire noise and acquire pattern want them.

example:
  rs-enumerate-devices -c > d435.txt
  activestereo import recording/ --calibration d435.txt --depth-scale 0.001 --out captures/desk
"""


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "import", help="make a capture of a librealsense recording", description=_TEXT, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=Path, metavar="FOLDER", help="PNG files of the recording")
    parser.add_argument("--calibration", required=True, type=Path, metavar="FILE", help="output of rs-enumerate-devices -c")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="the capture's folder, which must not exist")
    parser.add_argument("--depth-scale", type=positive, metavar="M", help="metres per unit of the depth images, often 0.001")
    parser.add_argument("--poses", type=Path, metavar="FILE", help="camera_to_world over time: timestamp tx ty tz qx qy qz qw in each line")
    parser.add_argument("--scene", type=Path, metavar="FILE", help="glTF scene of what is in view (default: nothing)")
    parser.add_argument("--exposure", type=positive, default=0.008, metavar="S", help="exposure, seconds (default: 0.008)")
    parser.add_argument("--sensor", default="d435", metavar="NAME", help="whose nominal pattern it is, of 'activestereo presets' (default: d435)")
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> None:
    from activestereo.importers.realsense_folder import import_realsense
    from activestereo.importers.realsense_text import read_device_text
    from activestereo.importers.trajectory import read_trajectory
    from activestereo.presets import StereoDepthSensorConfig
    from activestereo.progress_bar import ProgressBar

    if args.out.exists():
        raise CommandError(f"{args.out} exists already: an import writes a new folder")
    if not args.out.absolute().parent.is_dir():
        raise CommandError(f"the folder {args.out.parent} does not exist: make it first")
    if args.depth_scale is not None and args.depth_scale <= 0:
        raise CommandError("--depth-scale is 0, expected metres per unit above 0")
    device = read_device_text(args.calibration)
    trajectory = None if args.poses is None else read_trajectory(args.poses)
    pattern, pattern_K = StereoDepthSensorConfig(args.sensor).pattern()
    with ProgressBar(f"importing {args.recording.name}") as bar:
        capture = import_realsense(
            args.recording, device, args.out, pattern, pattern_K, args.depth_scale, args.scene, trajectory, args.exposure, progress=bar
        )
    rig, with_depth = capture.rig, sum(frame.depth_path is not None for frame in capture.frames)
    print(f"{len(capture.frames)} frames of {rig.left.width}x{rig.left.height}, {with_depth} with depth; baseline {1e3 * rig.baseline_m:.2f} mm, f {rig.left.K[0, 0]:.2f} px")
    print("the pattern and the projector's place are nominal" + ("; the scene is empty: compare and diagnose need one" if args.scene is None else ""))
    print(f"written: {args.out}")
