# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo effect list | show | check`: lists physical effects, draws them, and tests their laws."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from activestereo.cli import arguments as cli
from activestereo.common.output_files import write_json, write_text
from activestereo.common.shown import counted, printable
from activestereo.common.text_table import columns
from activestereo.report.lettering import write_figure

if TYPE_CHECKING:
    from activestereo.effects import Effect

_TEXT = """\
Physical effects that the lab can add to its model.

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
Tries five laws on each effect: neutral parameters are the identity; the same seed gives
the same bits; values in range give finite numbers; every parameter has an influence;
the input is left alone. EFFECT is an id of 'effect list', or a file with effects of your
own: Python with the decorator activestereo.effects.effect, or a shared library of
ks/effect.h.

Then a small world is rendered with each effect that has engine fields: how far is what
the lab scores it by from what the sensor does? The figure is the root mean square
difference of both changes of the pictures over the sensor's, at typical values.

The exit status is 0 where all laws hold, else 1.
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "effect", "list physical effects, check your own", _TEXT)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = cli.add_command(actions, "list", "the built-in ones, by stage and family", "", run_list)
    cli.add_shared(listing, json=True)
    check = cli.add_command(actions, "check", "try laws, and compare with the sensor", _CHECK, run_check)
    check.add_argument("effects", nargs="*", metavar="EFFECT|FILE", help="ids, or files of your own effects")
    check.add_argument("--all", action="store_true", help="all built-in effects")
    text = "the differences from the sensor, as JSON"
    check.add_argument("-o", "--out", type=Path, metavar="FILE", help=text)
    cli.add_shared(check, device=True, json=True)
    show = cli.add_command(actions, "show", "draw what an effect does", _SHOW, run_show)
    show.add_argument("effects", nargs="+", metavar="EFFECT|FILE", help="ids, or files of your own effects")
    show.add_argument("-o", "--out", type=Path, required=True, metavar="FILE", help="picture.png, or page.html")
    cli.add_shared(show, device=True, json=True)


def run_list(args: argparse.Namespace) -> None:
    from activestereo.effects import builtin

    if args.json:
        cli.print_json(_as_json(builtin().values()))
    else:
        print(_table(builtin().values()))


def _engine_or_image(e: Effect) -> str:
    return "image only" if e.engine is None else "engine"


def _table(effects: Collection[Effect]) -> str:
    """Returns a text table with one line per effect: id, stage, family, and 'engine' or 'image only'. Its parameters
    and their units follow below each line."""
    rows = [("id", "stage", "family", "simulated")]
    rows += [(e.id, e.stage.name.lower(), e.family, _engine_or_image(e)) for e in effects]
    head, *lines = columns(rows).splitlines()
    for line, e in zip(lines, effects, strict=True):
        said = ", ".join(p.name if p.unit == "1" else f"{p.name} [{p.unit}]" for p in e.parameters)
        head += f"\n{line}" + f"\n{fill(said, 80, initial_indent=4 * ' ', subsequent_indent=4 * ' ')}" * bool(said)
    return head


def _as_json(effects: Collection[Effect]) -> list[dict[str, Any]]:
    """Returns one dict per effect for JSON: id, stage, family, 'engine' or 'image only', and parameters with unit and
    range."""
    return [
        {
            "id": e.id,
            "stage": e.stage.name.lower(),
            "family": e.family,
            "simulated": _engine_or_image(e),
            "parameters": [{"name": p.name, "unit": p.unit, "low": p.low, "high": p.high} for p in e.parameters],
        }
        for e in effects
    ]


def run_show(args: argparse.Namespace) -> None:
    from activestereo.effects.engines import CaptureRenderer
    from activestereo.report.effect_pictures import StripWorld
    from activestereo.report.strips import strip_figure, strip_page

    if args.out.suffix.lower() not in (".png", ".html"):
        raise cli.CommandError(f"--out {args.out}: a picture's name ends in .png, a page's in .html")
    cli.check_out_file(args.out)
    chosen = _chosen(args.effects)
    world = StripWorld(CaptureRenderer(args.device))
    if args.out.suffix.lower() == ".html":
        pages = [world.strengths(effect) for effect in chosen]
        strips = [own[len(own) // 2] for own in pages]
        write_text(args.out, strip_page(pages))
    else:
        strips = [world.strip(effect) for effect in chosen]
        write_figure(args.out, strip_figure(strips))
    if args.json:
        names = "rms", "unit", "filled", "lost"
        rows = {s.effect.id: (s.rms(), s.unit, *s.filled_and_lost()) for s in strips}
        cli.print_json({name: dict(zip(names, row, strict=True)) for name, row in rows.items()})
        return
    for s in strips:
        told = zip(s.filled_and_lost(), ("filled", "lost"), strict=True)
        holes = "".join(f"; {counted(number, 'pixel')} {what}" for number, what in told if number)
        print(f"{s.effect.id}: changes the picture by {s.rms():.3g} {s.unit} (root mean square){holes}")
    print(f"see: {printable(args.out)}")


def run_check(args: argparse.Namespace) -> None:
    from activestereo.compare.effect_trials import differences
    from activestereo.effects import broken_laws, builtin

    if args.all == bool(args.effects):
        raise cli.CommandError("name effects or files to check, or say --all")
    if args.out:
        cli.check_out_file(args.out)
    chosen = list(builtin().values()) if args.all else _chosen(args.effects)
    broken_of = {e.id: [sentence.removeprefix(f"{e.id}: ") for sentence in broken_laws(e)] for e in chosen}
    off = {} if any(broken_of.values()) else {name: round(far, 4) for name, far in differences(chosen, args.device)}
    if args.json:
        rows = _as_json({e.id: e for e in chosen}.values())
        cli.print_json([row | {"broken": broken_of[row["id"]], "difference": off.get(row["id"])} for row in rows])
    for e in () if args.json else chosen:
        place = "takes the place of the built-in one, " * (e.id in builtin() and e is not builtin()[e.id])
        parameters = ", ".join(f"{p.name} [{p.unit}] {p.low:g}..{p.high:g}" for p in e.parameters)
        far = f", {100 * off[e.id]:.1f} % from the sensor" if e.id in off else ""
        told = "; ".join(f"broken: {sentence}" for sentence in broken_of[e.id]) or f"ok: all laws hold{far}"
        about = f"{e.id}: {e.stage.name.lower()} stage, family '{e.family}', {parameters or 'no parameters'}\n  "
        print(f"{e.id:24}{told}" if args.all else f"{about}{place}{told}")
    if args.out:
        write_json(args.out, off)
    if lawless := sum(map(bool, broken_of.values())):
        said = f"{counted(lawless, 'effect')} with broken laws"
        raise cli.Finding(said if args.all else f"{', '.join(args.effects)}: {said}")


def _chosen(names: Sequence[str]) -> list[Effect]:
    """Returns the effects that `names` selects: ids of built-in effects, or files with the user's own."""
    from activestereo.effects import load_effects
    from activestereo.model.library import find, library

    known = library()
    chosen: list[Effect] = []
    for name in names:
        chosen += load_effects(Path(name)).values() if Path(name).suffix else [find(known, printable(name))]
    return chosen
