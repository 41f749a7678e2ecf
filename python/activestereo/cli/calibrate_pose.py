# SPDX-License-Identifier: Apache-2.0
"""activestereo calibrate pose: where parts stand in a capture's scene."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from activestereo.cli.arguments import CommandError, add_shared, check_out_file, numbers, positive, print_json

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from activestereo.calibrate.object_pose import PartPose

TEXT = """\
Where a part with a CAD file stands, from a capture of several poses of the camera,
without markers: silhouettes and edges in the colour images and in the infrared images
with the projector off, in all views together. Measured depth is not used, for on
glossy and clear parts it is wrong by centimetres.

CAD is .stl, .obj or .ply. The start, within about 2 cm and 5 degrees, is the node of
that name in the capture's scene, or --start. Writes the scene with the part in it, and
with a camera at the first frame's place if it has none, to FILE (.gltf), and the poses
with their 90 % intervals beside it (.poses.json). Axes about which a part is symmetric
are reported free.

examples:
  activestereo calibrate pose captures/desk --object bracket=bracket.stl --unit 0.001 \\
      --start bracket=0.1,0,0.4,0,0,0,1 -o desk.gltf
  activestereo overlay captures/desk --scene desk.gltf --out out/overlay
"""


def add_part(parts: argparse._SubParsersAction) -> None:
    """The parser of calibrate's part."""
    parser = parts.add_parser("pose", help="where CAD parts stand, from edges in all views", description=TEXT)
    add = parser.add_argument
    add("capture", type=Path, metavar="CAPTURE", help="capture whose poses of the camera are known")
    add("--object", action="append", required=True, metavar="NAME=CAD", help="a part and its file; may be repeated")
    add("--start", action="append", default=[], metavar="NAME=x,y,z,qx,qy,qz,qw", help="its pose to begin with, world")
    add("--unit", type=positive, default=1.0, metavar="M", help="metres per unit of the CAD files (default: 1)")
    add("-o", "--out", required=True, type=Path, metavar="FILE", help="the scene with the parts, .gltf")
    add_shared(parser, seed="same seed, same result", json=True, verbose="each part's place")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    from activestereo.calibrate.gltf_place import node_pose, write_placed
    from activestereo.calibrate.object_pose import refine_pose
    from activestereo.calibrate.object_views import object_views
    from activestereo.capture.capture import read_capture
    from activestereo.common.output_files import replace_file
    from activestereo.common.progress_bar import ProgressBar
    from activestereo.report.screen import command, screen
    from activestereo.scene_io.parts import read_mesh

    if args.out.suffix != ".gltf":
        raise CommandError(f"{args.out}: -o is the name of a .gltf file")
    check_out_file(args.out)
    if args.unit <= 0:
        raise CommandError("--unit is 0, expected metres per unit above 0")
    capture = read_capture(args.capture)
    meshes = {name: read_mesh(Path(file), args.unit) for name, file in _named(args.object, "--object NAME=CAD").items()}
    given = {name: _pose(text) for name, text in _named(args.start, "--start NAME=x,y,z,qx,qy,qz,qw").items()}
    for name in given:
        if name not in meshes:
            raise CommandError(f"--start {name}: there is no --object of that name, only {', '.join(meshes)}")
    starts: dict[str, NDArray[np.float64]] = {}
    for name in meshes:
        start = given.get(name)
        start = node_pose(capture.scene_path, name) if start is None else start
        if start is None:
            raise CommandError(f"{capture.scene_path}: has no node '{name}': give --start {name}=x,y,z,qx,qy,qz,qw")
        starts[name] = start
    views = object_views(capture)
    found: dict[str, PartPose] = {}
    for name, mesh in meshes.items():
        with ProgressBar(f"placing {name}") as bar:
            found[name] = refine_pose(mesh, views, starts[name], args.seed, bar)
    scene = capture.scene_path
    for name, mesh in meshes.items():
        view = capture.rig.left, capture.frames[0].camera_to_world
        write_placed(scene, args.out, name, mesh, found[name].part_to_world, view)
        scene = args.out
    entries = {name: _as_json(pose) for name, pose in found.items()}
    beside = args.out.with_suffix(".poses.json")
    replace_file(beside, lambda file: file.write((json.dumps(entries, indent=1) + "\n").encode()))
    if args.json:
        print_json(entries)
        return
    views = max(pose.views for pose in found.values())
    sentence = f"{', '.join(found)} placed from {views} views, in {args.out} and {beside.name}."
    next_step = command("overlay", args.capture, "--scene", args.out, "--out", args.out.with_suffix(""))
    print(screen(sentence, (), [_words(name, pose) for name, pose in found.items()], [next_step], verbose=args.verbose))


def _named(texts: list[str], form: str) -> dict[str, str]:
    out: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise CommandError(f"'{text}' is not {form}")
        out[name] = value
    return out


def _pose(text: str) -> NDArray[np.float64]:
    import numpy as np
    from scipy.spatial.transform import Rotation

    try:
        values = numbers(text, (7,), "--start")
    except argparse.ArgumentTypeError as error:
        raise CommandError(str(error)) from error
    if abs(np.linalg.norm(values[3:]) - 1.0) > 0.01:
        raise CommandError(f"--start: the quaternion's length is {np.linalg.norm(values[3:]):.3f}, expected 1")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat(values[3:]).as_matrix(), values[:3]
    return pose


def _as_json(pose: PartPose) -> dict[str, Any]:
    return {
        "part_to_world": pose.part_to_world.ravel().tolist(),
        "error_m": pose.error_m,
        "error_deg": pose.error_deg,
        "free_axes": [axis.tolist() for axis in pose.free_axes],
        "residual_px": pose.residual_px,
        "matched": pose.matched,
        "views": pose.views,
    }


def _words(name: str, pose: PartPose) -> str:
    x, y, z = pose.part_to_world[:3, 3]
    axes = "".join(f"; free to turn about ({a[0]:.2f}, {a[1]:.2f}, {a[2]:.2f})" for a in pose.free_axes)
    return (
        f"{name}: at {x:.4f}, {y:.4f}, {z:.4f} m ± {1e3 * pose.error_m:.2f} mm ± {pose.error_deg:.2f} deg (90 %)"
        f"{axes}; {100 * pose.matched:.0f} % of its contours have an edge, {pose.residual_px:.2f} px away, in "
        f"{pose.views} views"
    )
