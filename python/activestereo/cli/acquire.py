"""activestereo acquire noise | pattern: frames of a real camera become sections of model.json."""

import argparse
from pathlib import Path

from activestereo.cli.arguments import CommandError, add_seed

_TEXT = """\
Measures a real camera. Each part replaces its own section of model.json, and
leaves the others as they are; the file is written at the end, whole.

  noise    repeats of static views  -> imager
  pattern  frames of a flat wall    -> pattern

activestereo acquire noise --help tells more.
"""

_NOISE = """\
The imager's temporal noise from repeats. Two laws are fitted, the paper's gamma
factor with Gaussian noise, and shot noise with read noise; the one that gives
pixels it was not fitted to the higher density is chosen.

FRAMES is a folder of PNG files of one static view (10 or more), a folder of such
folders, a .npy stack uint8 or uint16 [frame][height][width], or a capture with
repeat groups. Groups of several exposures give a photon transfer table and the
black level. Bright and dark regions in one view are best: k shows where it is
bright, sigma and black where it is dark. --dark: frames with the lens covered;
shot noise alone cannot tell black from read noise.

Static speckle is the same in every repeat: it never shows in repeats.

examples:
  activestereo acquire noise wall/ --dark covered/ -o model.json
  activestereo acquire noise stack.npy --paper -o model.json
"""

_PATTERN = """\
The projector's dots, each with direction and power, from frames of a flat, matt
wall, and the projector's place.

WALL_FRAMES is a capture: 10 or more repeats of the wall in one repeat group per
distance, both eyes, rectified, projector on, no dot clipped. Two distances, the
second 1.5 times as far or more, tell where the projector stands; with one its
nominal place is kept. The rig's K, its baseline and the projector's K are
believed: acquire rig measures the first two.

example:
  activestereo acquire pattern walls/ -o model.json
"""


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "acquire", help="measure a real camera: frames become sections of model.json", description=_TEXT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parts = parser.add_subparsers(dest="part", metavar="PART", required=True)
    noise = _part(parts, "noise", "the imager's temporal noise from repeats", _NOISE)
    noise.add_argument("frames", type=Path, metavar="FRAMES", help="repeats of static views")
    noise.add_argument("--dark", type=Path, metavar="FRAMES", help="repeats without light")
    noise.add_argument("--paper", action="store_true", help="print the paper's literal fit, too: clean image = average, theta and mu free")
    noise.set_defaults(run=_run_noise)
    pattern = _part(parts, "pattern", "the projector's dots from frames of a flat wall", _PATTERN)
    pattern.add_argument("frames", type=Path, metavar="WALL_FRAMES", help="capture whose repeat groups look at a wall")
    pattern.set_defaults(run=_run_pattern)


def _part(parts: argparse._SubParsersAction, name: str, summary: str, text: str) -> argparse.ArgumentParser:
    parser = parts.add_parser(name, help=summary, description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--out", required=True, type=Path, metavar="FILE", help="model.json; made if it is not there, else one section is replaced")
    add_seed(parser, "same seed, same result")
    return parser


def _check_out(path: Path) -> None:
    """Fails before the long work, not after it."""
    if path.is_dir():
        raise CommandError(f"{path} is a folder: give the name of a file, such as {path / 'model.json'}")
    if not path.absolute().parent.is_dir():
        raise CommandError(f"the folder {path.parent} does not exist: make it first")


def _run_noise(args: argparse.Namespace) -> None:
    from activestereo.acquire.model_section import replace_section
    from activestereo.acquire.noise import acquire_noise
    from activestereo.progress_bar import ProgressBar

    _check_out(args.out)
    with ProgressBar("fitting noise") as bar:
        noise = acquire_noise(args.frames, args.dark, args.paper, args.seed, bar)
    replace_section(args.out, "imager", noise.section())
    print(noise.text())
    print(f"written: imager in {args.out}")


def _run_pattern(args: argparse.Namespace) -> None:
    from activestereo.acquire.model_section import replace_section
    from activestereo.acquire.pattern import acquire_pattern
    from activestereo.progress_bar import ProgressBar

    _check_out(args.out)
    with ProgressBar("finding dots") as bar:
        pattern = acquire_pattern(args.frames, bar)
    replace_section(args.out, "pattern", pattern.section())
    print(pattern.text())
    print(f"written: pattern in {args.out}")
