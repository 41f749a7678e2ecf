# SPDX-License-Identifier: Apache-2.0
"""The law of decision on findings that are written down, of two views."""

import json
from dataclasses import replace

import numpy as np
import pytest

from activestereo.diagnose.decision.law import Law, decide, posterior
from activestereo.diagnose.decision.records import Findings, Freedom, ModelRecord

ONE = Freedom((1.0,), (-1.8,), ((1e4,),))


def model(*effects: str, left: float, structure: float = 0.0, **more) -> ModelRecord:
    """left: mean square that the model leaves in each view; structure: what a discrepancy explains of that."""
    of_model = {"strain": 0.0, "freedom": ONE if effects else None, "left_out": (left,) * 2} | more
    return ModelRecord(
        effects, "expected image" if effects else "", (left,) * 2, structure=(structure,) * 2, **of_model
    )


def findings(*models: ModelRecord, unsteady: float = 0.0, plain: float = 0.0) -> Findings:
    return Findings(0.0, unsteady, plain, 40, True, 1e4, models)


NOTHING = findings(model(left=1.005, structure=0.002), model("blur", left=1.004, structure=0.002))
BLUR = findings(
    model(left=1.9, structure=0.8),
    model("blur", left=1.01, structure=0.005, closed_low=0.9),
    model("haze", left=1.6, structure=0.5, closed_low=0.2),
)
ELSE = findings(model(left=1.9, structure=0.8), model("blur", left=1.5, structure=0.45, closed_low=0.3))
TWO = findings(
    model(left=1.9, structure=0.8),
    model("blur", left=1.01, structure=0.005, closed_low=0.9),
    model("haze", left=1.012, structure=0.005, closed_low=0.9),
)


@pytest.mark.parametrize(
    ("found", "verdict", "named"),
    [(NOTHING, "none", ()), (BLUR, "effect", ("blur",)), (ELSE, "unknown", ()), (TWO, "effect", ("blur",))],
)
def test_what_is_said_is_what_is_likely(found, verdict, named):
    said = decide(Law(), Findings.of_json(json.loads(json.dumps(found.as_json()))))
    assert (said.verdict, said.named) == (verdict, named)
    given = said.posterior
    assert sum(given.known.values()) + sum(given.unknown.values()) == pytest.approx(1.0)
    assert {"none": given.none, "unknown": given.something_else, "effect": given.known.get(("blur",), 0.0)}[
        verdict
    ] > 0.3
    assert said.equivalent.get("blur", ()) == (("haze",) if found is TWO else ())


def test_a_name_is_given_at_the_rate_of_false_names_that_is_asked_for():
    weak = findings(model(left=1.12, structure=0.02), model("blur", left=1.065, structure=0.005, closed_low=0.9))
    sure = posterior(Law(), weak).known[("blur",)]
    assert 0.5 < sure < 0.999
    for alpha, verdict in ((1.1 * (1.0 - sure), "effect"), (0.9 * (1.0 - sure), "none")):
        assert decide(Law(alpha=alpha), weak).verdict == verdict


def test_what_removes_less_than_is_asked_for_has_no_name():
    assert decide(Law(least_share=0.91), BLUR).named == ()


def test_what_predicts_other_views_worse_than_nothing_does_has_no_name():
    base, blur, haze = BLUR.models
    stand_in = replace(blur, left_out=(1.95, 1.95))
    assert decide(Law(), replace(BLUR, models=(base, stand_in, haze))).named == ()


def test_a_view_counts_as_the_pixels_that_the_discrepancy_allows():
    """The odds of two models of one freedom are those of 2 / discrepancy pixels of each view."""
    for law in (Law(discrepancy=0.01), Law(discrepancy=0.04)):
        known = posterior(law, TWO).known
        odds = np.log(known["blur",] / known["haze",])
        assert odds == pytest.approx(len(TWO.models[0].left) * np.log(1.012 / 1.01) / law.discrepancy)


def test_one_view_is_enough_for_something_else():
    base = replace(model(left=1.1, structure=0.0), left=(1.0, 1.3), structure=(0.0, 0.25))
    assert decide(Law(), findings(base)).verdict == "unknown"


@pytest.mark.parametrize("shown", [{"unsteady": 0.2}, {"plain": 1.0}])
def test_what_no_scene_error_leaves_is_something_else_where_nothing_is_named(shown):
    calm = model(left=1.02, structure=0.005)
    assert decide(Law(), findings(calm)).verdict == "none"
    assert decide(Law(), findings(calm, **shown)).verdict == "unknown"
    told = decide(Law(), replace(BLUR, **shown))  # of other models it is not known
    assert told.named == ("blur",)


def test_without_a_floor_nothing_unnamed_is_told():
    assert decide(Law(), replace(ELSE, has_floor=False)).verdict == "undetermined"
    assert decide(Law(), replace(BLUR, has_floor=False)).verdict == "effect"


def test_a_second_effect_is_added_by_other_weights():
    """The second step's noise is another: its models are compared with their own base."""
    first = (model(left=2.6, structure=1.4), model("blur", left=1.8, structure=0.6, closed_low=0.4))
    base = replace(model("blur", left=3.6, structure=1.2), channel="")
    second = (base, model("blur", "haze", left=2.02, structure=0.01, closed_low=0.4))
    both = decide(Law(), findings(*first, *second))
    assert (both.verdict, sorted(both.named)) == ("effect", ["blur", "haze"])
    assert decide(Law(), findings(*first)).verdict == "unknown"


def test_parameters_that_the_data_hardly_tell_cost_less_where_they_are_left_neutral():
    """Three models fit alike: the one that needs two parameters is behind, the one that could do without is not."""
    both = Freedom((1.0, 1.0), (-1.8, -1.8), ((1e4, 0.0), (0.0, 1e4)))
    spare = replace(both, away=(1.0, 1e-4))
    one, two, idle = (model(name, left=1.01, freedom=f) for name, f in (("one", ONE), ("two", both), ("idle", spare)))
    known = posterior(Law(), findings(model(left=1.9, structure=0.8), one, two, idle)).known
    assert known["two",] < 0.05 * known["one",] and known["idle",] == pytest.approx(known["one",], rel=0.01)
