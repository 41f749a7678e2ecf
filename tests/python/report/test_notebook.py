# SPDX-License-Identifier: Apache-2.0
"""Results in a notebook tell their own figures, and odd names are drawn."""

import io
import warnings

import numpy as np
import pytest
from matplotlib.figure import Figure

from activestereo.diagnose import Diagnosis
from activestereo.effects import Model
from activestereo.report.lettering import escape_dollars, save_figure
from report_worlds import DIAGNOSIS, WITH_MODEL

RESULT = WITH_MODEL | {"ranking": [row | {"explained_share": 0.5} for row in DIAGNOSIS["ranking"]]}


def test_a_comparison_has_residuals_and_a_table(ball_comparison):
    frame = ball_comparison.capture.frames[2]
    rest = ball_comparison.residuals()[frame.id, "right"]
    measured = ball_comparison.capture.ir(frame, "right").astype(np.float64)
    assert np.allclose(rest, measured - ball_comparison.predictions[frame.id, "right"], atol=1e-3)
    shown = ball_comparison._repr_html_()
    assert f"{ball_comparison.scores['ir']['test']['rmse_dn']:.3f}" in shown and "<table>" in shown


def test_a_diagnosis_in_a_notebook_says_its_verdict():
    diagnosis = Diagnosis(RESULT, Model())
    shown = diagnosis._repr_html_()
    assert "The model lacks radial_distortion" in shown and "principal_point_offset" in shown
    assert diagnosis.predictions() == {} and diagnosis.residuals() == {} and diagnosis.comparison() is None


NAMES = ["\x1b[31mred", "bell\x07", "two\nlines", "\ud800", "$\\nothing$", "a$b", "100 %", "日本", "\u202eright"]


@pytest.mark.parametrize("form", ["png", "svg"])
@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_drawn_without_a_word(name: str, form: str) -> None:
    figure = Figure(figsize=(1, 1))
    figure.suptitle(escape_dollars(name))
    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(figure, file, format=form)
    assert file.getvalue()
