# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo resense`: renders a simulator's stored demonstrations again with a depth sensor."""

import argparse
from pathlib import Path

from activestereo.cli.arguments import CommandError, Commands, add_shared, integer_from, make_folder, size
from activestereo.common.shown import printable

_TEXT = """\
Replays the states of stored demonstrations in MuJoCo (robosuite's, LIBERO's and robomimic's
.hdf5) and writes what a depth sensor on one of the model's cameras sees: DIR/NAME/depth,
depth_true, ir_left, ir_right and cause, by number of the state. Needs mujoco and h5py.

examples:
  activestereo resense demo.hdf5 --camera agentview --every 10 -o out/resensed
"""


def add_parser(commands: Commands) -> None:
    parser = commands.add_parser("resense", help="stored demonstrations seen by a depth sensor", description=_TEXT)
    parser.add_argument("demos", type=Path, metavar="DEMOS", help=".hdf5 of demonstrations")
    parser.add_argument("--camera", metavar="NAME", help="of the model (default: its first)")
    text = "every N-th state only (default: 1)"
    parser.add_argument("--every", type=integer_from(1), default=1, metavar="N", help=text)
    add_shared(parser, sensor="as simulate's")
    parser.add_argument("--size", type=size, metavar="WxH", help="of all images (default: the sensor's own)")
    add_shared(parser, out=True, device=True, samples={"default": 16, "help": "rays per pixel (default: 16)"})
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    from activestereo.camera.presets import StereoDepthSensorConfig
    from activestereo.common.progress_bar import ProgressBar

    try:
        from activestereo.integrations.mujoco.resense import packages, read_demos, resense

        packages()
    except ImportError as error:
        raise CommandError(f"the package {error.name} is missing: pip install mujoco h5py") from error
    config = StereoDepthSensorConfig(args.sensor)
    if args.size is not None:
        config = config.resized(*args.size)
    config.samples_per_pixel = args.spp
    make_folder(args.out)
    count = 0
    for demo in read_demos(args.demos):
        with ProgressBar(demo.name) as bar:
            count += resense(demo, config, args.out / demo.name, args.camera, args.every, args.device, bar)
    print(f"{count} states; written: {printable(args.out)}")
