# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo view`: serves a local page that shows a capture or scene and renders it again as sliders
move."""

from __future__ import annotations

import argparse
import webbrowser
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import read_capture
from activestereo.cli import arguments as cli
from activestereo.cli import import_capture
from activestereo.cli.simulate import read_sensor_model, sensor_config
from activestereo.common.shown import printable
from activestereo.report.screen import command, screen

_TEXT = """\
Serves a page on this machine alone and opens it in the browser: what was measured,
what the simulator gives in its place, and their difference; values, dots and
disparity under the pointer; the point cloud; sliders that render again, a draft at
once and then refined; "save as model.json". PATH is

  a capture's folder   its frames beside the simulator in the capture's scene
  a scene file         a preset's sensor at the scene's cameras, against its own first picture
  a recording          pairs of infrared PNG files, or a bag; with the preset's nominal figures where
                       nothing tells others, and without a scene: measured alone
  a data set           of 'activestereo generate', or what 'simulate' wrote: with the cameras that took it
  a folder of those    a list to choose from

The page is at the printed address, whose token nobody can guess; other machines and
pages of other origins are not answered. Ctrl-C ends it.

examples:
  activestereo view captures/table
  activestereo view table_top.gltf --sensor d415 --resolution 424x240
"""


def add_parser(commands: cli.Commands) -> None:
    text = "look at captures and scenes in the browser, with sliders that render again"
    parser = cli.add_command(commands, "view", text, _TEXT, run)
    parser.add_argument("path", type=Path, metavar="PATH", help="capture, scene file, recording, or a folder of them")
    cli.add_shared(parser, model="a sensor model to begin with: its calibration, noise and effects")
    cli.add_shared(parser, effects=", to be added on the page")
    cli.add_shared(parser, sensor="the sensor in scene files and of recordings, as simulate's")
    text = "of the infrared images in scene files (default: the sensor's own; smaller ones are quicker)"
    parser.add_argument("--resolution", type=cli.size, metavar="WxH", help=text)
    text = "what 'save as model.json' writes, with a number behind the name where it is there (default: model.json)"
    parser.add_argument("-o", "--out", type=Path, default=Path("model.json"), metavar="FILE", help=text)
    parser.add_argument("--port", type=cli.whole, default=0, metavar="N", help="of the address (default: a free one)")
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    cli.add_shared(parser, device=True)


def run(args: argparse.Namespace) -> None:
    with ExitStack() as stack:
        server = stack.enter_context(make_server(args, shown_path(args, stack)))
        print(f"activestereo view of {printable(args.path)}: {server.address}  (Ctrl-C ends it)", flush=True)
        if not args.no_browser:
            webbrowser.open_new_tab(server.address)
        server.serve_forever()


def shown_path(args: argparse.Namespace, stack: ExitStack) -> Path:
    """Returns the path to show. A bag is first imported as a capture into a temporary folder, which closing `stack`
    deletes."""
    from activestereo.capture.importers.bag import is_bag

    if not is_bag(args.path):
        return args.path
    out = Path(stack.enter_context(TemporaryDirectory(prefix="activestereo-view-"))) / args.path.stem
    parser = cli.Parser()
    import_capture.add_parser(parser.add_subparsers())
    options = parser.parse_args(["import", str(args.path), "--out", str(out), "--sensor", args.sensor])
    # The next commands would be of a folder that closing deletes, and the notes name options that view does not take.
    sentence, notes, _ = import_capture.convert(options)
    words = "import", args.path, "--sensor", args.sensor, "-o", f"{args.path.with_suffix('')}_capture"
    keep = command(*words, label="to state what is assumed")
    print(screen(f"{args.path}: {sentence}", (), notes, [keep], verbose=True))
    return out


def make_server(args: argparse.Namespace, path: Path) -> Any:
    """Returns the page's server for `path`. Its address is taken already, but it does not answer requests yet."""
    from activestereo.model.library import library
    from activestereo.report.view.library import Library, is_capture, is_scene, pictures_capture
    from activestereo.report.view.routes import Routes
    from activestereo.report.view.server import ViewServer

    if not 0 <= args.port < 65536:
        raise cli.CommandError(f"--port {args.port}: a port is 0 to 65535")
    if not args.out.absolute().parent.is_dir():
        raise cli.CommandError(f"--out {args.out}: the folder {args.out.parent} does not exist: make it first")
    effects = library(*args.effects)
    model = read_sensor_model(args, effects)
    device = kuafu.Device(args.device)

    def make(path: Path) -> Any:
        from activestereo.report.view.sources import CaptureSource, SceneSource

        if is_capture(path):
            return CaptureSource(read_capture(path), device, model)
        if is_scene(path):
            return SceneSource(path, device, sensor_config(args, model), model)
        return CaptureSource(pictures_capture(path, StereoDepthSensorConfig(args.sensor)), device)

    entries = Library(path, make)
    if entries.names == ["."] and not is_scene(path):
        cli.refuse(args, ("resolution",), "for scene files")
        if is_capture(args.path) and args.sensor != "d435":
            raise cli.CommandError(f"--sensor {args.sensor}: a capture has cameras of its own: leave it out")
        if not is_capture(path):
            cli.refuse(args, ("model",), "for captures and scene files, not where nothing is simulated")
    calls = Routes(entries, effects, args.out).calls()
    try:
        return ViewServer(calls, args.port)
    except OSError as error:
        raise cli.CommandError(f"--port {args.port}: {error.strerror}: leave it out for a free port") from None
