# SPDX-License-Identifier: Apache-2.0
"""The commands of the command line, as the parser has them, and run in this process."""

import argparse
import signal
from subprocess import CompletedProcess

from activestereo.cli import main, make_parser

_PATIENCE_S = 60


def run_here(capsys, *words):
    """The command's status and what it wrote, without the second that a process takes to start; TimeoutError where it
    waits."""

    def end(number, frame):
        raise TimeoutError(f"{words} is at work after {_PATIENCE_S} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(_PATIENCE_S)
    try:
        status = main([str(word) for word in words])
    except SystemExit as ended:
        status = ended.code
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return CompletedProcess(words, status, *capsys.readouterr())


def refused(words, capsys):
    """The line in which a command says what is wrong with its words."""
    result = run_here(capsys, *words)
    assert result.returncode == 2, result.stderr
    (line,) = [line for line in result.stderr.splitlines() if line.startswith("activestereo: ")]
    return line


def leaves(parser=None):
    """{"calibrate noise": its parser} of all commands that do something."""
    parser = make_parser() if parser is None else parser
    kinds = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    inner = [leaf for kind in kinds for each in kind.choices.values() for leaf in leaves(each).items()]
    return dict(inner) if kinds else {parser.prog.partition(" ")[2]: parser}
