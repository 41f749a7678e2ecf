# SPDX-License-Identifier: Apache-2.0
"""Which effects are added beside others: all are tried again, and no confounder of another."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects import Model, builtin
from activestereo.effects.core.judging import Channel
from activestereo.diagnose import greedy as module
from activestereo.diagnose.findings import BaseChecks, Checks, Explanation, Finding, Ranking, Score
from activestereo.diagnose.thresholds import THRESHOLDS

FIRST, SECOND = builtin()["subsurface"], builtin()["saturation_blooming"]


def finding(effect, model, gain, at_end=False):
    """A finding that explains nearly all that its base leaves."""
    solution = SimpleNamespace(model=model.with_effect(effect), phi=None, values_of=lambda _: np.zeros(1))
    explanation = Explanation(effect, Channel.EXPECTED_IMAGE, {}, 100.0, np.array([100.0]), solution=solution)
    return Finding(explanation, Score(1000.0, 1.0, gain, 1.0), Checks(at_range_end=at_end))


def base_of(model, chi2):
    return SimpleNamespace(
        model=model, chi2=chi2, white_reduced_chi2=0.0, tile_chi2=np.array([chi2]), train=(), test=()
    )


@pytest.mark.parametrize(("at_end", "added"), [(False, 2), (True, 1)])
def test_a_second_effect_is_sought_however_little_the_first_one_leaves(monkeypatch, at_end, added):
    chi2_of = {0: 500.0, 1: 104.0, 2: 100.0}
    bases = lambda model, phi=None: base_of(model, chi2_of[len(model.effects)])  # noqa: E731

    def rank(context, base, candidates, *_):
        offered = [c for c in candidates if c.id not in {e.id for e, _ in base.model.effects}]
        found = [finding(e, base.model, 0.04, at_end) for e in offered]
        return Ranking(base, BaseChecks(), tuple(found), (), 100, 1.0, 100.0, THRESHOLDS)

    context = SimpleNamespace(
        thresholds=THRESHOLDS, evidence=SimpleNamespace(train=[SimpleNamespace(tile=np.zeros((2, 2), int))])
    )
    monkeypatch.setattr(module, "rank", rank)
    monkeypatch.setattr(module, "bare_ranking", lambda context, base: rank(context, base, ()))
    monkeypatch.setattr(module, "_without_drift", lambda context, bases, base: (context, bases))
    monkeypatch.setattr(module, "_swapped", lambda context, bases, model, *_: model)
    first = Ranking(bases(Model()), BaseChecks(), (finding(FIRST, Model(), 3.96),), (), 100, 1.0, 100.0, THRESHOLDS)
    monkeypatch.setattr(module, "_exceeds_formulas", lambda *_: True)
    monkeypatch.setattr(module, "_pruned", lambda context, bases, model, *_: model)
    steps = module.greedy(context, bases, first, [FIRST, SECOND])
    assert len(steps[-1].added) == added


@pytest.mark.parametrize(
    ("added", "chi2", "may_add"), [((), 99.0, True), (("haze",), 85.0, True), (("haze",), 86.0, False)]
)
def test_beside_other_effects_draws_too_gain_more_than_formulas_may_have_left(added, chi2, may_add):
    """The added effects explain 395; draws gain 5 % of it, 19.75, where formulas may miss some."""
    draws = Explanation(builtin()["prnu"], Channel.STATIC_FIELD, {}, chi2, np.array([chi2]))
    start, last = (
        Ranking(base_of(Model(), left), BaseChecks(), (), (), 10000, 1.0, 100.0, THRESHOLDS) for left in (500.0, 105.0)
    )
    context = SimpleNamespace(evidence=SimpleNamespace(train=[SimpleNamespace(tile=np.zeros((2, 2), int))]))
    step = module.Step(added, last, context, start)
    assert step.may_add(Finding(draws, Score(100.0, 1.0, 0.1, 1.0))) is may_add


STAND_IN, RIVAL = builtin()["veiling_glare"], builtin()["haze"]
# chi2 of what is fitted beside a kept effect; the first of a list comes first in the ranking.
LOSES, EQUAL = 200.0, 100.0


@pytest.mark.parametrize(
    ("rival_chi2", "comes_first", "answer", "asked_beside"),
    [
        # It comes first beside the later effect: it takes the place, and the later effect is asked about again.
        (EQUAL, True, {"saturation_blooming", "haze"}, ["saturation_blooming", "haze"]),
        # It does not come first, or it comes first but leaves more: nothing changes, and the last one stands.
        (EQUAL, False, {"veiling_glare", "saturation_blooming"}, ["saturation_blooming"]),
        (LOSES, True, {"veiling_glare", "saturation_blooming"}, ["saturation_blooming"]),
    ],
)
def test_an_earlier_effect_gives_way_to_a_rival_that_is_likelier_beside_the_later_one(
    monkeypatch, rival_chi2, comes_first, answer, asked_beside
):
    asked = []

    def rank(context, base, candidates, *_):
        [kept] = (e.id for e, _ in base.model.effects)
        offered = {c.id for c in candidates}
        asked.append(kept)
        assert kept not in offered
        found = [finding(e, base.model, 1.0) for e in (SECOND, STAND_IN) if e.id in offered]
        if RIVAL.id in offered:
            rival = finding(RIVAL, base.model, 1.0)
            rival = replace(rival, explanation=replace(rival.explanation, chi2=rival_chi2))
            found.insert(0 if comes_first else len(found), rival)
        return Ranking(base, BaseChecks(), tuple(found), (), 100, 1.0, 100.0, THRESHOLDS)

    monkeypatch.setattr(module, "rank", rank)
    model = Model().with_effect(STAND_IN).with_effect(SECOND)
    bases = lambda model, phi=None: base_of(model, 104.0)  # noqa: E731
    out = module._swapped(SimpleNamespace(thresholds=THRESHOLDS), bases, model, [STAND_IN, SECOND, RIVAL], 0, None)
    assert {e.id for e, _ in out.effects} == answer and asked == asked_beside


def test_effects_that_were_given_are_never_swapped(monkeypatch):
    monkeypatch.setattr(module, "rank", None)  # calling it would raise
    model = Model().with_effect(STAND_IN).with_effect(SECOND)
    assert module._swapped(SimpleNamespace(thresholds=THRESHOLDS), None, model, [RIVAL], given=1, phi=None) is model
