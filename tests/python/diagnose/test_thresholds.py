# SPDX-License-Identifier: Apache-2.0
"""The table of thresholds, and verdicts passed again from the numbers that an answer keeps."""

import json
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects import Parameter
from activestereo.effects.core.judging import Channel
from activestereo.diagnose.findings import BaseChecks, Checks, Explanation, Finding, Ranking, Score
from activestereo.diagnose.thresholds import THRESHOLDS, thresholds_table, share_words
from activestereo.diagnose.answer.judging import judging_json, verdict_under
from activestereo.diagnose.score.intervals import share_of_places
from activestereo.diagnose.score.occam import is_at_end
from activestereo.diagnose.verdict.completeness import lacks_nothing
from activestereo.diagnose.verdict.reasons import reason_of
from activestereo.diagnose.verdict.verdict import probabilities, verdict_of


def ranking(explained_share: float, structure_reduced_chi2: float = 0.0) -> Ranking:
    """One effect that gains 0.4 noise variances and leaves a tenth of one."""
    explanation = Explanation(SimpleNamespace(id="blur"), Channel.EXPECTED_IMAGE, {}, 110.0, np.zeros(1))
    checks = Checks(structure_reduced_chi2=structure_reduced_chi2)
    finding = Finding(explanation, Score(80.0, explained_share, 0.4, 1.0), checks)
    base = SimpleNamespace(chi2=150.0, white_reduced_chi2=0.0)
    return Ranking(base, BaseChecks(structure_reduced_chi2=0.3), (finding,), (), 100, 1.0, 100.0, THRESHOLDS)


def kept(first: Ranking) -> dict:
    return json.loads(json.dumps(judging_json(first, True)))


@pytest.mark.parametrize(("share", "verdict"), [(0.9, "effect"), (0.1, "unknown")])
def test_a_verdict_is_the_same_from_what_an_answer_keeps(share, verdict):
    first = ranking(share)
    assert verdict_of(first, first, True) == verdict
    assert verdict_under(kept(first), THRESHOLDS) == (verdict, "blur" if verdict == "effect" else None)


def test_a_name_that_removes_little_is_none():
    first = ranking(0.9)
    for low, verdict in ((0.04, "unknown"), (0.06, "effect")):
        best = replace(first.best, checks=replace(first.best.checks, plain_share=0.3, plain_share_low=low))
        here = replace(first, findings=(best,))
        assert verdict_under(kept(here), THRESHOLDS)[0] == verdict
        assert verdict_under(kept(here), replace(THRESHOLDS, least_share=0.0))[0] == "effect"
        assert ("removes 4.0 % or more, a name needs 5 %" in reason_of(here, best)) == (verdict == "unknown")


def test_the_gain_that_a_name_needs_follows_from_the_rate_of_false_names():
    strict = replace(THRESHOLDS, alpha=1e-40)
    assert strict.chance_nats(40) == pytest.approx(np.log(40) + 40 * np.log(10))
    assert verdict_under(kept(ranking(0.9)), strict)[0] == "unknown"  # it gains 80 nats


def test_the_interval_of_a_share_is_that_of_places():
    places = np.arange(120) // 2
    gap = 1.0 + places
    assert share_of_places(0.3 * gap, gap, places) == pytest.approx((0.3, 0.3))
    rng = np.random.default_rng(3)
    held = []
    for _ in range(400):
        of_place = np.repeat(rng.normal(0.3, 0.1, 60), 2)
        held.append(share_of_places(of_place * 2.0, np.full(120, 2.0), places)[1] < 0.3)
    assert np.mean(held) == pytest.approx(0.95, abs=0.03)
    alone = share_of_places(gap * (places < 1), gap, places)
    assert alone[1] < 0.0 < alone[0]  # one place of sixty
    moving = share_of_places(gap * (places < 20), gap, places)  # an effect that one view of three has
    assert moving[1] > 0.05
    assert share_of_places(gap, -gap, places) == (0.0, 0.0)  # the noise floor lies above the error


def test_another_gate_gives_another_verdict():
    stricter = replace(THRESHOLDS, smallest_share=2 * THRESHOLDS.smallest_share)
    assert verdict_under(kept(ranking(0.3)), THRESHOLDS)[0] == "effect"
    assert verdict_under(kept(ranking(0.3)), stricter)[0] == "unknown"


@pytest.mark.parametrize(
    "check", ["plain_excess_reduced_chi2", "unsteady_reduced_chi2", "uneven_structure_reduced_chi2"]
)
def test_what_no_scene_error_leaves_is_unknown_where_nothing_is_named(check):
    bare = ranking(0.1)
    base = SimpleNamespace(chi2=105.0, white_reduced_chi2=0.0)
    calm = replace(bare, base=base, base_checks=BaseChecks(structure_reduced_chi2=0.05))
    assert verdict_of(calm, calm, True) == "none"
    shown = replace(calm, base_checks=replace(calm.base_checks, **{check: 0.6}))
    assert verdict_of(shown, shown, True) == "unknown"
    assert verdict_under(kept(shown), THRESHOLDS)[0] == "unknown"


@pytest.mark.parametrize("structure", [0.0, 0.06, 0.074, 0.076, 0.2])
def test_probabilities_add_up_to_one_and_say_what_the_verdict_says(structure):
    last = replace(ranking(0.9), base=SimpleNamespace(chi2=130.0, white_reduced_chi2=0.0), findings=())
    last = replace(last, base_checks=BaseChecks(structure_reduced_chi2=structure))
    best = ranking(0.9, structure).best
    best = replace(best, explanation=replace(best.explanation, chi2=130.0))
    first = replace(ranking(0.9), findings=(best,))
    given = probabilities(first, last, True)
    assert sum(given["named"].values()) + given["none"] + given["something_else"] == pytest.approx(1.0)
    likeliest = "something_else" if verdict_of(first, last, True) == "unknown" else "named"
    assert (given["something_else"] > 0.5) == (likeliest == "something_else")
    assert given["named"]["blur"] == pytest.approx(0.97 * (1.0 - given["something_else"]))
    bare = replace(ranking(0.1), base=SimpleNamespace(chi2=105.0, white_reduced_chi2=0.0))
    nothing = probabilities(bare, bare, True)
    assert nothing["named"] == {} and nothing["none"] > 0.9
    assert probabilities(bare, bare, False) is None


@pytest.mark.parametrize(
    ("chi2", "channel", "verdict"),
    [(124.0, Channel.EXPECTED_IMAGE, "effect"), (126.0, Channel.EXPECTED_IMAGE, "unknown"),
     (126.0, Channel.STATIC_FIELD, "effect")],
)  # fmt: skip
def test_what_explains_less_than_it_leaves_is_not_all(chi2, channel, verdict):
    """The excess is 50; draws are predicted from other frames only in part."""
    first = ranking(0.9)
    explanation = replace(first.findings[0].explanation, chi2=chi2, channel=channel)
    first = replace(first, findings=(replace(first.findings[0], explanation=explanation),))
    assert verdict_of(first, first, True) == verdict


def test_what_ends_at_its_range_and_leaves_structure_is_a_stand_in():
    calm = replace(ranking(0.9), base=SimpleNamespace(chi2=100.0, white_reduced_chi2=0.0), findings=())
    for at_end, left, verdict in ((True, 0.2, "unknown"), (True, 0.0, "effect"), (False, 0.2, "effect")):
        best = ranking(0.9, left).best
        explanation = replace(best.explanation, chi2=120.0)
        best = replace(best, explanation=explanation, checks=replace(best.checks, at_range_end=at_end))
        assert verdict_of(replace(ranking(0.9), findings=(best,)), calm, True) == verdict


@pytest.mark.parametrize(("sigmas", "verdict"), [(3.9, "effect"), (4.1, "unknown")])
def test_a_name_beside_a_calibration_that_nobody_would_have_made_is_a_stand_in(sigmas, verdict):
    """It leaves no structure, and nothing above the noise: the focal length paid for that."""
    first = ranking(0.9)
    best = replace(first.best, checks=replace(first.best.checks, prior_sigmas=sigmas))
    first = replace(first, findings=(best,))
    last = replace(first, base=SimpleNamespace(chi2=100.0, white_reduced_chi2=0.0), findings=())
    strained = replace(last, base_checks=replace(last.base_checks, prior_sigmas=sigmas))
    assert verdict_of(first, strained, True) == verdict
    assert verdict_of(first, last, True) == "effect"  # a further effect mended it
    assert verdict_under(kept(first), THRESHOLDS)[0] == verdict


@pytest.mark.parametrize(
    ("formula_nats", "varying", "verdict"), [(90.0, 0.3, "unknown"), (70.0, 0.3, "effect"), (90.0, 0.1, "effect")]
)
def test_a_random_field_stands_in_for_a_formula_that_gains_more_but_is_not_the_same_everywhere(
    formula_nats, varying, verdict
):
    first = ranking(0.9)
    field = replace(first.best, explanation=replace(first.best.explanation, channel=Channel.STATIC_FIELD))
    shift = replace(first.best.explanation, effect=SimpleNamespace(id="shift"))
    varying_effect = Finding(
        shift, Score(formula_nats, 0.9, 0.4, 1.0), Checks(varying_reduced_chi2=varying, structure_reduced_chi2=0.0)
    )
    both = replace(first, findings=(field, varying_effect))
    assert verdict_of(both, both, True) == verdict
    best = replace(first.best, score=replace(first.best.score, nats=200.0))  # which gains more than either
    three = replace(first, findings=(best, field, varying_effect))
    assert verdict_of(three, three, True) == "effect"
    assert verdict_under(kept(both), THRESHOLDS)[0] == verdict


def test_only_shapes_end_at_their_range():
    length = Parameter("length_m", "m", neutral=0.003, low=0.0002, high=0.03, typical=0.002)
    share = Parameter("fraction", "1", neutral=0.0, low=0.0, high=1.0, typical=0.4)
    assert [is_at_end(length, x) for x in (0.03, 0.0002, 0.0294, 0.003)] == [True, True, False, False]
    assert not is_at_end(share, 1.0)


def test_nothing_is_added_to_noise_where_the_images_are_at_its_floor():
    noise = replace(ranking(0.9).best.explanation, channel=Channel.NOISE_MODEL, repeats_reduced_chi2=0.3)
    finding = Finding(noise, Score(80.0, 0.9, 0.4, 1.0))
    for chi2, whole in ((120.0, True), (180.0, False)):
        first = replace(ranking(0.9), base=SimpleNamespace(chi2=chi2, white_reduced_chi2=0.0))
        assert lacks_nothing(first, finding) is whole
        assert not lacks_nothing(first, first.best)


def test_every_gate_says_its_value_unit_and_source():
    table = thresholds_table().splitlines()[2:]
    assert len(table) == len(fields(THRESHOLDS))
    for line, threshold in zip(table, fields(THRESHOLDS), strict=True):
        name, value, unit, decides, source, moves = (cell.strip() for cell in line.strip("|").split("|"))
        assert name == f"`{threshold.name}`" and float(value) == pytest.approx(
            getattr(THRESHOLDS, threshold.name), rel=1e-5
        )
        assert decides and source and moves and threshold.metadata["unit"] in (unit, "1")


def test_shares_are_told_in_words():
    assert [share_words(x) for x in (0.2, 0.1, 0.03)] == ["a fifth", "a tenth", "3 %"]
