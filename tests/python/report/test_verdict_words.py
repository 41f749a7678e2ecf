# SPDX-License-Identifier: Apache-2.0
"""The verdict in a terminal: a sentence, its figures and commands, and under --verbose a table that says of every row
what it cannot be told from."""

import re
from pathlib import Path

from activestereo.diagnose.words import alike, headline, next_steps, rival_words
from activestereo.report.diagnosis import diagnosis_sections
from activestereo.report.diagnosis import diagnosis_screen, diagnosis_table
from activestereo.report.screen import command
from command_line import led_on
from report_worlds import DIAGNOSIS


def _row(name, equivalent=(), nats=10.0):
    return {
        "effect": name, "family": "family", "finding": "", "score_nats": nats, "confidence": 0.1,
        "explained_share": 0.2, "parameters": {}, "equivalent": list(equivalent),
    }  # fmt: skip


def _result(**changed):
    base = {"ranking": [_row("a", ["b"]), _row("b", ["a"]), _row("c", ["a", "b", "d"]), _row("d", ["a", "b", "c"])]}
    return DIAGNOSIS | base | {"added": ["a"], "depth": None} | changed


def _screen(result, verbose=False):
    steps = [command("compare", "captures/table", "--model", "out/diagnosis/model.json", "-o", "out/diagnosis/after",
                     label="check")]  # fmt: skip
    return diagnosis_screen(result, steps, Path("out/diagnosis/report.html"), "cache: empty", verbose)


def test_a_sentence_for_each_verdict():
    said = [_row("a") | {"finding": "The air is hazy"}, _row("b") | {"finding": "A lamp flickers"}]
    both = _result(ranking=said, added=["a", "b"])
    assert headline(both) == "The model lacks a (the air is hazy) and b (a lamp flickers)."
    assert headline(_result()) == "The model lacks a."
    assert headline(_result(verdict="unknown", added=[])) == (
        "Something is missing that no known effect explains (2.51 DN, noise alone gives 2.44 DN)."
    )
    assert "at the noise floor (at the noise floor, noise" not in headline(_result(verdict="none", added=[]))
    fault = {"verdict": "effect", "reason": None, "added": ["e"], "ranking": [_row("e") | {"nuisance": False}]}
    assert headline(_result(verdict="none", added=[], depth=fault)) == (
        "The images lack nothing; the depth engine has one effect more: e."
    )
    assert headline(_result(verdict="undetermined", reason="it is dark")).endswith("missing: it is dark.")


def test_an_effect_has_one_share_and_no_words_contradict_it():
    """A rival that rounds to the same share gets a digit more; none is "within 5 %" of a name and explains 95 %."""
    sure = {"effects": ["a"], "rivals": {"c": 0.4, "d": 0.3, "e": 0.2}}  # beside other effects; the ranking's are told
    ranking = [_row(name) | {"explained_share": share} for name, share in zip("acde", (0.951, 0.93, 0.71, 0.2))]
    words = rival_words(_result(ranking=ranking, sets=[sure]))
    assert words == ["Rivals fit worse: it explains 95 %, c 93 %, d 71 %."]
    ranking[1]["explained_share"] = 0.9483
    assert "explains 95.1 %, c 94.8 %," in rival_words(_result(ranking=ranking, sets=[sure]))[0]
    ranking[1]["explained_share"] = 0.97
    assert "worse" not in rival_words(_result(ranking=ranking, sets=[sure]))[0]
    both = rival_words(_result(ranking=ranking, sets=[sure, {"effects": ["d"], "rivals": {}}]))
    assert both == ["Share of the error beyond noise: a 95 % and d 71 %."]
    open_set = {"effects": ["a", "b"], "rivals": {}}
    assert rival_words(_result(sets=[open_set]))[1] == "This data cannot tell a from b."
    repeats = _row("a") | {"channel": "noise"}
    assert rival_words(_result(ranking=[repeats], sets=[sure])) == []
    shares = re.findall(r"a +family +10\.0 +(\d+) %|noise: a (\d+) %", _screen(_result(sets=[open_set]), True))
    assert len(shares) == 2 and len({one or other for one, other in shares}) == 1


def test_the_screen_has_errors_values_with_their_floor_and_the_next_commands():
    row = _row("a") | {"finding": "The air is hazy"}
    row["parameters"] = {"k": {"value": 4.0, "low": 3.3, "high": 4.7, "unit": "m", "floor": 0.66}}
    result = _result(ranking=[row], sets=[{"effects": ["a"], "rivals": {"b": 0.1}}], capture="table",
                     depth={"verdict": "none", "reason": None, "added": [], "ranking": []})  # fmt: skip
    text = _screen(result)
    assert led_on(text)[0][0] == "compare" and "\ncheck: " in text
    assert text.startswith("table: the model lacks a (the air is hazy). Errors on frames that")
    for name, value in (("model now", "6.21"), ("with the effect", "2.51"), ("sensor noise", "2.44")):
        assert re.search(f"^  {name} +{value} DN +█", text, re.M)
    assert "fitted: k 4.00 ±0.70 m (floor ±0.66)" in text and "depth engine: nothing is missing." in text
    row["parameters"]["k"]["floor"] = 0.7
    row["parameters"] |= {"haze_per_m": {"value": 0.2, "low": 0.0, "high": 0.9, "unit": "1/m", "floor": 0.02}}
    text = _screen(result)
    assert "k 4.00 ±0.70 m (all floor), haze 0.2 1/m (0 to 0.9," in text
    assert "probability" not in _screen(result, True) and "confidence" not in _screen(result, True)


def test_the_columns_of_both_tables_are_told():
    for said in (diagnosis_table(_result()), "".join(diagnosis_sections(_result(depth={})))):
        for word in ("nats: the logarithm of how much likelier", "explains: share of the squared error", "floor: "):
            assert said.count(word) == 1
    assert "nats:" not in diagnosis_table(_result(ranking=[], added=[]))


def test_what_differs_is_mended_where_it_is():
    """A glossier table is no fault of the sensor."""
    rows = [_row("specular") | {"family": "surface"}, _row("lens_psf"), _row("prnu")]
    advice = [next_steps(_result(ranking=rows, added=added))[-1] for added in (["specular"], ["lens_psf", "prnu"])]
    assert advice[0].startswith("Give the scene file's materials the values found, or simulate with ")
    assert advice[1].startswith("Mend the sensor and record again, or simulate")
    both = next_steps(_result(ranking=rows, added=["specular", "lens_psf"]))[-1]
    assert both.startswith("Give the scene file's materials the values found; mend the sensor and record again, or")


def test_every_row_says_what_it_cannot_be_told_from():
    """An effect that explains more than a row is no equal of it where it does not say so of the row."""
    result = _result()
    assert [alike(result, row) for row in result["ranking"]] == [["b"], ["a"], ["d"], ["c"]]
    lines = diagnosis_table(result).splitlines()
    notes = [line.strip() for line in lines if line.strip().startswith("cannot be told from")]
    assert notes == [f"cannot be told from {name}" for name in "badc"]


def test_own_effects_are_in_the_table_wherever_they_rank():
    rows = [_row(f"e{i}") for i in range(20)] + [_row("mine")]
    result = _result(ranking=rows, added=["e0"], own={"mine": "it gains 1 nat", "other": "it explains next to nothing"})
    lines = diagnosis_table(result).splitlines()
    place = next(i for i, line in enumerate(lines) if line.split()[:2] == ["21", "mine"])
    assert lines[place + 1].strip() == "yours: it gains 1 nat"
    assert any(line.split()[:2] == ["-", "other"] and "next to nothing" in line for line in lines)
    assert not any(" e12 " in line for line in lines)


def test_rows_that_gain_nothing_are_not_printed():
    rows = [_row("a", nats=30.0), _row("b", nats=0.0), _row("mine", nats=0.0)]
    text = diagnosis_table(_result(ranking=rows, own={"mine": "it gains nothing"}))
    assert " a " in text and " mine " in text and " b " not in text
