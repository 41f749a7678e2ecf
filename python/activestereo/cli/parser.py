# SPDX-License-Identifier: Apache-2.0
"""Defines the parser of all commands: an error is one line that suggests the nearest known name."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from itertools import takewhile
from textwrap import wrap
from typing import Any, NoReturn

from activestereo.cli.exit_codes import USAGE
from activestereo.common.nearest import did_you_mean, nearest, unknown
from activestereo.common.shown import printable
from activestereo.report.screen import COLUMNS


class Help(argparse.RawDescriptionHelpFormatter):
    """Keeps a description's own line breaks, but rewraps paragraphs, lists and commands that are wider than the
    terminal."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(line for part in _parts(text.splitlines()) for line in _filled(part))


def _parts(lines: Sequence[str]) -> list[list[str]]:
    """Splits description lines into paragraphs and list entries, each a list of lines. A blank line is a part of its
    own."""
    parts: list[list[str]] = []
    for line in lines:
        first = parts[-1][0] if parts else ""
        is_prose = _indent(line) == 0 == _indent(first)
        if first and line and (is_prose or _indent(line) >= _hang(first) > 0):
            parts[-1].append(line)
        else:
            parts.append([line])
    return parts


def _filled(part: Sequence[str]) -> list[str]:
    if max(map(len, part)) <= COLUMNS:
        return list(part)
    start, hang = _indent(part[0]), _hang(part[0])
    text = " ".join(line.strip().removesuffix("\\").rstrip() for line in part)
    if text.startswith("activestereo "):
        lines = wrap(text, COLUMNS - start - 2, subsequent_indent="    ", break_long_words=False)
        return [" " * start + line + " \\" * (line is not lines[-1]) for line in lines]
    return wrap(
        text, COLUMNS, initial_indent=" " * start, subsequent_indent=" " * hang, break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _hang(line: str) -> int:
    """Returns the column at which a list entry's continuation lines start; 0 for plain prose."""
    entry = re.match(r" +\S+(?: \S+)*?  +(?=\S)", line)
    return entry.end() if entry else _indent(line) + 2 * line.startswith(" ")


class Parser(argparse.ArgumentParser):
    """Extends argparse: errors suggest the nearest known command or option, and --help hides rare options."""

    def __init__(self, *, formatter_class: Any = Help, **own: Any) -> None:
        super().__init__(formatter_class=formatter_class, **own)
        self._rare: list[Any] = []  # groups that --help-all alone shows

    def rare_group(self, title: str, description: str | None = None) -> argparse._ArgumentGroup:
        """Returns a new group for rare options: --help prints its title alone, --help-all its options."""
        if not self._rare:
            self.add_argument("--help-all", action=_HelpAll, nargs=0, help="show all options, also the rare ones")
        self._rare.append(self.add_argument_group(title, description))
        return self._rare[-1]

    def format_help(self) -> str:
        if not self._rare:
            return super().format_help()
        titles = ", ".join(group.title for group in self._rare)
        return (
            f"{self._help_of([g for g in self._action_groups if g not in self._rare])}\nmore (--help-all): {titles}\n"
        )

    def format_all_help(self) -> str:
        """Returns the help text with all options, rare ones too."""
        return super().format_help()

    def _help_of(self, groups: Sequence[Any]) -> str:
        formatter = self._get_formatter()
        own = [action for group in groups for action in group._group_actions]
        formatter.add_usage(self.usage, [a for a in self._actions if a in own], self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        for group in groups:
            formatter.start_section(group.title)
            formatter.add_text(group.description)
            formatter.add_arguments(group._group_actions)
            formatter.end_section()
        return formatter.format_help()

    def error(self, message: str) -> NoReturn:
        self.exit(USAGE, f"{self.prog}: {printable(message)} (see {self.prog} --help)\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parses as argparse does, but reports unknown options first; argparse would report missing arguments before
        them."""
        self._refuse_unknown_options(args or ())
        found, rest = super().parse_known_args(args, namespace)
        if rest and self._subparsers is None:  # the error names this command, not the whole program
            self.error(f"unrecognized arguments: {' '.join(rest)}")
        return found, rest

    def _refuse_unknown_options(self, arguments: Sequence[str]) -> None:
        own = takewhile(lambda a: a != "--", arguments)
        if self._subparsers is not None:  # the command's own parser checks the options after it
            own = takewhile(lambda a: a.startswith("-"), own)
        known = [name for name in self._option_string_actions if name.startswith("--")]
        nameless = {f"--{action.dest}": action.metavar or action.dest for action in self._get_positional_actions()}
        for argument in own:
            name = argument.partition("=")[0]
            if name.startswith("--") and " " not in name and not any(other.startswith(name) for other in known):
                meant = nearest(name, [*nameless, *known])
                if meant in nameless:
                    self.error(f"unknown option {name}; {nameless[meant]} is given as a word alone, without {name}")
                self.error(f"unknown option {name}{did_you_mean(name, known)}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            what = "command" if action.dest == "command" else "choice"
            raise argparse.ArgumentError(action, unknown(what, value, map(str, action.choices)))


class _HelpAll(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        assert isinstance(parser, Parser)
        parser._print_message(parser.format_all_help(), sys.stdout)
        parser.exit()


def rare_group(parser: argparse.ArgumentParser, title: str, description: str | None = None) -> argparse._ArgumentGroup:
    """Calls Parser.rare_group() on a command's parser and returns the new group."""
    assert isinstance(parser, Parser)
    return parser.rare_group(title, description)
