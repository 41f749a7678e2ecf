"""activestereo effect list | check: the catalogue of physical effects, and the laws tried on a user's own."""

import argparse
from pathlib import Path

_TEXT = """\
Physical effects that the lab can add to its model.

  list   the built-in effects: id, stage on the light's way, family, parameters
  check  loads effects of your own from a Python file or a shared library and tries
         the laws that every effect obeys

example:
  activestereo effect check my_effects.py
"""
_CHECK = """\
Loads the effects of FILE, a Python file with the decorator activestereo.effects.effect
or a shared library of ks/effect.h, and tries five laws on each: neutral parameters are
the identity; the same seed gives the same bits; values in range give finite numbers;
every parameter has an influence; the input is left alone.

The exit status is 0 where all hold, else 2.
"""


def add_parser(commands):
    raw = argparse.RawDescriptionHelpFormatter
    parser = commands.add_parser("effect", help="list physical effects, check your own", description=_TEXT, formatter_class=raw)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = actions.add_parser("list", help="the built-in effects", formatter_class=raw)
    listing.add_argument("--markdown", action="store_true", help="the whole documentation page, examples/effects/README.md")
    listing.set_defaults(run=run_list)
    check = actions.add_parser("check", help="try the laws on effects of your own", description=_CHECK, formatter_class=raw)
    check.add_argument("file", type=Path, metavar="FILE", help="Python file or shared library")
    check.set_defaults(run=run_check)


def run_list(args):
    from activestereo.effects import builtin
    from activestereo.effects.core.catalogue import page, table

    print(page(builtin()) if args.markdown else table(builtin()), end="" if args.markdown else "\n")


def run_check(args):
    from activestereo.cli.arguments import CommandError
    from activestereo.effects import broken_laws, builtin, load_effects

    known, lawless = builtin(), 0
    for e in load_effects(args.file).values():
        parameters = ", ".join(f"{p.name} [{p.unit}] {p.low:g}..{p.high:g}" for p in e.parameters)
        print(f"{e.id}: {e.stage.name.lower()} stage, family '{e.family}', {parameters or 'no parameters'}")
        if e.id in known:
            print("  takes the place of the built-in effect of this id")
        broken = broken_laws(e)
        lawless += bool(broken)
        for sentence in broken:
            print(f"  broken: {sentence.removeprefix(f'{e.id}: ')}")
        if not broken:
            print("  ok: all laws hold")
    if lawless:
        raise CommandError(f"{args.file}: {lawless} effect{'s' if lawless > 1 else ''} with broken laws")
