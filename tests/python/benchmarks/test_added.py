# SPDX-License-Identifier: Apache-2.0
"""Scores of models of others: read, checked, and part of what two worlds are compared by."""

from pathlib import Path

import numpy as np
import pytest

from activestereo.benchmarks.sim_to_real.added import read_added
from activestereo.benchmarks.sim_to_real.pose_error import CRITERIA
from activestereo.benchmarks.sim_to_real.report import Results, agreement_table, model_table, scatter
from activestereo.benchmarks.sim_to_real.score import agreement
from activestereo.benchmarks.sim_to_real.tuning import Model
from activestereo.benchmarks.sim_to_real.worlds import WORLDS

VIEWS = 8


def per_view(rates: dict[str, float], method: str = "LearnAug", views: int = VIEWS) -> str:
    lines = ["method,tuned_on,world,mm,deg,view,found"]
    for world in WORLDS:
        for mm, deg in CRITERIA:
            lines += [f"{method},full,{world},{mm:g},{deg:g},{v},{int(v < rates[world] * views)}" for v in range(views)]
    return "\n".join(lines) + "\n"


def shares(rates: dict[str, float], method: str = "DDS") -> str:
    lines = ["method,tuned_on,world,mm,deg,score"]
    lines += [f"{method},raster,{world},{mm:g},{deg:g},{rates[world]}" for world in WORLDS for mm, deg in CRITERIA]
    return "\n".join(lines) + "\n"


RATES = {"clean": 1.0, "raster": 0.75, "full": 0.5, "foreign": 0.25}


def test_added_models_count_among_the_runs_own(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(per_view(RATES))
    (tmp_path / "b.csv").write_text(shares(RATES))
    models = [Model("ICP", "clean", 0), Model("PPF", "clean", 1)]
    errors = {world: np.zeros((2, VIEWS, 2)) for world in WORLDS}
    for own in errors.values():
        own[1] = 99.0  # the first finds every pose, the second none
    added = (*read_added(tmp_path / "a.csv", VIEWS), *read_added(tmp_path / "b.csv", VIEWS))
    found = Results(models, errors, 0, "sensor", added)
    assert found.rates("full", CRITERIA[0]).tolist() == [1.0, 0.0, 0.5, 0.5]
    assert found.agreement("full", CRITERIA[1]).gap.value == pytest.approx((0.0 + 0.0 + 0.25 + 0.25) / 4.0)
    assert "| LearnAug | `full` | added | 100 / 100 | 75 / 75 | 50 / 50 | 25 / 25 |" in model_table(found)
    assert len(agreement_table(found)) == 8
    labels = [text.get_text() for text in scatter(found).legends[0].get_texts()]
    assert labels[-2:] == ["LearnAug", "DDS"]


def test_known_scores_are_not_drawn_anew() -> None:
    same = np.ones((1, VIEWS), bool)
    gap = agreement(same, same, known=([0.5], [0.1])).gap
    assert (gap.value, gap.low, gap.high) == pytest.approx((0.2, 0.2, 0.2))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("tuned_on", "trained", 1), "the first line is 'method,trained"),
        (lambda t: t.replace(",clean,10", ",moon,10", 1), "line 2: unknown world 'moon'"),
        (lambda t: t.replace(",clean,10,10,", ",clean,5,10,", 1), "line 2: unknown criterion 5,10"),
        (lambda t: t.replace(",10,10,0,1", ",10,10,0,0.5", 1), "line 2: found is 0.5, expected 0 or 1"),
        (lambda t: t.replace(",10,10,0,1", ",10,10,8,1", 1), "line 2: view 8 is not one of the run's, 0 to 7"),
        (lambda t: t.replace(",10,10,0,1", ",10,10,nan,1", 1), "line 2: view nan is not one of the run's"),
        (lambda t: t.replace(",10,10,1,1", ",10,10,0,1", 1), "line 3: LearnAug on full has this line twice"),
        (lambda t: t.replace("LearnAug,full,clean,10,10,0,1\n", "", 1), "no line of view 0 in clean at 10 mm 10 deg"),
        (lambda t: t.replace("LearnAug,full", ",full", 1), "line 2: a name is empty"),
        (lambda t: t.replace(",10,10,0,1", ",10,10,0", 1), "line 2: has 6 values"),
        (lambda t: t.replace(",10,10,0,1", ",ten,10,0,1", 1), "line 2: 'ten,10,0,1' are not all numbers"),
        (lambda t: t[: t.index("\n")], "has no models"),
        (lambda _: "", "the first line is ''"),
        (lambda t: t + "x" * 140_000, "is not a table of text: field larger than field limit"),
    ],
)
def test_what_is_wrong_with_a_file_is_told(tmp_path: Path, change, message: str) -> None:
    (tmp_path / "a.csv").write_text(change(per_view(RATES)))
    with pytest.raises(ValueError) as error:
        read_added(tmp_path / "a.csv", VIEWS)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_scores_out_of_range_are_told(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text(shares(RATES).replace("1.0", "1.5", 1))
    with pytest.raises(ValueError, match="line 2: score is 1.5, expected 0 to 1"):
        read_added(tmp_path / "b.csv", VIEWS)


def test_a_table_may_be_as_excel_writes_it(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(per_view(RATES), encoding="utf-8-sig")
    assert [model.method for model in read_added(tmp_path / "a.csv", VIEWS)] == ["LearnAug"]


def test_an_added_model_of_a_runs_own_method_has_its_marker(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(shares(RATES, "PPF"))
    (tmp_path / "b.csv").write_text(shares(RATES, "DDS"))
    added = tuple(model for name in "ab" for model in read_added(tmp_path / f"{name}.csv", VIEWS))
    errors = {world: np.zeros((1, VIEWS, 2)) for world in WORLDS}
    picture = scatter(Results([Model("ICP", "clean", 0)], errors, 0, "sensor", added))
    markers = {line.get_label(): line.get_marker() for line in picture.legends[0].get_lines()}
    assert (markers["PPF"], markers["DDS"]) == ("s", "D")
