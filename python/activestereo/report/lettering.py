# SPDX-License-Identifier: Apache-2.0
"""Writes text into Matplotlib figures verbatim: "$" starts no formula, and missing letters raise no warning."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from activestereo.common.output_files import replace_file
from activestereo.common.shown import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def escape_dollars(name: str) -> str:
    """Escapes a name so that Matplotlib does not read the text between two $ as a formula."""
    return printable(name).replace("$", r"\$")


def save_figure(figure: Figure, file: Any, **options: Any) -> None:
    """Saves the figure; letters that the font lacks become boxes without a warning. options: for Figure.savefig()."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")
        figure.savefig(file, **options)


def write_figure(path: str | Path, figure: Figure) -> None:
    replace_file(path, lambda file: save_figure(figure, file, format="png", dpi=110))
