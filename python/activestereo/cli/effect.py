# SPDX-License-Identifier: Apache-2.0
"""activestereo effect list | check: the catalogue of physical effects, and the laws tried on a user's own."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from activestereo.cli.arguments import add_shared, check_out_file, print_json
from activestereo.common.shown import printable

if TYPE_CHECKING:
    from activestereo.effects import Effect

_TEXT = """\
Physical effects that the lab can add to its model.

  list     the built-in effects: id, stage in the pipeline, family, whether the
           engines have it, parameters
  show     draws what an effect does to a picture: without, at typical values, difference
  check    loads effects of your own from a Python file or a shared library and tries
           the laws that every effect obeys

example:
  activestereo effect check my_effects.py
  activestereo effect show projector_defocus -o defocus.html
"""
_SHOW = """\
Draws a strip of each effect: one picture of a small world without it, with it at typical
values, and the difference; on a page, under a slider of its strength. Random effects are
drawn once. EFFECT is an id of 'effect list', or a file with effects of your own, which
are all drawn.
"""
_CHECK = """\
Loads the effects of FILE, a Python file with the decorator activestereo.effects.effect
or a shared library of ks/effect.h, and tries five laws on each: neutral parameters are
the identity; the same seed gives the same bits; values in range give finite numbers;
every parameter has an influence; the input is left alone.

The exit status is 0 where all hold, else 1.
"""
_MEASURE = """\
Renders a small world with each effect inside of the engines, and with its image function,
at typical values. Prints the root mean square difference of the two changes over the
engines' change; of random fields, that of their standard deviations.
"""


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser("effect", help="list physical effects, check your own", description=_TEXT)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = actions.add_parser("list", help="the built-in effects")
    listing.add_argument(
        "--markdown", action="store_true", help="the whole documentation page, examples/effects/README.md"
    )
    add_shared(listing, json=True)
    listing.set_defaults(run=run_list)
    check = actions.add_parser("check", help="try the laws on effects of your own", description=_CHECK)
    check.add_argument("file", type=Path, metavar="FILE", help="Python file or shared library")
    add_shared(check, json=True)
    check.set_defaults(run=run_check)
    show = actions.add_parser("show", help="draw what an effect does", description=_SHOW)
    show.add_argument("effects", nargs="+", metavar="EFFECT|FILE", help="ids, or files of your own effects")
    show.add_argument("-o", "--out", type=Path, required=True, metavar="FILE", help="picture.png, or page.html")
    add_shared(show, device=True, json=True)
    show.set_defaults(run=run_show)
    measure = actions.add_parser("measure", help="image functions against the engines", description=_MEASURE)
    measure.add_argument("effects", nargs="*", metavar="EFFECT", help="ids (default: all built-in ones)")
    add_shared(measure, effects={"dest": "files"})
    measure.add_argument(
        "-o",
        "--out",
        type=Path,
        metavar="FILE",
        help="figures as JSON; python/activestereo/effects/differences.json is the page's",
    )
    add_shared(measure, device=True, json=True)
    measure.set_defaults(run=run_measure)


def run_list(args: argparse.Namespace) -> None:
    from activestereo.effects import builtin
    from activestereo.effects.core.catalogue import as_json, page, table
    from activestereo.effects.core.differences import known_differences

    if args.json:
        print_json(as_json(builtin()))
        return
    print(
        page(builtin(), known_differences()) if args.markdown else table(builtin()), end="" if args.markdown else "\n"
    )


def run_measure(args: argparse.Namespace) -> None:
    import json

    from activestereo.common.output_files import replace_file
    from activestereo.compare.model_file import find, library
    from activestereo.compare.surrogate import differences

    effects = library(*args.files)
    chosen = [find(effects, name) for name in args.effects] or list(effects.values())
    found = {}
    for name, difference in differences(chosen, args.device):
        found[name] = round(difference, 4)
        if not args.json:
            print(f"{name:28}{100 * difference:7.1f} %", flush=True)
    if args.json:
        print_json(found)
    if args.out:
        text = json.dumps(found, indent=1) + "\n"
        replace_file(args.out, lambda file: file.write(text.encode()))


def run_show(args: argparse.Namespace) -> None:
    from activestereo.common.output_files import write_text
    from activestereo.compare.effect_strip import StripWorld
    from activestereo.compare.kuafu_renderer import KuafuRenderer
    from activestereo.compare.model_file import find, library
    from activestereo.effects import load_effects
    from activestereo.report.lettering import write_figure
    from activestereo.report.strip_figure import strip_figure
    from activestereo.report.strip_page import strip_page

    check_out_file(args.out)
    known = library()
    chosen: list[Effect] = []
    for name in args.effects:
        chosen += load_effects(Path(name)).values() if Path(name).suffix else [find(known, name)]
    world = StripWorld(KuafuRenderer(args.device))
    if args.out.suffix.lower() == ".html":
        pages = [world.strengths(effect) for effect in chosen]
        strips = [own[len(own) // 2] for own in pages]
        write_text(args.out, strip_page(pages))
    else:
        strips = [world.strip(effect) for effect in chosen]
        write_figure(args.out, strip_figure(strips))
    changes = {s.effect.id: {"rms": float(np.sqrt(np.mean(s.difference**2))), "unit": s.unit} for s in strips}
    if args.json:
        print_json(changes)
        return
    for name, change in changes.items():
        print(f"{name}: changes the picture by {change['rms']:.3g} {change['unit']} (root mean square)")
    print(f"written: {printable(args.out)}")


def run_check(args: argparse.Namespace) -> None:
    from activestereo.cli.arguments import Finding
    from activestereo.effects import broken_laws, builtin, load_effects
    from activestereo.effects.core.catalogue import as_json

    known, own = builtin(), load_effects(args.file)
    broken_of = {e.id: [sentence.removeprefix(f"{e.id}: ") for sentence in broken_laws(e)] for e in own.values()}
    if args.json:
        print_json([row | {"broken": broken_of[row["id"]]} for row in as_json(own)])
    for e in () if args.json else own.values():
        parameters = ", ".join(f"{p.name} [{p.unit}] {p.low:g}..{p.high:g}" for p in e.parameters)
        print(f"{e.id}: {e.stage.name.lower()} stage, family '{e.family}', {parameters or 'no parameters'}")
        if e.id in known:
            print("  takes the place of the built-in effect of this id")
        for sentence in broken_of[e.id]:
            print(f"  broken: {sentence}")
        if not broken_of[e.id]:
            print("  ok: all laws hold")
    if lawless := sum(map(bool, broken_of.values())):
        raise Finding(f"{args.file}: {lawless} effect{'s' if lawless > 1 else ''} with broken laws")
