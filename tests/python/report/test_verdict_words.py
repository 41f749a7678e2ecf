# SPDX-License-Identifier: Apache-2.0
"""The verdict in a terminal: a sentence, ten lines at most, and a table that says of every row what it cannot be told
from."""

import re

import pytest

from activestereo.report.diagnosis import diagnosis_sections
from activestereo.report.diagnosis_text import diagnosis_text, verdict_text
from activestereo.diagnose.answer.verdict_words import alike, headline, next_steps, share_gone
from report_worlds import DIAGNOSIS


def _row(name, equivalent=(), nats=10.0):
    return {
        "effect": name, "family": "family", "finding": "", "score_nats": nats, "confidence": 0.1,
        "explained_share": 0.2, "parameters": {}, "equivalent": list(equivalent),
    }  # fmt: skip


def _result(**changed):
    base = {"ranking": [_row("a", ["b"]), _row("b", ["a"]), _row("c", ["a", "b", "d"]), _row("d", ["a", "b", "c"])]}
    return DIAGNOSIS | base | {"added": ["a"], "depth": None} | changed


@pytest.mark.parametrize(
    "before, after, floor, gone",
    [(5.0, 3.0, 3.0, 1.0), (5.0, 2.9, 3.0, 1.0), (5.0, 5.0, 3.0, 0.0), (5.0, 4.0, 3.0, 9 / 16), (3.0, 3.0, 3.0, None),
     (5.0, 4.0, None, None), (None, None, None, None)],
)  # fmt: skip
def test_the_share_that_goes_is_of_the_square_beyond_noise(before, after, floor, gone):
    result = _result(heldout_ir_rmse_before=before, heldout_ir_rmse_after=after, heldout_noise_floor=floor)
    assert share_gone(result) == (None if gone is None else pytest.approx(gone))


def test_a_sentence_for_each_verdict():
    said = [_row("a") | {"finding": "The air is hazy"}, _row("b") | {"finding": "A lamp flickers"}]
    both = _result(ranking=said, added=["a", "b"])
    assert headline(both).startswith("The air is hazy and a lamp flickers: 99 % of the squared error")
    assert headline(_result()).startswith("The model lacks a: ")
    assert headline(_result(verdict="unknown", added=[])) == (
        "Something is missing that no known effect explains (2.51 DN, noise alone gives 2.44 DN)."
    )
    assert "at the noise floor (at the noise floor, noise" not in headline(_result(verdict="none", added=[]))
    fault = {"verdict": "effect", "reason": None, "added": ["e"], "ranking": [_row("e") | {"nuisance": False}]}
    assert headline(_result(verdict="none", added=[], depth=fault)) == (
        "The images lack nothing; in the depth: the model lacks e."
    )
    assert headline(_result(verdict="undetermined", reason="it is dark")).endswith("missing: it is dark.")


def test_the_sentence_is_what_the_figures_below_it_give():
    """A share of squares, from the geometry as it was measured where that is another than stated."""
    figures = {"heldout_ir_rmse_before": 5.0, "heldout_ir_rmse_geometry": 4.0, "heldout_ir_rmse_after": 3.1}
    said = verdict_text(_result(**figures, heldout_noise_floor=3.0))
    (gone,) = re.findall(r": (\d+) % of the squared error beyond noise goes", said)
    before, measured, after, noise = (float(x) for x in re.findall(r"^  .* (\d\.\d+) DN ", said, re.M))
    assert (before, noise) == (5.0, 3.0)
    assert float(gone) == round(100 * (measured**2 - after**2) / (measured**2 - noise**2))


def test_the_columns_of_both_tables_are_told():
    for said in (diagnosis_text(_result()), "".join(diagnosis_sections(_result(depth={})))):
        assert said.count("nats: the logarithm of how much likelier") == 1
    assert "explains: share of the squared error" in diagnosis_text(_result())
    assert "nats:" not in diagnosis_text(_result(ranking=[], added=[]))


def test_what_differs_is_mended_where_it_is():
    """A glossier table is no fault of the sensor."""
    rows = [_row("specular") | {"family": "surface"}, _row("lens_psf"), _row("prnu")]
    advice = [next_steps(_result(ranking=rows, added=added))[-1] for added in (["specular"], ["lens_psf", "prnu"])]
    assert advice[0].startswith("Give the scene file's materials the values found, or simulate with it: ")
    assert advice[1].startswith("Mend the sensor and record again, or simulate")
    both = next_steps(_result(ranking=rows, added=["specular", "lens_psf"]))[-1]
    assert both.startswith("Give the scene file's materials the values found; mend the sensor and record again, or")


def test_ten_lines_then_the_table():
    many = _result(next_measurement=[{"text": f"measure {i}"} for i in range(5)], reason="a reason")
    many["added"] = ["a", "b", "c", "d"]
    many["ranking"] = [row | {"parameters": {"k": {"value": 1.0, "low": 0.9, "high": 1.1, "unit": "m"}}}
                       for row in many["ranking"]]  # fmt: skip
    lines = verdict_text(many).splitlines()
    assert len(lines) == 10 and lines[0] == headline(many)
    assert lines[-2] == "next: Measure: measure 0."
    whole = diagnosis_text(many).splitlines()
    assert whole[:10] == lines and whole[10] == "" and whole[11].split()[:2] == ["effect", "family"]


def test_every_row_says_what_it_cannot_be_told_from():
    """An effect that explains more than a row is no equal of it where it does not say so of the row."""
    result = _result()
    assert [alike(result, row) for row in result["ranking"]] == [["b"], ["a"], ["d"], ["c"]]
    lines = diagnosis_text(result).splitlines()
    notes = [line.strip() for line in lines if line.strip().startswith("cannot be told from")]
    assert notes == [f"cannot be told from {name}" for name in "badc"]


def test_own_effects_are_in_the_table_wherever_they_rank():
    rows = [_row(f"e{i}") for i in range(20)] + [_row("mine")]
    result = _result(ranking=rows, added=["e0"], own={"mine": "it gains 1 nat", "other": "it explains next to nothing"})
    lines = diagnosis_text(result).splitlines()
    place = next(i for i, line in enumerate(lines) if line.split()[:2] == ["21", "mine"])
    assert lines[place + 1].strip() == "yours: it gains 1 nat"
    assert any(line.split()[:2] == ["-", "other"] and "next to nothing" in line for line in lines)
    assert not any(" e12 " in line for line in lines)


def test_rows_that_gain_nothing_are_not_printed():
    rows = [_row("a", nats=30.0), _row("b", nats=0.0), _row("mine", nats=0.0)]
    text = diagnosis_text(_result(ranking=rows, own={"mine": "it gains nothing"}))
    assert " a " in text and " mine " in text and " b " not in text
