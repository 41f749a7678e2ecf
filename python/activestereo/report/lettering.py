# SPDX-License-Identifier: Apache-2.0
"""Names in figures as they are written: no formulas of Matplotlib, and no warning of letters that its font lacks."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from activestereo.common.output_files import replace_file
from activestereo.common.shown import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def as_written(name: str) -> str:
    """A name for a text in a figure: Matplotlib takes what stands between two $ for a formula."""
    return printable(name).replace("$", r"\$")


def save_figure(figure: Figure, file: Any, **options: Any) -> None:
    """Figure.savefig() with boxes for letters that the font lacks."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")
        figure.savefig(file, **options)


def write_figure(path: str | Path, figure: Figure) -> None:
    replace_file(path, lambda file: save_figure(figure, file, format="png", dpi=110))
