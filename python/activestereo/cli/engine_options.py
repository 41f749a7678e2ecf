# SPDX-License-Identifier: Apache-2.0
"""Adds command-line options for the engines, one for each parameter of the generated tables."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from activestereo.cli.arguments import real, size, whole
from activestereo.cli.parser import rare_group
from activestereo.common.parameter import MATCHER, RIG, Parameter


def add_options(
    group: argparse._ArgumentGroup, table: Sequence[Parameter], defaults: Mapping[str, Any] | None = None
) -> None:
    """Adds one option for each parameter of `table`; an option that is not given is None. defaults: the command's own
    default values by name, or words that describe them."""
    for p in table:
        if not p.on_command_line:
            continue
        default = (defaults or {}).get(p.name, p.default)
        if p.pair:
            usual = default if isinstance(default, str) else f"{default}x{default}"
            text = f"{p.pair}-width and -height at once (default: {usual})"
            group.add_argument(f"--{p.pair}", type=size, metavar="WxH", help=text)
        names = [p.option] + ([f"--{p.short}"] if p.short else [])
        text = f"{p.doc} ({_facts(p, default)})".replace("%", "%%")
        group.add_argument(*names, dest=p.name, default=None, help=text, **_kind(p))


def _facts(p: Parameter, default: Any) -> str:
    shown = {bool: str(default).lower(), tuple: "none; may be given several times"}.get(p.kind, default)
    possible = p.possible or " | ".join(p.choices)
    return ", ".join(filter(None, [f"{possible} {p.unit}".strip(), f"default: {'none' if shown is None else shown}"]))


def _kind(p: Parameter) -> dict[str, Any]:
    kinds: dict[type, dict[str, Any]] = {
        bool: {"action": argparse.BooleanOptionalAction},
        tuple: {"action": "append", "choices": p.choices, "metavar": "NAME"},
        str: {"choices": p.choices, "metavar": "NAME"} if p.choices else {"metavar": "TEXT"},
        int: {"type": _within(p, whole), "metavar": "N"},
        float: {"type": _within(p, real), "metavar": "X"},
    }
    return kinds[p.kind]


def _within(p: Parameter, parse: Callable[[str], Any]) -> Callable[[str], Any]:
    """Returns an argparse type that parses p's number and refuses one out of range with the engine's limits."""

    def number(text: str) -> Any:
        value = parse(text)
        if not p.takes(value):
            raise argparse.ArgumentTypeError(f"{p.name} is {text}, it must be {p.possible} {p.unit}".rstrip())
        return value

    return number


def given_parameters(args: argparse.Namespace, *tables: Sequence[Parameter]) -> dict[str, Any]:
    """Returns {name: value} of the tables' parameters that the user gave."""
    table = [p for one in tables for p in one]
    found = {p.name: getattr(args, p.name) for p in table if p.on_command_line}
    for p, after in zip(table, table[1:], strict=False):
        if p.pair and getattr(args, p.pair) is not None:
            found[p.name], found[after.name] = getattr(args, p.pair)
    return {
        name: tuple(value) if isinstance(value, list) else value for name, value in found.items() if value is not None
    }


def add_matching(parser: argparse.ArgumentParser, defaults: Mapping[str, Any]) -> argparse._ArgumentGroup:
    """Adds the rare options of the depth engine: matcher and rig parameters. defaults: the command's own values."""
    text = "Semi-global matching of census descriptors, and what becomes of its depth."
    group = rare_group(parser, "matching", text)
    add_options(group, MATCHER, defaults)
    add_options(group, RIG)
    return group
