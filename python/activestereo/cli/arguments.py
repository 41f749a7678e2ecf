# SPDX-License-Identifier: Apache-2.0
"""Defines the argument parser of all commands, and the argument types and options that several commands share. The
parser's errors are one line each, with the nearest known name."""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from itertools import takewhile
from pathlib import Path
from textwrap import wrap
from typing import Any, NoReturn, TypeAlias

import numpy as np

from activestereo.common.baseline import unit_question
from activestereo.common.limits import EXPOSURE, camera_matrix_fault
from activestereo.common.output_files import check_target, finite
from activestereo.common.parameter import RENDER
from activestereo.common.pose import rigid_fault
from activestereo.common.shown import did_you_mean, nearest, printable, unknown
from activestereo.report.screen import COLUMNS

# The exit status of every command; examples/guide/command_line.md explains them to users.
FINE = 0
FINDING = 1  # the command did its work and found a fault in its subject
USAGE = 2  # an option or a file is wrong
FAILURE = 3  # the device or the program failed
STOPPED = 130  # from the keyboard: 128 + SIGINT
READER_GONE = 141  # of a pipe: 128 + SIGPIPE
TERMINATED = 143  # 128 + SIGTERM
EXIT_CODES = FINE, FINDING, USAGE, FAILURE, STOPPED, READER_GONE, TERMINATED

# The main parser's subparsers; each command's add_parser() adds one.
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"
_MOST_EXPOSURE_MS = 250.0
_MOST_DEPTH_SCALE_M = 0.05
_MAX_BOUNCES = next(p.default for p in RENDER if p.name == "max_bounces")


class CommandError(Exception):
    """Reports wrong input. Its text is the one line that the user sees."""


class Finding(Exception):
    """Reports that a check found a fault in its subject. Its text is the one line that the user sees."""


class Help(argparse.RawDescriptionHelpFormatter):
    """Keeps a description's own line breaks, but rewraps paragraphs, lists and commands that are wider than the
    terminal."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        parts: list[list[str]] = []  # paragraphs and list entries; a blank line is a part of its own
        for line in text.splitlines():
            first = parts[-1][0] if parts else ""
            is_prose = _indent(line) == 0 == _indent(first)
            if first and line and (is_prose or _indent(line) >= _hang(first) > 0):
                parts[-1].append(line)
            else:
                parts.append([line])
        return "\n".join(line for part in parts for line in _filled(part))


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
    """Returns the column of a list entry's text; for other indented lines two more than the indent; 0 for plain
    prose."""
    entry = re.match(r" +\S+(?: \S+)*?  +(?=\S)", line)
    return entry.end() if entry else _indent(line) + 2 * line.startswith(" ")


class Parser(argparse.ArgumentParser):
    """Extends argparse: errors suggest the nearest known command or option, and --help leaves out the rare options."""

    def __init__(self, *, formatter_class: Any = Help, **own: Any) -> None:
        super().__init__(formatter_class=formatter_class, **own)
        self._negative_number_matcher = re.compile(r"-\.?\d")  # argparse takes "-1,0" for an option
        self._rare: list[Any] = []  # groups that --help-all alone shows

    def rare_group(self, title: str, description: str | None = None) -> argparse._ArgumentGroup:
        """Returns a new group for rare options: --help prints only its title, --help-all also its options."""
        if not self._rare:
            self.add_argument("--help-all", action=_HelpAll, nargs=0, help="show all options, also the rare ones")
        self._rare.append(self.add_argument_group(title, description))
        return self._rare[-1]

    def format_help(self, with_rare: bool = False) -> str:
        if with_rare or not self._rare:
            return super().format_help()
        shown = copy(self)
        shown._action_groups = [group for group in self._action_groups if group not in self._rare]
        own = [action for group in shown._action_groups for action in group._group_actions]
        shown._actions = [action for action in self._actions if action in own]
        more = ", ".join(group.title for group in self._rare)
        return f"{super(Parser, shown).format_help()}\nmore (--help-all): {more}\n"

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
        parser._print_message(parser.format_help(with_rare=True), sys.stdout)
        parser.exit()


def add_command(
    commands: Commands, name: str, summary: str, text: str, run: Callable[[argparse.Namespace], None] | None = None
) -> Parser:
    """Adds a command with its help and returns its parser. run: does the work; None if the command has subcommands."""
    parser = commands.add_parser(name, help=summary, description=text)
    parser.set_defaults(run=run)
    return parser


def numbers(text: str, counts: Sequence[int], what: str) -> np.ndarray:
    """Parses finite numbers that are separated by commas or blanks. counts: how many numbers are allowed; what: the
    argument's name in errors."""
    try:
        values = np.array([float(part) for part in text.replace(",", " ").split()])
    except ValueError:
        raise argparse.ArgumentTypeError(f"{what} is not a list of numbers: '{text}'") from None
    if len(values) not in counts:
        raise argparse.ArgumentTypeError(
            f"{what} needs {' or '.join(map(str, counts))} finite numbers, '{text}' has {len(values)}"
        )
    if not np.isfinite(values).all():
        raise argparse.ArgumentTypeError(f"{what} needs finite numbers, '{text}' has others")
    return values


def camera_matrix(text: str) -> np.ndarray:
    values = numbers(text, (9, 4), "a camera matrix")
    if len(values) == 4:
        values = np.array([values[0], 0, values[2], 0, values[1], values[3], 0, 0, 1])
    k = values.reshape(3, 3)
    if fault := camera_matrix_fault(k):
        raise argparse.ArgumentTypeError(f"'{text}' {fault}")
    return k


def transform(text: str) -> np.ndarray:
    matrix = numbers(text, (16,), "a transform").reshape(4, 4)
    if fault := rigid_fault(matrix):
        raise argparse.ArgumentTypeError(f"the transform {fault}")
    return matrix


def size(text: str) -> tuple[int, int]:
    """Parses WIDTHxHEIGHT, such as 848x480, into (width, height) in pixels."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and 0 < int(part) < 65536 for part in parts):
        raise argparse.ArgumentTypeError(f"a size is WIDTHxHEIGHT, such as 848x480, not '{text}'")
    return int(parts[0]), int(parts[1])


def _number(
    needed: str, is_allowed: Callable[[Any], bool] = lambda value: True, kind: Callable[[str], Any] = float
) -> Callable[[str], Any]:
    """Returns a function that parses a number. needed: words for the allowed numbers, for errors. is_allowed: whether a
    number is allowed. kind: converts the text, or raises ValueError."""

    def parse(text: str) -> Any:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if math.isnan(value) or not is_allowed(value):
            raise argparse.ArgumentTypeError(f"{needed} is needed, not '{text}'")
        return value

    return parse


def _integer(text: str) -> int:
    if not (text.isascii() and text.removeprefix("-").isdecimal() and len(text) <= 11):
        raise ValueError(text)
    return int(text)


def integer_from(least: int) -> Callable[[str], int]:
    return _number(f"a whole number from {least} to {2**32 - 1}", lambda value: least <= value < 2**32, _integer)


whole = _number("a whole number", kind=_integer)
real = _number("a number")
positive = _number("a number of at least 0 and below 1e9", lambda value: 0.0 <= value < 1e9)
above_zero = _number("a number above 0 and below 1e9", lambda value: 0.0 < value < 1e9)
share = _number("a share from 0 to 1", lambda value: 0.0 <= value <= 1.0)
positive_share = _number("a share above 0 and up to 1", lambda value: 0.0 < value <= 1.0)


def baseline(text: str) -> float:
    """Parses a distance between two cameras in metres, above 0. Refuses a value that looks like millimetres."""
    value = positive(text)
    if value == 0.0:
        raise argparse.ArgumentTypeError("must be larger than 0 metres")
    if question := unit_question(value):
        raise argparse.ArgumentTypeError(question)
    return value


def exposure(text: str) -> float:
    """Parses an exposure in seconds. Refuses a value that looks like milliseconds or microseconds."""
    value = positive(text)
    if value > EXPOSURE.high:
        unit, factor = ("microseconds", 1e-6) if value > _MOST_EXPOSURE_MS else ("milliseconds", 1e-3)
        question = f"is {value:g} s, longer than any depth camera exposes: is it in {unit}?"
        raise argparse.ArgumentTypeError(f"{question} Then give {factor * value:g}")
    return value


def depth_scale(text: str) -> float:
    """Parses metres per unit of depth images, above 0. Refuses a value that looks like units per metre, or metres."""
    value = above_zero(text)
    if value > _MOST_DEPTH_SCALE_M:
        remedy = f"is it units per metre? Then give {1.0 / value:g}" if value >= 10.0 else "millimetres have 0.001"
        raise argparse.ArgumentTypeError(f"is {value:g} m per unit of a 16-bit image, too coarse for depth: {remedy}")
    return value


def names_of(what: str, known: Sequence[str]) -> Callable[[str], list[str]]:
    """Returns a function that parses comma-separated names, each one of `known`. what: the kind of name in errors."""

    def parse(text: str) -> list[str]:
        for name in text.split(","):
            if name not in known:
                raise argparse.ArgumentTypeError(unknown(what, name, known))
        return text.split(",")

    return parse


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("the name of a folder is needed; . is the present one")
    return Path(text)


# Options that several commands share: names and argparse's keywords. A command's own words replace the help's %s.
_SHARED: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "out": (("-o", "--out"), {
        "required": True, "type": _folder, "metavar": "DIR",
        "help": "folder for the results; made if it is not there, files of the same names are replaced",
    }),
    "k": (("--k",), {
        "type": camera_matrix, "metavar": "FX,FY,CX,CY", "help": "camera matrix%s, pixels; or all nine numbers by rows",
    }),
    "k_right": (("--k-right",), {
        "type": camera_matrix, "metavar": "FX,FY,CX,CY",
        "help": "the right camera's, where its cx is another: Middlebury's doffs, ZED, OAK (default: as --k)",
    }),
    "baseline": (("--baseline",), {
        "type": baseline, "metavar": "M", "help": "distance between the cameras, metres%s",
    }),
    "calibration": (("--calibration",), {
        "type": Path, "action": "append", "default": [], "metavar": "FILE",
        "help": "output of rs-enumerate-devices -c, Middlebury's calib.txt, Kalibr's camchain.yaml, or YAML of ROS "
        "(camera_info, given twice, left first) or OpenCV (intrinsics.yml, extrinsics.yml)%s",
    }),
    "rectified": (("--rectified",), {
        "action": "store_true", "help": "the images are those of P: ROS' image_rect, not image_raw; OpenCV's P1 and P2",
    }),
    "device": (("--device",), {
        "default": "auto", "metavar": "auto|cpu|N",
        "help": "Vulkan device: the best one, lavapipe, or number N of 'activestereo doctor' (default: auto)",
    }),
    "model": (("--model",), {"type": Path, "metavar": "FILE", "help": "%s"}),
    "sensor": (("--sensor",), {"default": "d435", "metavar": "NAME", "help": "%s (default: d435)"}),
    "effects": (("--effects",), {
        "type": Path, "action": "append", "default": [], "metavar": "FILE", "help": "your own effects%s",
    }),
    "samples": (("--spp",), {
        "type": integer_from(1), "metavar": "N",
        "help": "samples per pixel%s (default: 64 up to 848x480, fewer of larger images)",
    }),
    "max_bounces": (("--max-bounces",), {
        "type": integer_from(0), "default": _MAX_BOUNCES, "metavar": "N",
        "help": f"surface interactions after the first (default: {_MAX_BOUNCES})",
    }),
    "seed": (("--seed",), {"type": integer_from(0), "default": 0, "metavar": "N", "help": "%s (default: 0)"}),
    "unit": (("--unit",), {
        "type": above_zero, "default": 1.0, "metavar": "M",
        "help": "metres of what %s takes for a metre: 0.001 where it is in millimetres (default: 1)",
    }),
    "keep_transparent": (("--keep-transparent",), {
        "action": "store_true", "help": "materials of opacity 0 stay unseen (default: they are drawn opaque, and said)",
    }),
    "json": (("--json",), {"action": "store_true", "help": "print JSON in place of words and tables"}),
    "verbose": (("--verbose",), {"action": "store_true", "help": "print all figures: %s"}),
}  # fmt: skip


def add_shared(
    parser: argparse.ArgumentParser | argparse._ArgumentGroup, **said: str | bool | Mapping[str, Any]
) -> None:
    """Adds options of _SHARED to a parser, in the order given. Each keyword names an option. Its value is True, words
    that replace the help text's %s, or argparse keywords that override the option's own."""
    for name, words in said.items():
        names, option = _SHARED[name]
        own = words if isinstance(words, Mapping) else {}
        text = option["help"].replace("%s", words if isinstance(words, str) else "")
        parser.add_argument(*names, **{**option, "help": text, **own})


# Rendering options that a suggested next command repeats.
SAME_RUN = "spp", "max_bounces", "seed", "device"


def carried(args: argparse.Namespace, *names: str) -> list[Any]:
    """Returns the words with which a suggested next command repeats options of this run. names: the options, with "_"
    for "-". Options at their default value are left out; an option that may be given several times is repeated."""
    usual = {option[-1]: keywords.get("default") for option, keywords in _SHARED.values()}
    words: list[Any] = []
    for name in names:
        option, value = f"--{name.replace('_', '-')}", getattr(args, name)
        for one in value if isinstance(value, list) else [value]:
            words += [] if one == usual.get(option) else [option, one]
    return words


def refuse(args: argparse.Namespace, names: Sequence[str], what: str) -> None:
    """Raises CommandError if one of these options is given. what: the inputs that they are for."""
    for name in names:
        value = getattr(args, name)
        if isinstance(value, np.ndarray) or value:
            raise CommandError(f"--{name.replace('_', '-')} is {what}: leave it out")


def say(text: str) -> None:
    """Prints a line for the user on standard error."""
    print(f"activestereo: {printable(text)}", file=sys.stderr)


def print_json(value: Any) -> None:
    """Prints the value as JSON on standard output. NaN and infinities, which JSON cannot hold, become null."""
    print(json.dumps(finite(value), indent=1, allow_nan=False))


def check_out_file(path: Path) -> None:
    """Raises CommandError or OSError if no file can be written at `path`. Commands call it before their long work."""
    if path.is_dir():
        raise CommandError(f"{path} is a folder: give the name of a file, such as {path / 'model.json'}")
    if not path.absolute().parent.is_dir():
        raise CommandError(f"the folder {path.parent} does not exist: make it first")
    check_target(path)


def make_folder(path: Path) -> None:
    """Makes the folder `path` and its parents. Raises CommandError if nothing can be written into it. Commands call it
    before their long work."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".activestereo"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise CommandError(f"cannot write into {path}: {error.strerror}") from error
