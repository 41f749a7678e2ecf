# SPDX-License-Identifier: Apache-2.0
"""Scores of methods: read, checked, and compared by figures with closed forms."""

import json

import numpy as np
import pytest

from activestereo.benchmarks.sim_to_real import (
    agreement, agreement_table, agreements, mean_gap, pearson, read_scores, spearman,
)  # fmt: skip
from activestereo.cli import main

VIEWS, RATES = 8, {"clean": 1.0, "full": 0.5, "real": 0.25}


def per_view(method: str = "LearnAug") -> str:
    lines = ["criterion,method,world,view,found"]
    for world, rate in RATES.items():
        lines += [f"10 mm,{method},{world},{view},{int(view < rate * VIEWS)}" for view in range(VIEWS)]
    return "\n".join(lines) + "\n"


def shares(method: str, scale: float) -> str:
    lines = [f"10 mm,{method},{world},{scale * rate}" for world, rate in RATES.items()]
    return "\n".join(["criterion,method,world,score", *lines]) + "\n"


def test_methods_with_views_and_with_scores_count_alike(tmp_path, capsys):
    (tmp_path / "a.csv").write_text(per_view(), encoding="utf-8-sig")  # with a mark, as Excel writes it
    (tmp_path / "b.csv").write_text(shares("DDS", 0.5))
    paths = [tmp_path / name for name in ("a.csv", "b.csv")]
    found = agreements(read_scores(paths), "real")["10 mm"]
    assert found["full"].gap.value == pytest.approx((0.25 + 0.125) / 2)
    assert found["full"].pearson.value == pytest.approx(1.0) and list(found) == ["clean", "full"]
    assert len(agreement_table({"10 mm": found})) == 4
    words = ["benchmark", "sim-to-real", *map(str, paths)]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["10 mm"]["full"]["gap"][0] == pytest.approx(0.1875)
    assert main([*words, "--verbose"]) == 0
    told = capsys.readouterr().out
    assert (
        told.startswith("clean ranks the methods most as real does") and "full may do as well" in told and "█" in told
    )
    assert "Spearman" in told and max(map(len, told.split("\n\n")[0].splitlines())) <= 80
    for more, message in ((["--real", "lab"], "of the world 'lab' (known: clean, full, real)"), ([], "two methods")):
        assert main([*words[: 4 if more else 3], *more]) == 2
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("world", "place", 1), "the first line is 'criterion,method,place"),
        (lambda t: t.replace(",0,1", ",0,0.5", 1), "line 2: found is 0.5, expected 0 or 1"),
        (lambda t: t.replace(",0,1", ",0,yes", 1), "line 2: found is yes, expected 0 or 1"),
        (lambda t: t.replace(",1,1", ",0,1", 1), "line 3: LearnAug has this line twice"),
        (lambda t: t.replace("10 mm,LearnAug,clean,0,1\n", "", 1), "no line of view 0 in clean, criterion 10 mm"),
        (lambda t: t.replace("mm,LearnAug", "mm,", 1), "line 2: has 4 values, expected 5"),
        (lambda t: t.replace(",0,1", ",0", 1), "line 2: has 4 values, expected 5"),
        (lambda t: t[: t.index("\n")], "and then scores"),
        (lambda _: "", "the first line is ''"),
        (lambda _: shares("DDS", 1.5), "line 2: score is 1.5, expected 0 to 1"),
        (lambda t: t + "x" * 140_000, "is not a table of text: field larger than field limit"),
    ],
)
def test_errors_in_a_table_are_told(tmp_path, change, message):
    (tmp_path / "a.csv").write_text(change(per_view()))
    with pytest.raises(ValueError) as error:
        read_scores([tmp_path / "a.csv"])
    assert message in str(error.value) and "\n" not in str(error.value)


def test_correlations_have_their_closed_forms():
    a = np.array([0.1, 0.2, 0.4, 0.9])
    assert pearson(a, 3.0 * a + 1.0) == pytest.approx(1.0) and pearson(a, -a) == pytest.approx(-1.0)
    assert np.isnan(pearson(a, np.full(4, 0.5)))
    assert pearson(np.array([1.0, 2.0, 3.0]), np.array([1.0, 3.0, 2.0])) == pytest.approx(0.5)
    assert spearman(a, a**5) == pytest.approx(1.0) and pearson(a, a**5) < 0.95
    # 1 - 6 sum d^2 / (n (n^2 - 1)) without ties, and middle ranks with them.
    assert spearman(a, np.array([0.2, 0.1, 0.9, 0.4])) == pytest.approx(1.0 - 6.0 * 4.0 / 60.0)
    assert spearman(np.array([1.0, 1.0, 2.0]), np.array([1.0, 2.0, 3.0])) == pytest.approx(np.sqrt(0.75))
    assert mean_gap(a, a + 0.25) == pytest.approx(0.25)


def test_intervals_are_as_wide_as_the_binomial_law_says():
    views, random = 400, np.random.default_rng(0)
    real = np.ones((1, views), bool)
    own = np.arange(views)[None] % 2 == 0
    gap = agreement(own, real).gap
    assert gap.value == 0.5
    assert gap.high - gap.low == pytest.approx(2.0 * 1.96 * np.sqrt(0.25 / views), rel=0.1)
    same = random.random((9, views)) < np.linspace(0.1, 0.9, 9)[:, None]
    found = agreement(same, same)
    assert (found.gap.value, found.gap.high) == (0.0, 0.0)
    assert found.pearson.value == pytest.approx(1.0) and found.spearman.low == pytest.approx(1.0)
    assert np.isnan(agreement(own, real).pearson.value)
    with pytest.raises(ValueError, match="of both worlds"):
        agreement(own, real[:, :3])
    fixed = agreement(same[:1], same[:1], known=([0.5], [0.1])).gap  # known scores are not drawn again
    assert (fixed.value, fixed.low, fixed.high) == pytest.approx((0.2, 0.2, 0.2))
