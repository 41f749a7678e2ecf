# SPDX-License-Identifier: Apache-2.0
"""Effects and the rig's correction share out one change: which effect gets its name, and when no name is sure."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.diagnose.dictionary import Atom
from activestereo.diagnose.evidence import NuisancePrior
from activestereo.diagnose.fitter import Fitter
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.outcome import strain
from activestereo.diagnose.pixels import SCALES
from activestereo.diagnose.search import Search
from activestereo.diagnose.selection import most_like_rig
from activestereo.effects import Model, builtin

EFFECTS = builtin()


@pytest.mark.parametrize(
    ("spared", "left", "gain", "named"),
    [(12.0, 1.0, 9.0, True), (9.0, 0.9, 9.0, False), (30.0, 1.1, 9.0, False), (30.0, 1.0, 5.0, False)],
)
def test_an_effect_takes_the_place_of_a_rigs_correction_only_where_the_images_need_none_beside_it(
    monkeypatch, spared, left, gain, named
):
    """A rig that was measured wrong shows again beside the effect, or the effect leaves more structure."""
    effect = EFFECTS["pattern_scale_drift"]
    monkeypatch.setattr("activestereo.diagnose.search.most_like_rig", lambda *_: (effect, effect.typical_values))
    monkeypatch.setattr("activestereo.diagnose.search.local_structure", lambda rows: rows)
    search = SimpleNamespace(
        _names=[], _pixels=1000, _numbers=NUMBERS, _floor=lambda has_share: 7.0, _effects=[*EFFECTS.values()],
        _evidence=SimpleNamespace(geometry=SimpleNamespace(is_as_stated=lambda: False)),
        _fitter=SimpleNamespace(rig_penalty=lambda penalty: penalty, refine=lambda *_: None), _structure=1.0,
        _solution=SimpleNamespace(model=Model(), phi=None), _rounds=[None], _chi2=1000.0,
        _is_full=lambda: False, _is_open=lambda effect: True, _draw_again=lambda: None,
        _without=lambda name: SimpleNamespace(sums=SimpleNamespace(total=1000.0 + gain)),
    )  # fmt: skip
    search._fitter.rig_penalty = lambda solution: 31.0 if solution is before else 31.0 - spared
    before = search._solution
    search._accept = lambda fit: vars(search).update(_solution=SimpleNamespace(), _rows=left)
    dictionary = SimpleNamespace(atoms=[SimpleNamespace(effect=effect)], linear=None, columns=None)
    assert Search._name_in_place_of_rig(search, dictionary) == named
    assert [n.id for n in search._names] == [effect.id] * named
    assert (search._solution is before) != named


def test_the_effect_most_like_a_rigs_correction_has_the_size_of_its_image_change():
    rng = np.random.Generator(np.random.PCG64(5))
    rows = rng.standard_normal((SCALES + 9, 400)).astype(np.float32)
    rows[SCALES + 2] *= 100.0  # an albedo is no part of the rig
    stated = NuisancePrior(np.array([-2.0, 0.0, 0.5, -1.0, *[0.0] * 5]), np.ones(9), 1)
    linear = SimpleNamespace(
        fitter=Fitter([], stated, 1), nuisances=rows,
        solution=SimpleNamespace(theta=[], phi=np.array([1.0, 1.0, 0.0, *[0.0] * 9])),
    )  # fmt: skip
    correction = 2.0 * rows[SCALES] + rows[SCALES + 3]
    drift, tilt = EFFECTS["pattern_scale_drift"], EFFECTS["imager_tilt"]
    atoms = [
        Atom(e, e.neutral_values, ((e.parameters[0].name, 0.001),), (True,), (1.0,), k)
        for k, e in enumerate((tilt, drift))
    ]
    columns = np.stack([rng.standard_normal(400), correction / 4.0]).astype(np.float32)
    effect, values = most_like_rig(linear, atoms, columns)
    assert effect is drift and values["scale"] == pytest.approx(0.004, rel=1e-3) and values["per_k"] == 0.0


@pytest.mark.parametrize(
    ("names", "penalty", "expected"),
    [
        (["imager_tilt"], 98.7, 12.0),  # a sheared pattern: the search finds another rig and a tilted imager
        (["subsurface", "pattern_scale_drift"], 98.7, 12.0),
        (["baseline_drift"], 23.7, 2.9),  # a world whose rig needs 20.8 also where nothing is hidden
        (["imager_tilt"], 32.9, 4.0),  # as probable as one deviation of 4
        (["response_gamma"], 98.7, 1.5),
        (["subsurface"], 98.7, 0.0),
    ],
)
def test_a_name_of_geometry_beside_an_improbable_rig_is_not_sure(names, penalty, expected):
    fitter = SimpleNamespace(rig_penalty=lambda _: penalty, prior_sigmas=lambda *_: 1.5)
    named = [SimpleNamespace(effect=EFFECTS[id]) for id in names]
    assert strain(named, None, fitter, None, None, NUMBERS) == pytest.approx(expected, abs=0.05)


def test_a_rigs_penalty_counts_focal_lengths_and_the_projector_and_neither_albedos_nor_views():
    sigma = np.array([6e-4, 6e-4, 0.03, *[1e-3] * 6, *[1.5e-3] * 6])
    fitter = Fitter([], NuisancePrior(np.zeros(15), sigma / 2.0, 1, weighed_up=4.0), 1)
    off = np.array([1.0, 2.0, 50.0, 3.0, *[0.0] * 5, *[50.0] * 6])
    solution = SimpleNamespace(phi=np.concatenate([np.zeros(SCALES), off * sigma]))
    assert fitter.rig_penalty(solution) == pytest.approx(1.0 + 4.0 + 9.0)
