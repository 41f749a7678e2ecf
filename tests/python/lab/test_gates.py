# SPDX-License-Identifier: Apache-2.0
"""The table of gates, and verdicts passed again from the numbers that an answer keeps."""

import json
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects.core.judging import Channel
from activestereo.lab.diagnose.findings import Checks, Explanation, Finding, Ranking, Score
from activestereo.lab.diagnose.gates import GATES, gates_table, share_words
from activestereo.lab.diagnose.report.judging import judging_json, verdict_under
from activestereo.lab.diagnose.verdict.verdict import verdict_of


def ranking(explained_share: float, structure_floors: float = 0.0) -> Ranking:
    """One effect that gains 0.4 floors and leaves a tenth of a floor."""
    explanation = Explanation(SimpleNamespace(id="blur"), Channel.EXPECTED_IMAGE, {}, 110.0, np.zeros(1))
    checks = Checks(structure_floors=structure_floors, variation={"blur": 0.0})
    finding = Finding(explanation, Score(80.0, explained_share, 0.4, 1.0), checks)
    base = SimpleNamespace(chi2=150.0, white_floors=0.0)
    return Ranking(base, Checks(structure_floors=0.3), (finding,), (), 100, 1.0, 100.0, GATES)


def kept(first: Ranking) -> dict:
    return json.loads(json.dumps(judging_json(first, True)))


@pytest.mark.parametrize(("share", "verdict"), [(0.9, "effect"), (0.1, "unknown")])
def test_a_verdict_is_the_same_from_what_an_answer_keeps(share, verdict):
    first = ranking(share)
    assert verdict_of(first, first, True) == verdict
    assert verdict_under(kept(first), GATES) == (verdict, "blur" if verdict == "effect" else None)


def test_another_gate_gives_another_verdict():
    stricter = replace(GATES, smallest_share=2 * GATES.smallest_share)
    assert verdict_under(kept(ranking(0.3)), GATES)[0] == "effect"
    assert verdict_under(kept(ranking(0.3)), stricter)[0] == "unknown"


def test_every_gate_says_its_value_unit_and_source():
    table = gates_table().splitlines()[2:]
    assert len(table) == len(fields(GATES))
    for line, gate in zip(table, fields(GATES), strict=True):
        name, value, unit, decides, source, moves = (cell.strip() for cell in line.strip("|").split("|"))
        assert name == f"`{gate.name}`" and float(value) == pytest.approx(getattr(GATES, gate.name), rel=1e-5)
        assert decides and source and moves and gate.metadata["unit"] in (unit, "1")


def test_shares_are_told_in_words():
    assert [share_words(x) for x in (0.2, 0.1, 0.03)] == ["a fifth", "a tenth", "3 %"]
