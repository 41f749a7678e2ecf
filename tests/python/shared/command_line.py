# SPDX-License-Identifier: Apache-2.0
"""The commands of the command line, as the parser has them, and run in this process."""

import argparse
import re
import signal
import subprocess
from contextlib import ExitStack
from subprocess import CompletedProcess

from activestereo.cli import main, make_parser
from activestereo.cli.view import make_server, shown_path

_PATIENCE_S = 60


def run_here(capsys, *words, patience_s=_PATIENCE_S):
    """The command's status and words, without a process' start; TimeoutError where it waits."""

    def end(number, frame):
        raise TimeoutError(f"{words} is at work after {patience_s} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(patience_s)
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


def _as_a_shell_reads(pasted):
    script = f"activestereo() {{ printf '%s\\0' \"$@\"; }}\n{pasted}"
    return subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout.split("\0")[:-1]


def led_on(text):
    """The words of each command that a command's end gives to paste, as bash reads them. The end fits ten lines
    of 80 columns, long paths aside; those that view what is there do so, the others' options are known."""
    assert text.replace("\\\n", "").count("\n") <= 10, text
    assert all(len(line) <= 80 or "/" in line for line in text.splitlines()), text
    pasted = re.findall(r"^(?:next|check|use): (activestereo (?:.*\\\n)*.*)", text, re.M)
    commands = [_as_a_shell_reads(line) for line in pasted]
    assert commands, text
    for words in commands:
        args = make_parser().parse_args(words + (["--no-browser", "--device", "cpu"] if words[0] == "view" else []))
        if words[0] == "view":
            with ExitStack() as stack:
                stack.enter_context(make_server(args, shown_path(args, stack)))
    return commands


def leaves(parser=None):
    """{"calibrate noise": its parser} of all commands that do something."""
    parser = make_parser() if parser is None else parser
    kinds = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    inner = [leaf for kind in kinds for each in kind.choices.values() for leaf in leaves(each).items()]
    return dict(inner) if kinds else {parser.prog.partition(" ")[2]: parser}
