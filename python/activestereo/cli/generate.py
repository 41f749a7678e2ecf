# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo generate`, which renders a data set of depth pictures of objects on a table."""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.cli import arguments as cli
from activestereo.common.accuracy import INVENTED
from activestereo.common.progress_bar import ProgressBar, duration
from activestereo.common.shown import counted
from activestereo.report.screen import command, screen
from activestereo.scene_io import OWN_ENDINGS

FORMATS = ("lerobot", "mcap")

_TEXT = f"""\
Puts things on a table again and again, each time with other poses, lamps and another
view, and takes pictures with a depth sensor. THING is a file of one thing:
{' '.join(OWN_ENDINGS)}; .gltf and .glb have y up, the others z.

Writes the BOP format into DIR (train_pbr/000000/rgb, depth, mask, mask_visib,
scene_camera.json, scene_gt.json, scene_gt_info.json), and beside it
ir_left, ir_right, depth_true, and the left infrared camera's confidence and reasons why a
pixel has no depth; ir_cameras.json has both cameras' matrices, their baseline and the
reasons' names. depth is what the sensor measures, in the RGB camera.

Frame N depends on the options, the seed and N alone. A run that was ended, however it
was, goes on when it is started again; with a larger --count it makes more.

--ranges FILE is a .toml file with some of these, each a pair of low and high:
  things spread_m distance_m elevation_deg roll_deg lamps lamp_w_per_sr
  ambient_radiance table_albedo table_roughness

examples:
  activestereo generate cup.glb box.obj can.ply --count 100 --workers 2 --out out/cups
  activestereo generate cup.glb box.obj --count 5000 --part 3/50 --out shared/cups
  activestereo generate cup.glb box.obj --count 5000 --ray auto --out out/cups
  activestereo generate *.glb --count 1000 --layout drop --sensor d415 --out out/dropped
"""


def add_parser(commands: cli.Commands) -> None:
    text = "make a data set of things on a table, with poses and masks"
    parser = cli.add_command(commands, "generate", text, _TEXT, run)
    parser.add_argument("things", type=Path, nargs="+", metavar="THING", help="file of one thing")
    cli.add_shared(parser, unit="the file of a THING", keep_transparent=True)
    cli.add_shared(parser, out=True, device=True, verbose="all things that no frame shows")
    rare = parser.rare_group("many machines, formats and ranges")
    parser.add_argument("--count", type=cli.integer_from(1), default=100, metavar="N", help="frames (default: 100)")
    text = "processes, each with a device of its own (default: 1; a device that is a processor is busy with one or two)"
    parser.add_argument("--workers", type=cli.integer_from(1), metavar="K", help=text)
    text = "makes part K of N, for N machines that share DIR; whoever makes the last frame writes the tables"
    rare.add_argument("--part", type=_part, default=(1, 1), metavar="K/N", help=text)
    text = "has the workers of a Ray cluster make the frames (auto, HOST:PORT, ray://HOST:PORT): one for each GPU"
    rare.add_argument("--ray", metavar="ADDRESS", help=text)
    text = "with --ray: processors of a worker, where the cluster has no GPUs or --device is given (default: 2)"
    rare.add_argument("--ray-cpus", type=cli.integer_from(1), metavar="N", help=text)
    cli.add_shared(parser, seed="of everything that is drawn; same seed, same files")
    cli.add_shared(parser, sensor="as simulate's")
    text = "of the colour image and of depth (default: 640x480)"
    parser.add_argument("--rgb-size", type=cli.size, default=(640, 480), metavar="WxH", help=text)
    text = "of the infrared images, with the same horizontal field of view (default: the sensor's own)"
    parser.add_argument("--ir-size", type=cli.size, metavar="WxH", help=text)
    text = "samples per pixel (default: 16)"
    parser.add_argument("--spp", "--samples-per-pixel", type=cli.integer_from(1), default=16, metavar="N", help=text)
    text = f"also in these formats, once all frames are there: comma-separated, of {', '.join(FORMATS)}"
    rare.add_argument("--also", type=cli.names_of("format", FORMATS), default=[], metavar="NAMES", help=text)
    text = "things upright side by side, or dropped with MuJoCo's physics (default: scatter)"
    parser.add_argument("--layout", choices=("scatter", "drop"), default="scatter", help=text)
    rare.add_argument("--ranges", type=Path, metavar="FILE", help="what is drawn from which ranges")


def _part(text: str) -> tuple[int, int]:
    """Parses K/N into (K, N), the K-th of N parts of a data set."""
    number, slash, parts = text.partition("/")
    if not (slash and number.isdecimal() and parts.isdecimal() and 1 <= int(number) <= int(parts)):
        raise argparse.ArgumentTypeError(f"a part is K/N, from 1/N to N/N, not '{text}'")
    return int(number), int(parts)


def run(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.generate.formats import require_formats, write_formats
    from activestereo.benchmarks.generate.run import generate
    from activestereo.benchmarks.generate.studio import Ranges, Settings

    if args.ray is None and args.ray_cpus is not None:
        raise cli.CommandError("--ray-cpus goes with --ray, which is not given")
    if args.ray is not None and args.workers is not None:
        raise cli.CommandError("--workers does not go with --ray, whose workers take their place: --ray-cpus")
    try:
        require_formats(args.also)
    except ImportError as error:
        raise cli.CommandError(f"--also: {error}") from error
    for path in args.things:
        if not path.exists():
            raise cli.CommandError(f"{path}: there is no such file")
    settings = Settings(
        things=tuple(args.things), sensor=args.sensor, rgb_size=args.rgb_size, ir_size=args.ir_size, samples=args.spp,
        seed=args.seed, layout=args.layout, ranges=Ranges.read(args.ranges), unit_m=args.unit,
        keep_transparent=args.keep_transparent, device=args.device,
    )  # fmt: skip
    cli.make_folder(args.out)
    workers = args.workers or 1
    ray = None if args.ray is None else (args.ray, args.ray_cpus or 2)
    by = counted(workers, "worker") if ray is None else f"Ray at {args.ray}"
    with ProgressBar(f"{counted(args.count, 'frame')} with {by}") as bar:
        done = generate(settings, args.out, args.count, workers, args.part, bar, ray)
    per_s = done.made / max(done.seconds, 1e-9)
    rate = f"{counted(done.made, 'frame')} in {duration(done.seconds)}, {per_s:.2f} a second"
    notes = [rate if done.made else "nothing was left to do"]
    notes += [f"{done.there} were there already"] if done.there else []
    if not done.missing:
        measured, invented = 100.0 * done.measured, 100.0 * done.invented
        notes += [f"{measured:.1f} % of what is there is measured; {invented:.1f} % of the depths are {INVENTED}"]
    unseen = [f"no frame shows {path}: it is transparent, hidden, or smaller than a pixel" for path in done.unseen]
    notes += [f"{done.missing} of other parts are not there yet"] if done.missing else []
    if args.also and not done.missing:
        write_formats(args.out, args.count, args.also)
        notes += [f"also {', '.join(args.also)}"]
    steps = [command("view", args.out, *cli.carried(args, "device"))]
    print(screen(f"{'; '.join(notes)}, in {args.out}.", (), unseen, steps, verbose=args.verbose))
