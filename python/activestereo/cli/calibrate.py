# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo calibrate noise | pattern | rig`: measures a real camera's frames into sections of
model.json."""

import argparse
import json
from pathlib import Path

from activestereo.cli import calibrate_scene, calibrate_world
from activestereo.cli.arguments import CommandError, add_shared, camera_matrix, check_out_file, print_section

_TEXT = """\
Measures a real camera. Each part replaces its own section of model.json, and
leaves the others as they are; the file is written at the end, whole.

  noise      repeats of static views  -> imager
  pattern    frames of a flat wall    -> pattern
  rig        frames of a board        -> rig
  materials  views of an object       -> materials
  drift      frames of a warm-up      -> effects
  scene      depth of one pose        -> a scene where there is no CAD
  world      views with depth         -> a capture: camera, poses, pattern, light
  camera, poses, dots                 -> one step of it

activestereo calibrate noise --help tells more.
"""

_NOISE = """\
The imager's temporal noise from repeats. Two models are fitted, the paper's gamma
factor with Gaussian noise, and shot noise with read noise; the one that gives
pixels it was not fitted to the higher density is chosen.

FRAMES is a folder of PNG files of one static view (10 or more), a folder of such
folders, a .npy stack uint8 or uint16 [frame][height][width], or a capture with
repeat groups. Groups of several exposures give a photon transfer table and the
black level. Bright and dark regions in one view are best: k shows where it is
bright, sigma and black where it is dark. --dark: frames with the lens covered;
shot noise alone cannot tell black from read noise.

Static speckle is the same in every repeat: it never shows in repeats.

Frames of even light by EMVA 1288 give more: gain, dark noise, DSNU, PRNU and defects,
as imager and effects of the model (the package emva1288 prints the standard's own
table). FRAMES is then the standard's descriptor file (lines v, n, b, d, i; EMVA1288_Data.txt of its
reference sets), or a folder of folders, one for each step of light, of 2 frames
each, of 3 or more one; --dark: frames with the lens covered.

examples:
  activestereo calibrate noise wall/ --dark covered/ -o model.json
  activestereo calibrate noise EMVA1288_Data.txt -o model.json
  activestereo calibrate noise stack.npy -o model.json
"""

_PATTERN = """\
The projector's dots, each with direction and power, from frames of a flat, matt
wall, and the projector's place.

WALL_FRAMES is a capture: 10 or more repeats of the wall in one repeat group per
distance, both cameras, rectified, projector on, no dot clipped. Two distances, the
second 1.5 times as far or more, tell where the projector stands; with one its
nominal place is kept. The nearest wall stands as near as things will. K and the
baseline are those of FILE's rig where it has one, which calibrate rig measures, else
the capture's; the projector's K and nominal place are the capture's.

example:
  activestereo calibrate pattern walls/ -o model.json
"""

_RIG = """\
Both infrared cameras' calibration from pairs of frames of a board, projector off:
K, lens, the place of the right camera, all with 90 % intervals, and a picture of
where corners were seen (FILE's name with .coverage.png). 15 boards or more,
tilted up to 40 degrees and into every corner of the picture.

BOARD is one of
  9x6:0.03                   chessboard, 9x6 inner corners, squares of 0.03 m
  charuco:9x6:0.03:0.022     ChArUco, 9x6 squares of 0.03 m, markers (5x5) of 0.022 m
  apriltag:6x4:0.04:0.01     6x4 AprilTags (36h11) of 0.04 m, 0.01 m apart

With --robot the camera's place on the gripper follows, by least squares over all
poses; it goes into FILE's name with .hand_eye.json. The CSV names the frames as the PNG files do.

examples:
  activestereo calibrate rig boards/ --board 9x6:0.03 -o model.json
  activestereo calibrate rig boards/ --board charuco:9x6:0.03:0.022 --robot poses.csv -o model.json
"""

_DRIFT = """\
What moves while a camera warms up, per kelvin, from frames of a still scene over ten
minutes or more from switching on, as effects of the model with 90 % intervals: the
pair's centres and focal length, the laser's power, the pattern's size. No scene is
measured, and lamps and the mount may change.

FRAMES is a capture: import's folders on/ and off/, for some frames must have the
projector off. Temperatures are the frames' own (temperature_c) or --temperatures,
a CSV of seconds,celsius, such as a D4xx's ASIC or projector temperature; names of
images hold the same times in milliseconds (left_1712345678901.png).

example:
  activestereo import warm_up/ --calibration d435.txt -o captures/warm_up
  activestereo calibrate drift captures/warm_up --temperatures asic.csv -o model.json
"""


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "calibrate", help="measure a real camera: frames become sections of model.json", description=_TEXT
    )
    parts = parser.add_subparsers(dest="part", metavar="PART", required=True)
    noise = _part(parts, "noise", "the imager's temporal noise from repeats", _NOISE)
    noise.add_argument("frames", type=Path, metavar="FRAMES", help="repeats of static views")
    noise.add_argument("--dark", type=Path, metavar="FRAMES", help="repeats without light")
    noise.set_defaults(run=_run_noise)
    pattern = _part(parts, "pattern", "the projector's dots from frames of a flat wall", _PATTERN)
    pattern.add_argument("frames", type=Path, metavar="WALL_FRAMES", help="capture whose repeat groups look at a wall")
    pattern.set_defaults(run=_run_pattern)
    rig = _part(parts, "rig", "both cameras' calibration from frames of a board", _RIG)
    text = "folder with left/ and right/, PNG files of equal names"
    rig.add_argument("frames", type=Path, metavar="BOARD_FRAMES", help=text)
    text = "9x6:0.03, charuco:9x6:0.03:0.022 or apriltag:6x4:0.04:0.01 (metres)"
    rig.add_argument("--board", required=True, metavar="BOARD", help=text)
    rig.add_argument("--robot", type=Path, metavar="FILE", help="CSV of gripper_to_base: name,x,y,z,qx,qy,qz,qw")
    rig.add_argument("--rectified", action="store_true", help="the images are rectified: no lens distortion is fitted")
    text = "the device's own K of both rectified cameras, held"
    rig.add_argument("--k", type=camera_matrix, metavar="FX,FY,CX,CY", help=text)
    rig.set_defaults(run=_run_rig)
    drift = _part(parts, "drift", "what moves with temperature, from frames of a warm-up", _DRIFT)
    drift.add_argument("frames", type=Path, metavar="FRAMES", help="capture of a still scene, some frames without dots")
    drift.add_argument("--temperatures", type=Path, metavar="FILE", help="CSV of seconds,celsius")
    drift.set_defaults(run=_run_drift)
    calibrate_scene.add_parts(parts)
    calibrate_world.add_parts(parts)


def _part(parts: argparse._SubParsersAction, name: str, summary: str, text: str) -> argparse.ArgumentParser:
    parser = parts.add_parser(name, help=summary, description=text)
    text = "model.json; made if it is not there, else one section is replaced"
    parser.add_argument("-o", "--out", required=True, type=Path, metavar="FILE", help=text)
    add_shared(parser, seed="same seed, same result", json=True, verbose="all that was measured")
    return parser


def _run_noise(args: argparse.Namespace) -> None:
    from activestereo.calibrate.emva1288 import Emva1288, calibrate_emva1288, is_emva1288
    from activestereo.calibrate.noise import Noise, calibrate_noise
    from activestereo.common.progress_bar import ProgressBar
    from activestereo.model.write import replace_sections

    check_out_file(args.out)
    measured: Emva1288 | Noise
    if is_emva1288(args.frames):
        with ProgressBar("reading frames") as bar:
            measured = calibrate_emva1288(args.frames, args.dark, bar)
    else:
        with ProgressBar("fitting noise") as bar:
            measured = calibrate_noise(args.frames, args.dark, args.seed, bar)
    replace_sections(args.out, measured.model())
    print_section(args, "imager", measured.summary())


def _run_drift(args: argparse.Namespace) -> None:
    from activestereo.calibrate.drift import calibrate_drift
    from activestereo.model.write import replace_sections

    check_out_file(args.out)
    drift = calibrate_drift(args.frames, args.temperatures)
    replace_sections(args.out, drift.model())
    print_section(args, "effects", drift.summary())


def _run_pattern(args: argparse.Namespace) -> None:
    from activestereo.calibrate.pattern import calibrate_pattern
    from activestereo.common.progress_bar import ProgressBar
    from activestereo.model import read_model
    from activestereo.model.write import replace_sections

    check_out_file(args.out)
    model = read_model(args.out) if args.out.is_file() else None
    with ProgressBar("finding dots") as bar:
        pattern = calibrate_pattern(args.frames, bar, model)
    replace_sections(args.out, pattern.model(), keep_rig=True)
    print_section(args, "pattern", pattern.summary())


def _run_rig(args: argparse.Namespace) -> None:
    from activestereo.calibrate.boards import Board
    from activestereo.calibrate.hand_eye import hand_eye, read_poses
    from activestereo.calibrate.rig import calibrate_rig, write_coverage
    from activestereo.common.output_files import replace_file
    from activestereo.common.progress_bar import ProgressBar
    from activestereo.model.write import replace_sections

    check_out_file(args.out)
    robot = None if args.robot is None else read_poses(args.robot)
    with ProgressBar("calibrating") as bar:
        result = calibrate_rig(args.frames, Board.parse(args.board), not args.rectified and args.k is None, args.k, bar)
    hand = None
    if robot is not None:
        named = {Path(name).stem: pose for name, pose in robot.items()}
        both = [name for name in result.board_to_left if Path(name).stem in named]
        if not both:
            raise CommandError(
                f"{args.robot}: names no frame of {args.frames / 'left'}, such as {next(iter(result.board_to_left))}"
            )
        hand = hand_eye([named[Path(name).stem] for name in both], [result.board_to_left[name] for name in both])
    replace_sections(args.out, result.model())
    written = [args.out.with_suffix(".coverage.png")]
    write_coverage(written[0], result)
    text = result.summary()
    if hand is not None:
        written.append(args.out.with_suffix(".hand_eye.json"))
        content = (json.dumps(hand.as_json(), indent=1) + "\n").encode()
        replace_file(written[1], lambda file: file.write(content))
        text += f"\n{hand.summary()}"
    print_section(args, "rig", f"{text}\nalso written: {', '.join(map(str, written))}")
