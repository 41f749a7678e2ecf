# SPDX-License-Identifier: Apache-2.0
"""The parts of a search: columns, sets, what a ranking tells of a round, and the verdict."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.capture.capture import SIDES, SPLITS
from activestereo.diagnose.ranking import ranking_of
from activestereo.diagnose.diagnosis import _add_test_errors
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.goodness import Interval
from activestereo.diagnose.dictionary import carried
from activestereo.diagnose.search import Name, Round
from activestereo.diagnose.refit import Refit
from activestereo.diagnose.selection import credible
from activestereo.diagnose.verdict import (
    EFFECT,
    NONE,
    UNDETERMINED,
    UNKNOWN,
    Remainder,
    probability_right,
    verdict_of,
)
from activestereo.effects import builtin
from activestereo.effects.core.descriptor import Lever

EFFECTS = builtin()


def test_columns_follow_their_pixels_to_another_fitter():
    """A capture that stands elsewhere sees other surfaces, and keeps the same pixels in another order."""
    first = fitter_of([0, 1, 2, 3], [1.0, 1.0, 2.0, 2.0])
    other = fitter_of([2, 0, 3, 5], [4.0, 1.0, 2.0, 1.0])
    columns = np.array([[10.0, 11.0, 12.0, 13.0]], np.float32)
    assert carried(columns, first, other).tolist() == [[24.0, 10.0, 13.0, 0.0]]


def fitter_of(index, root_weight):
    """As much of a Fitter as columns are carried by."""
    measured = SimpleNamespace(size=6)
    pixels = SimpleNamespace(
        index=np.array(index), root_weight=np.array(root_weight), observation=SimpleNamespace(measured=measured)
    )
    return SimpleNamespace(pixels=lambda: [pixels])


def test_what_a_name_cannot_be_told_from_has_the_figures_of_its_own_round():
    """A name of an earlier round may have gone as needless."""
    vignetting = EFFECTS["vignetting"]
    rounds = round_of(200.0, radial_distortion=150.0, projector_vignetting=190.0), round_of(150.0, vignetting=100.0,
        projector_vignetting=110.0)  # fmt: skip
    found = {p.name: Interval(p.typical, p.low, p.high, p.unit) for p in vignetting.parameters}
    outcome = SimpleNamespace(
        names=(Name(vignetting, {"vignetting": 0.8, "projector_vignetting": 0.2}, 0.5, seen=rounds[1]),),
        rounds=rounds,
        noise={"vignetting": SimpleNamespace(effect=vignetting, nats=0.0, parameters=found)},
        first=fitted("vignetting", 200.0),
        solution=fitted("vignetting", 100.0),
        fitter=SimpleNamespace(observations=[SimpleNamespace(pixels=100)], tile_pixels=lambda: np.full(4, 25)),
        rest=Remainder(1.0, 0.0, 0.0, 1.0),
    )
    twin = ranking_of(outcome, NUMBERS, True, str)[1]
    assert (twin["effect"], twin["equivalent"]) == ("projector_vignetting", ["vignetting"])
    assert twin["gain_reduced_chi2"] == pytest.approx((150.0 - 110.0) / 100)


def round_of(chi2, **fits):
    return Round({}, {}, chi2, 0.0, 0.0, {name: Refit(fitted(name, total)) for name, total in fits.items()})


def fitted(name, chi2):
    """As much of a Solution as a ranking looks at."""
    sums = SimpleNamespace(total=chi2, tile_chi2=np.full(4, chi2 / 4))
    neutral = np.array([p.neutral for p in EFFECTS[name].parameters])
    return SimpleNamespace(sums=sums, effects=[EFFECTS[name]], theta=neutral)


@pytest.mark.parametrize(
    "rest, named, floor, verdict",
    [
        (Remainder(0.0, 0.02, 0.01, 0.01), False, True, NONE),
        (Remainder(0.0, 0.02, 0.01, 0.01), False, False, UNDETERMINED),
        (Remainder(0.0, 0.7, 0.01, 0.01), False, True, UNKNOWN),
        (Remainder(0.0, 0.3, 0.2, 0.2), False, True, UNKNOWN),
        (Remainder(0.0, 0.02, 0.01, 0.01, strain=3.0), False, True, NONE),
        (Remainder(0.0, 0.02, 0.01, 0.01, strain=9.0), False, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6), True, False, EFFECT),
        (Remainder(0.0, 0.3, 0.01, 0.01), True, True, EFFECT),
        (Remainder(0.0, 0.7, 0.01, 0.01), True, True, UNKNOWN),
        (Remainder(0.8, 0.1, 0.07, 0.4), True, True, EFFECT),
        (Remainder(0.8, 0.1, 0.07, 0.4, names=3), True, True, UNKNOWN),
        (Remainder(2.7, -0.4, 0.001, -0.013), True, True, EFFECT),
        (Remainder(0.04, 0.0, 0.03, 0.03, drawn=0.04), True, True, EFFECT),
        (Remainder(0.04, 0.5, 0.03, 0.03, drawn=0.04), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, test_explained=0.9, test_left=0.5), True, True, EFFECT),
        (Remainder(0.8, 0.02, 0.01, 0.6, test_explained=0.3, test_left=0.4), True, True, UNKNOWN),
        (Remainder(0.0, 0.02, 0.01, 0.01, test_left=0.2), False, True, NONE),
        (Remainder(0.0, 0.02, 0.01, 0.01, test_left=0.6), False, True, UNKNOWN),
        (Remainder(0.2, 0.4, 0.0, 0.1), True, True, UNKNOWN),
        (Remainder(0.34, 0.3, 0.0, 0.1, drawn=0.07), True, True, UNKNOWN),
        (Remainder(0.1, 0.08, 0.04, 0.07), True, True, UNKNOWN),
        (Remainder(0.1, 0.08, 0.04, 0.07, test_explained=0.1, test_left=0.1), True, True, EFFECT),
        (Remainder(0.1, 0.08, 0.04, 0.07, test_explained=0.1, test_left=0.3), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, test_explained=0.1, test_left=0.13), True, True, UNKNOWN),
        (Remainder(0.38, 0.13, 0.09, 0.43, test_explained=0.64, test_left=0.44), True, True, UNKNOWN),
        (Remainder(0.34, 0.36, 0.01, 0.1, drawn=0.07), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, strain=5.0), True, True, UNKNOWN),
        (Remainder(0.8, 0.02, 0.01, 0.6, is_full=True), True, True, UNKNOWN),
    ],
)
def test_the_verdict_follows_from_what_is_explained_and_left(rest, named, floor, verdict):
    assert verdict_of(rest, named, floor, NUMBERS) == verdict


@pytest.mark.parametrize("left, denies", [(1.0, False), (3.0, True)])
def test_test_frames_deny_names_beside_draws_of_their_own(left, denies):
    """Each frame has its own draws, which no model foretells: what they leave grows as the square of the light, here
    fourfold, and says nothing."""
    rest = Remainder(0.5, 0.02, 0.01, 0.6, drawn=0.1)
    speckle = SimpleNamespace(random_terms=[SimpleNamespace(lever=Lever.SIGNAL)])
    names = [SimpleNamespace(id="speckle", field=1, effect=speckle), SimpleNamespace(id="vignetting", field=None)]
    solution = SimpleNamespace(nuisances=SimpleNamespace(black_dn=5.0))
    outcome = SimpleNamespace(rest=rest, names=names, noise=(), solution=solution)
    frames = [
        SimpleNamespace(id=i, split=split, projector_power=1.0, exposure_gain=1.0) for i, split in enumerate(SPLITS)
    ]
    keys = [(frame.id, side) for frame in frames for side in SIDES]
    after = SimpleNamespace(
        capture=SimpleNamespace(frames=frames),
        predictions={(number, side): np.full((4, 4), 5.0 + 10.0 * (1 + number)) for number, side in keys},
        layers={frame.id: dict.fromkeys(SIDES, SimpleNamespace(projector=np.ones((4, 4)))) for frame in frames},
    )
    figures = {"heldout_ir_rmse_geometry": (1.4 + left) ** 0.5, "heldout_ir_rmse_after": (1.0 + left) ** 0.5}
    figures |= {"heldout_noise_floor": 1.0, "train_noise_floor": 1.0}
    figures["curve"] = [{"train_ir_rmse": 1.25**0.5, "heldout_ir_rmse": (1.0 + left) ** 0.5}]
    found = _add_test_errors(outcome, SimpleNamespace(result=figures, after=after), NUMBERS)
    assert (found.test_left is not None) == denies
    assert (verdict_of(found, True, True, NUMBERS) == UNKNOWN) == denies


def test_a_name_is_stated_the_likelier_right_the_less_is_missing():
    stated = [probability_right(missing, True) for missing in (0.1, 0.4, 0.9, 1.5, 1e9)]
    assert stated == sorted(stated, reverse=True)
    assert 0.1 < stated[-1] < 0.3 and 0.98 < stated[0] < 1.0
    assert probability_right(0.5, False) > 0.5 > probability_right(1.5, False)


def test_a_set_ends_where_it_holds_its_mass():
    assert list(credible({"a": 0.0, "b": -0.1, "c": -9.0}, 0.95)) == ["a", "b"]
    assert list(credible({"a": 0.0, "b": -9.0}, 0.95)) == ["a"]
