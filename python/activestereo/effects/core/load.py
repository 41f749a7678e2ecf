# SPDX-License-Identifier: Apache-2.0
"""Loads effects from a user's file: Python with the decorator, or a shared library of ks/effect.h."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from activestereo.effects.core.descriptor import Effect
from activestereo.effects.core.plugin import load_plugin


def load_effects(path: str | Path) -> dict[str, Effect]:
    """Returns {id: Effect} of a .py file or a shared library. Raises FileNotFoundError, or ValueError that says what is
    wrong with the file."""
    path = Path(path)
    if not path.is_file():
        words = "no such effect file (Python, or a shared library; built-in effects need none)"
        raise FileNotFoundError(2, words, str(path))
    try:
        found = _from_python(path) if path.suffix == ".py" else load_plugin(path)
    except OSError as error:
        raise ValueError(f"{path}: neither a Python file nor a shared library that loads: {error}") from error
    if not found:
        raise ValueError(f"{path}: holds no effect; make one with the decorator activestereo.effects.effect")
    effects: dict[str, Effect] = {}
    for e in found:
        if effects.setdefault(e.id, e) is not e:
            raise ValueError(f"{path}: two effects have the id '{e.id}'")
    return effects


def _from_python(path: Path) -> list[Effect]:
    spec = importlib.util.spec_from_file_location(f"activestereo_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path}: is no Python file that can be imported")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # anything may go wrong in a user's file; the message names the line
        line = getattr(error, "lineno", None) or _line_in(error, path)
        raise ValueError(f"{path}{f', line {line}' if line else ''}: {type(error).__name__}: {error}") from error
    return list({id(value): value for value in vars(module).values() if isinstance(value, Effect)}.values())


def _line_in(error: BaseException, path: Path) -> int | None:
    """Returns the last line of the file that the error went through, or None."""
    step, line = error.__traceback__, None
    while step:
        if step.tb_frame.f_code.co_filename == str(path):
            line = step.tb_lineno
        step = step.tb_next
    return line
