# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo calibrate scene | materials`: turns measured depth into a scene, and fits an object's
materials."""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.cli.arguments import CommandError, add_shared, carried, check_out_file, integer_from, print_section

_SCENE = """\
A scene where no geometry exists: the surface that one pose of the camera measured, as
a mesh with one albedo, and the camera. Its repeats give the median. The command warns
of what such a scene cannot tell: place the parts that you have CAD files of.

example:
  activestereo calibrate scene captures/desk -o desk.gltf
"""

_MATERIALS = """\
What an object of the capture's scene is made of: roughness, metallic, specular,
transmission and infrared albedo of each of its parts, into the section materials of
model.json under the materials' names. The object's pose must be known (see overlay);
what lies around it, such as the table, keeps the scene's materials, which tell how
bright the lights are. Rig and pattern are those of model.json, where it has them
already. Put lamps whose place you measured into the capture's "lights".

Infrared images with the projector on are needed; with it off, and colour images, tell
more. What the pictures do not determine is named and not written. The clean way: two
or three poses, a matt table of known albedo, the object large in the picture.

example:
  activestereo calibrate materials captures/desk --object cup -o model.json
"""


def add_parts(parts: argparse._SubParsersAction) -> None:
    """Adds the parsers of `calibrate scene` and `calibrate materials`."""
    scene = parts.add_parser("scene", help="a measured depth map as a scene", description=_SCENE)
    scene.add_argument("capture", type=Path, metavar="CAPTURE", help="capture with depth")
    text = "frame of the pose (default: first with depth)"
    scene.add_argument("--frame", type=integer_from(0), metavar="ID", help=text)
    text = "pixels between points (default: 2)"
    scene.add_argument("--step", type=integer_from(1), default=2, metavar="PX", help=text)
    scene.add_argument("-o", "--out", required=True, type=Path, metavar="FILE", help=".gltf or .glb")
    scene.set_defaults(run=_run_scene)
    materials = parts.add_parser("materials", help="what an object is made of", description=_MATERIALS)
    add = materials.add_argument
    add("capture", type=Path, metavar="CAPTURE", help="capture whose scene has the object at its place")
    add("--object", required=True, metavar="NAME", help="the object's name in the scene")
    add("-o", "--out", required=True, type=Path, metavar="FILE", help="model.json; other sections stay as they are")
    add_shared(materials, device=True, seed="same seed, same result", json=True, verbose="each material's fields")
    materials.set_defaults(run=_run_materials)


def _run_scene(args: argparse.Namespace) -> None:
    from activestereo.calibrate.height_field import NOTE, height_field, write_height_field
    from activestereo.capture.capture import read_capture
    from activestereo.report.screen import command, screen

    if args.out.suffix not in (".gltf", ".glb"):
        raise CommandError(f"{args.out}: -o is the name of a .gltf or .glb file")
    check_out_file(args.out)
    capture = read_capture(args.capture)
    field = height_field(capture, args.frame, args.step)
    frame = next(f for f in capture.frames if f.depth_path is not None and args.frame in (None, f.id))
    write_height_field(args.out, field, capture, frame.camera_to_world)
    triangles = len(field.mesh.indices.reshape(-1, 3))
    found = f"{triangles} triangles from {field.frames} frames: {100 * field.share:.0f} % of the image is a surface"
    folder = args.out.with_suffix("")
    print(screen(f"{args.out}: {found}.", (), [NOTE], [command("simulate", args.out, "-o", folder)]))


def _run_materials(args: argparse.Namespace) -> None:
    from activestereo.calibrate.materials import calibrate_materials
    from activestereo.common.progress_bar import ProgressBar
    from activestereo.model import read_model
    from activestereo.model.write import replace_sections
    from activestereo.report.screen import command

    check_out_file(args.out)
    with ProgressBar(f"materials of {args.object}") as bar:
        model = read_model(args.out) if args.out.is_file() else None
        found = calibrate_materials(args.capture, args.object, args.seed, args.device, model, bar)
    replace_sections(args.out, found.model())
    folder = args.out.with_suffix("")
    next_step = command("compare", args.capture, "--model", args.out, *carried(args, "seed", "device"), "-o", folder)
    print_section(args, "materials", found.summary(), next_step)
