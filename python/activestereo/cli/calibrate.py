# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo calibrate`: measures frames of a real camera into sections of model.json, and an object's
materials. From views with depth it makes a scene, or a capture with camera, poses, pattern and light."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from activestereo.capture.capture import read_capture
from activestereo.cli import arguments as cli
from activestereo.common.input_files import read_json_object
from activestereo.common.output_files import write_json
from activestereo.common.progress_bar import ProgressBar
from activestereo.report.screen import command, screen

_TEXT = """\
Measures a real camera. Each part replaces its own section of model.json, and
leaves the others as they are; the file is written at the end, whole.

activestereo calibrate noise --help tells more.
"""

_NOISE = """\
The imager's temporal noise: the paper's gamma factor with Gaussian noise, or shot
noise with read noise, whichever makes the pixels' counts more probable.

FRAMES is a folder of PNG files of one static view (10 or more), a folder of such
folders (two frames or more each, such as steps of even light), a .npy stack uint8 or
uint16 [frame][height][width], a capture with repeat groups, or a descriptor file of
EMVA 1288 (.txt). Groups of several exposures give a photon transfer table and the black
level. Bright and dark regions in one view are best. --dark: frames with the lens
covered; shot noise alone cannot tell black from read noise. Static speckle is the same
in every repeat: it never shows in repeats.

examples:
  activestereo calibrate noise wall/ --dark covered/ -o model.json
  activestereo calibrate noise EMVA1288_Data.txt -o model.json
"""

_PATTERN = """\
The projector's dots, each with direction and power, and the projector's place, from
frames of a flat, matt wall.

WALL_FRAMES is a capture: 10 or more repeats of the wall in one repeat group per
distance, both cameras, rectified, projector on, no dot clipped. Two distances, the
second 1.5 times as far or more, tell where the projector stands; with one its nominal
place is kept. The nearest wall stands as near as things will. K and the baseline are
those of FILE's rig where it has one, else the capture's, as all else is.

example:
  activestereo calibrate pattern walls/ -o model.json
"""

_RIG = """\
Both infrared cameras' calibration from pairs of frames of a board, projector off: K,
lens, the place of the right camera, all with 90 % intervals, and a picture of where
corners were seen (FILE's name with .coverage.png). 15 boards or more, tilted up to 40
degrees and into every corner of the picture. With --robot the camera's place on the
gripper follows, as .hand_eye.json; the CSV names the frames as the PNG files do.

BOARD is one of
  9x6:0.03                   chessboard, 9x6 inner corners, squares of 0.03 m
  charuco:9x6:0.03:0.022     ChArUco, 9x6 squares of 0.03 m, markers (5x5) of 0.022 m
  apriltag:6x4:0.04:0.01     6x4 AprilTags (36h11) of 0.04 m, 0.01 m apart

example:
  activestereo calibrate rig boards/ --board 9x6:0.03 --robot poses.csv -o model.json
"""

_DRIFT = """\
What moves while a camera warms up, per kelvin, from frames of a still scene over ten
minutes or more from switching on, as effects of the model with 90 % intervals: the
pair's centres and focal length, the laser's power, the pattern's size. No scene is
measured, and lamps and the mount may change.

FRAMES is a capture: import's folders on/ and off/, for some frames must have the
projector off. Temperatures are the frames' own (temperature_c) or --temperatures, such
as a D4xx's ASIC; names of images hold the same times (left_1712345678901.png).

example:
  activestereo import warm_up/ --calibration d435.txt -o captures/warm_up
  activestereo calibrate drift captures/warm_up --temperatures asic.csv -o model.json
"""

_MATERIALS = """\
What an object of the capture's scene is made of: roughness, metallic, specular,
transmission and infrared albedo of each of its parts, under the materials' names. The
object's pose must be known (look with view); what lies around it keeps the scene's
materials, which tell how bright the lights are. Rig and pattern are those of model.json,
where it has them. Put lamps whose place you measured into the capture's "lights".

Infrared images with the projector on are needed; with it off, and colour images, tell
more. What the pictures do not determine is named and not written. The clean way: two
or three poses, a matt table of known albedo, the object large in the picture.

example:
  activestereo calibrate materials captures/desk --object cup -o model.json
"""

_SCENE = """\
A scene where no geometry exists: the surface that one pose of the camera measured, as
a mesh with one albedo, and the camera. Its repeats give the median.

example:
  activestereo calibrate scene captures/desk -o desk.gltf
"""

_WORLD = """\
A camera and a room from views with depth, without wall, rig or repeats: camera, poses,
dots, exposures and albedo, each with 90 % intervals and a picture in CAPTURE/measured.

RECORDING is a capture that 'activestereo import' made: two or more pairs of one device,
dots on, each with depth in the left camera's pixels (the device's own or a laser's).
Views that overlap make the scene; all others tell of pattern and camera, too. Record a
static room, turn the camera by 10 to 30 degrees between views, keep a third of the
picture, and leave exposure where no dot is white. --test holds views out whole: of them
only pose and exposure are measured. --keep leaves what you know better as it is.

example:
  activestereo import views/ --sensor d415 --k 899.5,899.5,639.5,359.5 \\
      --baseline 0.055 --depth laser --depth-scale 0.001 -o rec
  activestereo calibrate world rec --test 2 -o capture
"""
_STEPS = {
    "camera": "focal length, centre, baseline and rows from overlapping views",
    "poses": "where overlapping views were taken from, by their depth",
    "dots": "the projector's dots and place from any scenes with depth",
    "exposure": "each frame's exposure, the black level and the lens's falloff from views of known poses",
    "albedo": "the scene: surfaces under their albedo and the room's light, from views of known poses and exposures",
}
_STEP_OF = {"dots": "pattern"}


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(
        commands, "calibrate", "measure a real camera: frames become sections of model.json", _TEXT
    )
    parts = parser.add_subparsers(dest="part", metavar="PART", required=True)
    noise = _section_part(parts, "noise", "repeats of static views -> imager", _NOISE, "imager", _noise)
    noise.add_argument("frames", type=Path, metavar="FRAMES", help="repeats of static views")
    noise.add_argument("--dark", type=Path, metavar="FRAMES", help="repeats without light")
    pattern = _section_part(parts, "pattern", "frames of a flat wall -> pattern", _PATTERN, "pattern", _pattern)
    pattern.add_argument("frames", type=Path, metavar="WALL_FRAMES", help="capture whose repeat groups look at a wall")
    rig = _section_part(parts, "rig", "frames of a board -> rig", _RIG, "rig", _rig)
    text = "folder with left/ and right/, PNG files of equal names"
    rig.add_argument("frames", type=Path, metavar="BOARD_FRAMES", help=text)
    text = "9x6:0.03, charuco:9x6:0.03:0.022 or apriltag:6x4:0.04:0.01 (metres)"
    rig.add_argument("--board", required=True, metavar="BOARD", help=text)
    rig.add_argument("--robot", type=Path, metavar="FILE", help="CSV of gripper_to_base: name,x,y,z,qx,qy,qz,qw")
    rig.add_argument("--rectified", action="store_true", help="the images are rectified: no lens distortion is fitted")
    text = "the device's own K of both rectified cameras, held"
    rig.add_argument("--k", type=cli.camera_matrix, metavar="FX,FY,CX,CY", help=text)
    drift = _section_part(parts, "drift", "frames of a warm-up -> effects", _DRIFT, "effects", _drift)
    drift.add_argument("frames", type=Path, metavar="FRAMES", help="capture of a still scene, some frames without dots")
    drift.add_argument("--temperatures", type=Path, metavar="FILE", help="CSV of seconds,celsius")
    scene = cli.add_command(parts, "scene", "depth of one pose -> a scene without CAD", _SCENE, _run_scene)
    scene.add_argument("capture", type=Path, metavar="CAPTURE", help="capture with depth")
    text = "frame of the pose (default: first with depth)"
    scene.add_argument("--frame", type=cli.integer_from(0), metavar="ID", help=text)
    text = "pixels between points (default: 2)"
    scene.add_argument("--step", type=cli.integer_from(1), default=2, metavar="PX", help=text)
    scene.add_argument("-o", "--out", required=True, type=Path, metavar="FILE", help=".gltf or .glb")
    materials = _section_part(
        parts, "materials", "views of an object -> materials", _MATERIALS, "materials", _materials
    )
    text = "capture whose scene has the object at its place"
    materials.add_argument("capture", type=Path, metavar="CAPTURE", help=text)
    materials.add_argument("--object", required=True, metavar="NAME", help="the object's name in the scene")
    cli.add_shared(materials, device=True)
    world = cli.add_command(parts, "world", "views with depth -> a capture; its steps:", _WORLD, _run_world)
    text = "print what it tells, from which size, and what to record for all else; RECORDING: calibrate world's capture"
    world.add_argument("--plan", action="store_true", help=text)
    text = "a step whose part of the capture stays as it is; repeatable"
    world.add_argument("--keep", choices=tuple(_STEPS)[:-1], action="append", default=[], help=text)
    for name, summary in _STEPS.items():
        text = f"One step of calibrate world: {summary}.\nThe rest of the capture stays as it is."
        cli.add_command(parts, name, summary, text, _run_world).set_defaults(plan=False)
    for step in (parts.choices[name] for name in ("world", *_STEPS)):
        step.add_argument("recording", type=Path, metavar="RECORDING", help="capture of views with depth")
        text, needed = "the new capture, which must not exist", step is not world
        step.add_argument("-o", "--out", required=needed, type=Path, metavar="DIR", help=text)
        text = "frame to hold out; repeatable"
        step.add_argument("--test", type=cli.integer_from(0), action="append", default=[], metavar="ID", help=text)
        cli.add_shared(step, seed="same seed, same result", json=True, verbose="all steps")


def _section_part(
    parts: cli.Commands, name: str, summary: str, text: str, section: str, measure: Callable[..., Any]
) -> cli.Parser:
    """Adds a calibration that replaces one section of model.json. measure(args, progress): returns the measured
    SensorModel, a text on it, and perhaps commands to run next."""
    parser = cli.add_command(parts, name, summary, text, _run_section)
    parser.set_defaults(section=section, measure=measure)
    text = "model.json; made if it is not there, else one section is replaced"
    parser.add_argument("-o", "--out", required=True, type=Path, metavar="FILE", help=text)
    cli.add_shared(parser, seed="same seed, same result", json=True, verbose="all that was measured")
    return parser


def _run_section(args: argparse.Namespace) -> None:
    from activestereo.model.write import replace_sections, stored_sections

    cli.check_out_file(args.out)
    stored_sections(args.out)  # so that a wrong file is refused before the work
    with ProgressBar(f"calibrating {args.part}") as bar:
        model, text, *steps = args.measure(args, bar)
    replace_sections(args.out, model, keep_rig=args.part == "pattern")
    if args.json:
        cli.print_json(read_json_object(args.out).get(args.section, []))
        return
    sentence, *notes = text.splitlines()
    steps = steps or [command("model", "show", args.out)]
    print(screen(f"{args.section} in {args.out}: {sentence.strip()}", (), notes, steps, verbose=args.verbose))


def _noise(args: argparse.Namespace, bar: ProgressBar) -> tuple[Any, ...]:
    from activestereo.calibrate.noise import calibrate_noise

    noise = calibrate_noise(args.frames, args.dark, args.seed, bar)
    return noise.model(), noise.summary()


def _drift(args: argparse.Namespace, bar: ProgressBar) -> tuple[Any, ...]:
    from activestereo.calibrate.drift import calibrate_drift

    drift = calibrate_drift(args.frames, args.temperatures)
    return drift.model(), drift.summary()


def _pattern(args: argparse.Namespace, bar: ProgressBar) -> tuple[Any, ...]:
    from activestereo.calibrate.pattern import calibrate_pattern
    from activestereo.model import read_model

    pattern = calibrate_pattern(args.frames, bar, read_model(args.out) if args.out.is_file() else None)
    return pattern.model(), pattern.summary()


def _materials(args: argparse.Namespace, bar: ProgressBar) -> tuple[Any, ...]:
    from activestereo.calibrate.materials import calibrate_materials
    from activestereo.model import read_model

    model = read_model(args.out) if args.out.is_file() else None
    found = calibrate_materials(args.capture, args.object, args.seed, args.device, model, bar)
    same = cli.carried(args, "seed", "device")
    step = command("compare", args.capture, "--model", args.out, *same, "-o", args.out.with_suffix(""))
    return found.model(), found.summary(), step


def _rig(args: argparse.Namespace, bar: ProgressBar) -> tuple[Any, ...]:
    """Calibrates the rig. Writes a picture of the corners' coverage beside the model and, with --robot, the camera's
    pose on the gripper."""
    from activestereo.calibrate.hand_eye import hand_eye, read_poses
    from activestereo.calibrate.rig import Board, calibrate_rig, write_coverage

    robot = {} if args.robot is None else read_poses(args.robot)
    has_lens = not args.rectified and args.k is None
    result = calibrate_rig(args.frames, Board.parse(args.board), has_lens, args.k, bar)
    text, written = result.summary(), [args.out.with_suffix(".coverage.png")]
    both = [name for name in result.board_to_left if Path(name).stem in robot]
    if robot and not both:
        frames = f"{args.frames / 'left'}, such as {next(iter(result.board_to_left))}"
        raise cli.CommandError(f"{args.robot}: names no frame of {frames}")
    if robot:
        hand = hand_eye([robot[Path(name).stem] for name in both], [result.board_to_left[name] for name in both])
        written.append(args.out.with_suffix(".hand_eye.json"))
        write_json(written[1], hand.as_json())
        text += f"\n{hand.summary()}"
    write_coverage(written[0], result)
    return result.model(), f"{text}\nalso written: {', '.join(map(str, written))}"


def _run_scene(args: argparse.Namespace) -> None:
    from activestereo.calibrate.world.mesh import NOTE, write_height_field

    if args.out.suffix not in (".gltf", ".glb"):
        raise cli.CommandError(f"{args.out}: -o is the name of a .gltf or .glb file")
    cli.check_out_file(args.out)
    triangles, share, frames = write_height_field(args.out, read_capture(args.capture), args.frame, args.step)
    found = f"{triangles} triangles from {frames} frames: {100 * share:.0f} % of the image is a surface"
    step = command("simulate", args.out, "-o", args.out.with_suffix(""))
    print(screen(f"{args.out}: {found}.", (), [NOTE], [step]))


def _print_plan(args: argparse.Namespace) -> None:
    from activestereo.calibrate.world.cells import Room
    from activestereo.diagnose.room.names import score_room
    from activestereo.diagnose.room.plan import plan_of, plan_text
    from activestereo.effects import builtin
    from activestereo.effects.engines.loaded_scene import is_measured_room

    capture = read_capture(args.recording)
    if not is_measured_room(capture):
        raise cli.CommandError(f"{args.recording}: is no measured room: make one with calibrate world")
    plan = plan_of(score_room(Room(capture), builtin()))
    if args.json:
        cli.print_json([asdict(r) for r in plan])
    else:
        print(plan_text(plan))


def _run_world(args: argparse.Namespace) -> None:
    from activestereo.calibrate.world.world import STEPS, calibrate_world

    if args.plan:
        _print_plan(args)
        return
    if args.out is None:
        raise cli.CommandError("-o is missing: the folder of the new capture")
    if args.out.exists():
        raise cli.CommandError(f"{args.out} exists already: a calibration writes a new folder")
    steps: tuple[str, ...] = (_STEP_OF.get(args.part, args.part),)
    if args.part == "world":
        kept = {_STEP_OF.get(name, name) for name in args.keep}
        steps = tuple(step for step in STEPS if step not in kept)
    with ProgressBar(f"measuring {args.recording.name}") as bar:
        lines = calibrate_world(args.recording, args.out, steps, args.test, args.seed, bar)
    if args.json:
        cli.print_json(read_json_object(args.out / "capture.json")["measured"])
        return
    sentence = f"{args.out}: {', '.join(steps)} measured, each with a picture."
    same = args.out, *cli.carried(args, "seed")
    leads = [command(name, *same, "-o", f"{args.out}_{name}") for name in ("diagnose", "compare")]
    notes = [note for line in lines for note in line.splitlines()]
    print(screen(sentence, (), notes, leads, args.out / "measured", verbose=args.verbose))
