# SPDX-License-Identifier: Apache-2.0
"""Figures of names that hold orders for a terminal, formulas or letters that no font has."""

import io
import warnings

import pytest
from matplotlib.figure import Figure

from activestereo.report.lettering import escape_dollars, save_figure

NAMES = ["\x1b[31mred", "bell\x07", "two\nlines", "\ud800", "$\\nothing$", "a$b", "100 %", "日本", "\u202eright"]


@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_drawn_without_a_word(name: str, form: str) -> None:
    figure = Figure(figsize=(1, 1))
    figure.suptitle(escape_dollars(name))
    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(figure, file, format=form)
    assert file.getvalue()
