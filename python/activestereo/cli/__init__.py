# SPDX-License-Identifier: Apache-2.0
"""Parses and runs the command line `activestereo COMMAND`, and prints every failure as one line. _COMMANDS lists the
commands' files."""

import argparse
import io
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, TextIO, cast

# Commands multiply small matrices in several processes, whose BLAS threads would wait for one another. Once NumPy is
# loaded, the variable would reach worker processes alone, and the last bits of theirs would differ.
if "numpy" not in sys.modules:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import activestereo  # before numpy
from activestereo.cli import doctor
from activestereo.cli.arguments import (
    FAILURE,
    FINDING,
    FINE,
    READER_GONE,
    STOPPED,
    TERMINATED,
    USAGE,
    CommandError,
    Finding,
    Parser,
    say,
)
from activestereo.common.own_files import outside_allowed
from activestereo.common.shown import PlainStream

# Files of this package, in the order of their commands in --help.
_COMMANDS = (
    "demo", "simulate", "view", "presets", "depth", "pair", "compare", "diagnose", "model",
    "calibrate", "import_capture", "effect", "benchmark", "generate", "doctor",
)  # fmt: skip

# Printed without a command; README.md has the same table.
_WANTED = """\
activestereo simulates depth cameras, and finds out what the model of one lacks.

you want                                 command
  see it all in a minute                 activestereo demo
  depth of a scene, as a camera has it   activestereo simulate SCENE -o DIR
  depth of a recorded infrared pair      activestereo depth LEFT.png RIGHT.png
  depth of a bag                         activestereo depth FILE.bag
  recordings of your camera              activestereo import
  a capture beside the simulation        activestereo compare CAPTURE -o DIR
  a capture, scene or bag in a browser   activestereo view CAPTURE
  the effect that your model lacks       activestereo diagnose CAPTURE -o DIR
  your own camera measured               activestereo calibrate
  training data                          activestereo generate
  to know what works on this machine     activestereo doctor

All commands: activestereo --help; one of them: activestereo COMMAND --help."""


def make_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="activestereo",
        description="Simulate active stereo depth sensors (RealSense-like) with physics: infrared pattern projector, "
        "path-traced image pair, stereo matching.",
        epilog="Each command has its own help: activestereo simulate --help. Exit status: 0 fine, 1 a check found "
        "something, 2 an option or a file is wrong, 3 the device or the program failed.",
        formatter_class=argparse.HelpFormatter,
    )
    text = "files that captures, models and lists of recordings name may lie outside of their folders"
    parser.add_argument("--allow-outside", action="store_true", help=text)
    parser.add_argument("--version", action="version", version=f"activestereo {activestereo.__version__}")
    parser.set_defaults(parser=parser)  # the demo runs other commands with it
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in _COMMANDS:
        import_module(f"activestereo.cli.{name}").add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command given by `arguments` (None for sys.argv) and returns its exit status, one of EXIT_CODES."""
    if "_ARGCOMPLETE" in os.environ:  # a shell asks for completions, and the process ends here
        import argcomplete

        argcomplete.autocomplete(make_parser())
    if sys.stdout is None or sys.stderr is None:
        closed = "standard output is closed: send it to a file or to /dev/null"
        return USAGE if sys.stderr is None else _fail(closed, USAGE)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a file's name may not be UTF-8
    try:
        given = list(sys.argv[1:] if arguments is None else arguments)
        if not given:
            print(_WANTED, file=sys.stderr)
            return USAGE
        args = _parsed(given)
        args.given = [word for word in given if word != "--allow-outside"]
        with outside_allowed() if args.allow_outside else nullcontext(), _sigterm_as_ctrl_c(), _warnings_in_a_line():
            with _no_empty_folder(getattr(args, "out", None)), redirect_stdout(cast(TextIO, PlainStream(sys.stdout))):
                _run(args)
        sys.stdout.flush()
    except KeyboardInterrupt as error:
        return _fail(_error_text(error) or "stopped", TERMINATED if isinstance(error, _Terminated) else STOPPED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader has gone: discard the rest
        return READER_GONE
    except MemoryError as error:
        return _fail(f"out of memory: {_error_text(error) or 'nothing more is known'}", FAILURE)
    except ImportError as error:
        return _fail(_missing(error), FAILURE)
    except Finding as error:
        return _fail(_error_text(error), FINDING)
    except (CommandError, OSError, ValueError) as error:
        return _fail(_error_text(error), USAGE)
    except RuntimeError as error:  # kuafu.Error and simsense.Error
        is_input = getattr(error, "status", None) in _INPUT_STATUSES
        return _fail(_error_text(error), USAGE if is_input else FAILURE)
    except Exception as error:
        return _fail(_fault(error), FAILURE)
    return FINE


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Parses the arguments. Flushes standard output even if --help exits, so that main() notices a closed pipe."""
    try:
        return make_parser().parse_args(arguments)
    finally:
        sys.stdout.flush()


def _run(args: argparse.Namespace) -> None:
    try:
        args.run(args)
    except SystemExit as error:  # no command here exits, but a user's effect may
        last = traceback.extract_tb(error.__traceback__)[-1]
        raise CommandError(f"{last.filename}, line {last.lineno}: sys.exit({error.code!r}) was called") from error


class _Terminated(KeyboardInterrupt):
    """Ends a command on SIGTERM, by the same way out as Ctrl-C."""


@contextmanager
def _sigterm_as_ctrl_c() -> Iterator[None]:
    """Wraps a command. SIGTERM raises _Terminated and ends worker processes, unless the program around the command has
    a handler of its own."""

    def end(*_: object) -> None:
        from multiprocessing import active_children  # most commands start none

        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # `timeout` sends it twice
        for process in active_children():
            process.terminate()
        raise _Terminated

    is_main = threading.current_thread() is threading.main_thread()  # Python allows no other one a handler
    if not is_main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def _warnings_in_a_line() -> Iterator[None]:
    """Wraps a command. Warnings of this program appear once each, as errors do, without Python's file and line."""
    python_shows, said = warnings.showwarning, set()

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        text = str(message)
        if not category.__module__.startswith("activestereo"):
            python_shows(message, category, *place, **more)
        elif text not in said:
            said.add(text)
            say(text)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


@contextmanager
def _no_empty_folder(out: Path | None) -> Iterator[None]:
    """Wraps a command. If the command fails, it removes the folders that the command made for `out`, if they are still
    empty. out: the command's --out, or None."""
    new = [] if out is None else [folder for folder in (out, *out.parents) if not os.path.lexists(folder)]
    try:
        yield
    except BaseException:
        with suppress(OSError):
            for folder in new:
                folder.rmdir()
        raise


def _fault(error: Exception) -> str:
    """Returns one line on an unexpected exception. ACTIVESTEREO_TRACEBACK=1 also prints the traceback."""
    if os.environ.get("ACTIVESTEREO_TRACEBACK") == "1":
        traceback.print_exception(error)
    last = traceback.extract_tb(error.__traceback__)[-1]
    name = f"{type(error).__name__} in {os.path.basename(last.filename)}:{last.lineno}"
    return f"a fault of the program ({name}): {_error_text(error)} (ACTIVESTEREO_TRACEBACK=1 shows more)"


def _missing(error: ImportError) -> str:
    """Returns a line on a missing module, with the command that installs the module if it is known."""
    name = (error.name or "").partition(".")[0]
    if name in doctor.PACKAGES:
        return f'{error}: pip install "activestereo[{doctor.PACKAGES[name]}]"'
    is_built = name in ("activestereo", "kuafu", "simsense")
    return f"{error}; build first: bash examples/quickstart.sh" if is_built else str(error)


# KS_ERROR_INVALID_ARGUMENT, _UNSUPPORTED, _NO_DEVICE, _FILE of ks/status.h.
_INPUT_STATUSES = (-1, -3, -7, -11)


def _error_text(error: BaseException) -> str:
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())


def _fail(text: str, status: int) -> int:
    say(text)
    return status
