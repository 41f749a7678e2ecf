"""activestereo compare: the simulator against a measured capture."""

import argparse
from pathlib import Path

from activestereo.cli.arguments import add_device, add_max_bounces, add_out, add_seed, integer_from, make_folder

_TEXT = """\
Compares the simulator with a capture: renders the scene from the capture's poses, fits
projector scale, ambient scale and black level on the train frames, and gives the root
mean square error of the infrared images and of depth, train and test, beside the noise
floor that repeated frames show. It looks on the train frames where the model fails.

Writes into DIR:
  compare.json  all figures (documented in lab/schema/compare.schema.json)
  compare.png   measured, simulated and residual images, error of each frame
  report.html   the same on one page, to explore in a browser: every frame and eye,
                measured and modelled; it needs no other file and no network. A
                diagnose.json in DIR is shown too, with what each effect leaves

CAPTURE is a folder with capture.json, the scene, the projector's pattern and the images
of both infrared cameras.

examples:
  activestereo compare captures/table --out out/compare
  activestereo compare captures/table --model out/diagnosis/model.json --out out/again
"""


def add_parser(commands):
    parser = commands.add_parser(
        "compare",
        help="compare the simulator with a measured capture",
        description=_TEXT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("capture", type=Path, metavar="CAPTURE", help="the capture's folder")
    add_out(parser)
    parser.add_argument("--model", type=Path, metavar="FILE", help="model.json: effects on top of the base renderer (default: none)")
    text = "your own effects, where the model has some"
    parser.add_argument("--effects", type=Path, action="append", default=[], metavar="FILE", help=text)
    parser.add_argument("--spp", type=integer_from(1), default=64, metavar="N", help="samples per pixel (default: 64)")
    add_max_bounces(parser)
    add_seed(parser, "same seed, same pictures")
    add_device(parser)
    parser.set_defaults(run=run)


def run(args):
    from activestereo.lab.compare import compare
    from activestereo.lab.kuafu_renderer import KuafuRenderer
    from activestereo.lab.model_file import library, read_model
    from activestereo.lab.report import summary_table, write_report
    from activestereo.progress_bar import ProgressBar

    make_folder(args.out)
    effects = library(*args.effects)
    model = read_model(args.model, effects)
    with ProgressBar(f"comparing {args.capture.name}") as bar:
        comparison = compare(
            args.capture,
            model=model,
            renderer=KuafuRenderer(args.device),
            samples_per_pixel=args.spp,
            max_bounces=args.max_bounces,
            seed=args.seed,
            progress=bar,
            is_fine=(args.out / "diagnose.json").is_file(),
        )
    with ProgressBar("writing the report") as bar:
        write_report(comparison, args.out, effects=effects, progress=bar)
    print(summary_table(comparison.scores))
    print(f"written: compare.json, compare.png, report.html in {args.out}")
