# SPDX-License-Identifier: Apache-2.0
"""Outputs for papers and notebooks: a CSV and an object tell the result's own figures, a PDF has a page for each figure
and the same bytes again, and odd names are drawn."""

import csv
import re

import numpy as np

from activestereo.cli import main
from activestereo.diagnose import Diagnosis
from activestereo.effects import Model
from activestereo.report.models import model_images
from activestereo.report.paper import (
    write_comparison_csv,
    write_comparison_pdf,
    write_diagnosis_csv,
    write_diagnosis_pdf,
)
from report_worlds import DIAGNOSIS, WITH_MODEL


import io
import warnings

import pytest
from matplotlib.figure import Figure

from activestereo.report.lettering import escape_dollars, save_figure

RESULT = WITH_MODEL | {"ranking": [row | {"explained_share": 0.5} for row in DIAGNOSIS["ranking"]]}


def _rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_a_csv_of_a_comparison_has_its_errors(ball_comparison, tmp_path):
    write_comparison_csv(tmp_path / "errors.csv", ball_comparison.scores)
    rows = _rows(tmp_path / "errors.csv")
    assert len(rows) == 2 * len(ball_comparison.capture.frames)
    for row in rows:
        frame = next(f for f in ball_comparison.scores["frames"] if f["id"] == int(row["frame"]))
        assert row["split"] == frame["split"]
        for name in ("rmse_dn", "noise_floor_dn", "bias_dn"):
            assert float(row[name]) == frame["cameras"][row["camera"]][name]


def test_a_csv_of_a_diagnosis_has_its_ranking(tmp_path):
    write_diagnosis_csv(tmp_path / "ranking.csv", RESULT)
    first, second = _rows(tmp_path / "ranking.csv")
    assert (first["effect"], first["parameter"], float(first["value"])) == ("radial_distortion", "k1", -0.0085)
    assert (float(first["low_90"]), float(first["high_90"]), first["added"]) == (-0.0088, -0.0082, "1")
    assert first["cannot_be_told_from"] == "principal_point_offset"
    assert (second["family"], second["low_90"], second["added"]) == ("lens <shading>", "", "0")


def test_a_pdf_has_a_page_for_each_figure_and_the_same_bytes_again(ball_comparison, tmp_path):
    paths = [tmp_path / name for name in ("a.pdf", "b.pdf", "c.pdf")]
    for path in paths[:2]:
        write_comparison_pdf(path, ball_comparison)
    found = model_images(ball_comparison, RESULT)["found"]
    write_diagnosis_pdf(paths[2], ball_comparison, RESULT, found)
    contents = [path.read_bytes() for path in paths]
    assert contents[0] == contents[1]
    pages = [len(re.findall(rb"/Type /Page\b", content)) for content in contents]
    findings = {t["channel"] for t in ball_comparison.scores["where"] if t["is_finding"]}
    assert pages[0] == 3 + len(findings) and pages[2] == pages[0] + 1  # images, frames, photon transfer; the curve


def test_a_file_that_cannot_be_written_is_told_before_the_work(tmp_path, capsys):
    words = ["compare", "no such capture", "-o", str(tmp_path), "--pdf", str(tmp_path)]
    assert main(words) == 2 and "is a folder: give the name of a file" in capsys.readouterr().err


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
