# SPDX-License-Identifier: Apache-2.0
"""The parser of all commands: what it refuses is one line, with the name that was probably meant."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import takewhile
from typing import Any, NoReturn

from activestereo.cli.exit_codes import USAGE
from activestereo.common.nearest import did_you_mean, nearest, unknown
from activestereo.common.shown import printable


class Parser(argparse.ArgumentParser):
    """argparse's own, whose commands and options are looked up by the nearest name where they are not known, and whose
    description is shown as it is written."""

    def __init__(self, *, formatter_class: Any = argparse.RawDescriptionHelpFormatter, **own: Any) -> None:
        super().__init__(formatter_class=formatter_class, **own)

    def error(self, message: str) -> NoReturn:
        self.exit(USAGE, f"{self.prog}: {printable(message)} (see {self.prog} --help)\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """argparse's, after a look for unknown options: it would first ask for those that seem to be missing."""
        self._refuse_unknown_options(args or ())
        return super().parse_known_args(args, namespace)

    def _refuse_unknown_options(self, arguments: Sequence[str]) -> None:
        own = takewhile(lambda a: a != "--", arguments)
        if self._subparsers is not None:  # what follows the command is the command's
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
