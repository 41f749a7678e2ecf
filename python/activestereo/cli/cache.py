# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo cache list | clear`: lists or deletes the results that compare and diagnose keep on disk."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING

from activestereo.cli.arguments import Commands, add_shared, print_json

if TYPE_CHECKING:
    from activestereo.compare.cache import CacheEntry

_TEXT = """\
Renders and fits are kept on disk, so that a second look at a capture traces no ray and
repeats no fit. Entries that were not used for longest go when the folder grows over 2 GB.

  list    how much there is, of what, and when it was last used
  clear   removes all of it; the next compare or diagnose makes it again

The variable ACTIVESTEREO_CACHE names another folder, ACTIVESTEREO_CACHE_GB another limit.

examples:
  activestereo cache list
  ACTIVESTEREO_CACHE_GB=0.5 activestereo diagnose captures/table --out out/diagnosis
"""


def add_parser(commands: Commands) -> None:
    text = "list or clear the renders and fits that are kept on disk"
    parser = commands.add_parser("cache", help=text, description=_TEXT)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = actions.add_parser("list", help="how much there is, of what")
    add_shared(listing, json=True)
    listing.set_defaults(run=run_list)
    actions.add_parser("clear", help="remove all of it").set_defaults(run=run_clear)


def run_list(args: argparse.Namespace) -> None:
    from activestereo.compare.cache import LayerCache

    cache = LayerCache()
    entries = cache.entries()
    if args.json:
        files = [
            {"file": e.path.name, "kind": e.kind(), "size_bytes": e.size_bytes, "used_s": e.used_s} for e in entries
        ]
        used = sum(entry.size_bytes for entry in entries)
        where = {"folder": str(cache.folder), "limit_bytes": cache.limit_bytes}
        print_json(where | {"used_bytes": used, "entries": files})
        return
    by_kind: dict[str, list[CacheEntry]] = {}
    for entry in entries:
        by_kind.setdefault(entry.kind(), []).append(entry)
    if by_kind:
        print(f"{'what':10}{'entries':>9}{'size':>12}   last used")
    for kind, own in sorted(by_kind.items()):
        last, first = (time.strftime("%Y-%m-%d", time.localtime(own[i].used_s)) for i in (0, -1))
        print(f"{kind:10}{len(own):>9}{_megabytes(own):>9.1f} MB   {first} to {last}")
    print(cache.usage_text())


def run_clear(args: argparse.Namespace) -> None:
    from activestereo.compare.cache import LayerCache

    cache = LayerCache()
    gone = cache.clear()
    print(f"removed: {len(gone)} entries, {_megabytes(gone):.1f} MB, from {cache.folder}")


def _megabytes(entries: list[CacheEntry]) -> float:
    return sum(entry.size_bytes for entry in entries) / 1e6
