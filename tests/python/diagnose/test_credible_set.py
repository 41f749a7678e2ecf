# SPDX-License-Identifier: Apache-2.0
"""Sets of effects that a recording cannot tell apart."""

from types import SimpleNamespace

import pytest

from activestereo.diagnose.credible_set import credible, parted
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.outcome import Name
from activestereo.diagnose.search import Search
from activestereo.effects import Model, builtin

EFFECTS = builtin()


def test_a_set_ends_where_it_holds_its_mass():
    assert list(credible({"a": 0.0, "b": -0.1, "c": -9.0}, 0.95)) == ["a", "b"]
    assert list(credible({"a": 0.0, "b": -9.0}, 0.95)) == ["a"]


def test_a_set_holds_no_other_effect_that_has_a_name_itself():
    sets = {"vignetting": {"vignetting": 0.6, "gain_error": 0.2, "prnu": 0.15}, "gain_error": {"gain_error": 0.95}}
    found = parted(sets)
    assert found["vignetting"] == {"vignetting": pytest.approx(0.76), "prnu": pytest.approx(0.19)}
    assert found["gain_error"] == sets["gain_error"]


def test_the_search_ends_with_sets_apart():
    names = [
        Name(EFFECTS["vignetting"], {"vignetting": 0.7, "prnu": 0.3}, 0.1),
        Name(EFFECTS["prnu"], {"prnu": 1.0}, 0.1),
    ]
    no, fit = lambda *_: False, SimpleNamespace(sums=SimpleNamespace(total=100.0), model=Model())
    found = SimpleNamespace(linear=SimpleNamespace(solution=fit))
    search = SimpleNamespace(
        _names=names, _dictionary=no, _moved=lambda _: found, _floor=no, _name_one=no,
        _name_in_place_of_rig=no, _widen_set_of_inexact=no,
        _first=fit, _solution=fit, _pixels=10, _excess=0.0, _structure=0.0, _structure_before=0.0, _numbers=NUMBERS,
        _is_full=no, _evidence=None, _fitter=SimpleNamespace(prior_sigmas=no), _rows=[], _noise={}, _unjudged={},
        _rounds=[],
    )  # fmt: skip
    assert [list(name.members) for name in Search.run(search).names] == [["vignetting"], ["prnu"]]


@pytest.mark.parametrize(
    ("left", "rivals"),
    [
        ({"room_projector": 110.0, "external_light": 244.0}, ["room_projector"]),  # of 300: gains of 190 and 56
        ({"room_projector": 110.0, "external_light": 170.0}, ["room_projector", "external_light"]),
        ({"prnu": 200.0, "external_light": 250.0}, ["prnu", "external_light"]),  # a field predicts a part of its draws
    ],
)
def test_few_parameters_do_not_outweigh_a_far_better_fit(left, rivals):
    search = SimpleNamespace(_chi2=300.0, _floor=lambda: 2.0, _numbers=NUMBERS, _effect=EFFECTS.get)
    assert list(Search._rivals(search, left, {"prnu": None})) == rivals
