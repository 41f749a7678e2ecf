# SPDX-License-Identifier: Apache-2.0
"""The formats that a data set is also written in."""

from __future__ import annotations

import shutil
from pathlib import Path

from activestereo.benchmarks.generate import lerobot, mcap

_WRITERS = {"lerobot": lerobot, "mcap": mcap}


def require(names: list[str]) -> None:
    """Raises ImportError, with the packages to install, if a format's package is missing."""
    for name in names:
        _WRITERS[name].package()


def write_formats(out: Path, count: int, names: list[str]) -> None:
    """Writes frames 0 to count - 1 of the data set `out`, each format into its folder out/NAME. Writes a folder whole
    or not at all, and replaces an old one."""
    aside = out / ".unfinished"
    shutil.rmtree(aside, ignore_errors=True)
    aside.mkdir()
    for name in names:
        _WRITERS[name].write(out, count, aside / name)
        shutil.rmtree(out / name, ignore_errors=True)
        (aside / name).rename(out / name)
    aside.rmdir()
