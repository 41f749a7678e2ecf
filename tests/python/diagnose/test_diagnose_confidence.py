# SPDX-License-Identifier: Apache-2.0
"""Confidences: what may be named shares nearly all, the depth engine's faults are no rivals of what the images lack."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects import Parameter
from activestereo.effects.core.judging import Channel
from activestereo.diagnose.channels.depth_engine import pose_error_nats
from activestereo.diagnose.findings import BaseChecks, Checks, Explanation, Finding, Ranking, Remainder, Score
from activestereo.diagnose.thresholds import THRESHOLDS
from activestereo.diagnose.refine import Fitter
from activestereo.diagnose.evidence.observation import NuisancePrior
from activestereo.diagnose.refine.light import SCALES
from activestereo.diagnose.score.intervals import interval
from activestereo.diagnose.verdict import confidence
from activestereo.diagnose.verdict.completeness import is_unexplained
from activestereo.diagnose.verdict.confidence import confidences, equivalents


def entry(name, chi2, channel=Channel.EXPECTED_IMAGE, occam=0.0, nats=0.0, share=0.0):
    explanation = Explanation(SimpleNamespace(id=name), channel, {}, chi2, np.zeros(1))
    return Finding(explanation, Score(nats, share, 0.0, 1.0, occam_nats=occam))


def sized(name, nats, chi2, plain_reduced_chi2, at_end=False):
    """A finding of 0.1 noise variances by its weights, and of others in DN."""
    explanation = Explanation(SimpleNamespace(id=name), Channel.EXPECTED_IMAGE, {}, chi2, np.zeros(1))
    checks = Checks(plain_share=plain_reduced_chi2, plain_reduced_chi2=plain_reduced_chi2, at_range_end=at_end)
    return Finding(explanation, Score(nats, 0.5, 0.1, 1.0), checks)


def ranking_of(findings, base_chi2=900.0, pixels=100, base_structure=None):
    base = SimpleNamespace(chi2=base_chi2, white_reduced_chi2=0.0)
    return Ranking(
        base, BaseChecks(structure_reduced_chi2=base_structure), tuple(findings), (), pixels, 1.0, 100.0, THRESHOLDS
    )


def judged(monkeypatch, entries, may_be_named):
    monkeypatch.setattr(confidence, "passes", lambda _, e: e.id in may_be_named)
    return confidences(ranking_of(entries))


def test_a_fault_of_the_depth_engine_takes_nothing_from_what_the_images_lack(monkeypatch):
    found = judged(
        monkeypatch,
        [entry("shutter", 101.0), entry("blur", 800.0), entry("locking", 50.0, Channel.DEPTH_ENGINE)],
        {"shutter", "locking"},
    )
    assert found["shutter"] == pytest.approx(0.97)
    assert found["locking"] == pytest.approx(0.97)
    assert found["blur"] < 0.05


def test_what_explains_alike_shares(monkeypatch):
    found = judged(
        monkeypatch, [entry("laser", 110.0), entry("grating", 110.0), entry("blur", 800.0)], {"laser", "grating"}
    )
    assert found["laser"] == found["grating"] == pytest.approx(0.485)


def test_of_what_explains_alike_the_simpler_is_likelier(monkeypatch):
    found = judged(
        monkeypatch, [entry("level", 110.0, occam=-9.0), entry("dark", 110.0, occam=-12.0)], {"level", "dark"}
    )
    assert found["level"] / found["dark"] == pytest.approx(np.exp(3.0), rel=1e-3)


def test_of_what_leaves_alike_the_better_fit_is_likelier_by_less_than_its_likelihood_says(monkeypatch):
    found = judged(
        monkeypatch, [entry("shutter", 110.0, nats=460.0), entry("delay", 110.0, nats=400.0)], {"shutter", "delay"}
    )
    assert found["shutter"] / found["delay"] == pytest.approx(np.exp(3.0), rel=1e-3)


def test_what_is_far_behind_shares_what_the_named_leave(monkeypatch):
    found = judged(monkeypatch, [entry("haze", 101.0, nats=90000.0), entry("blur", 880.0, share=0.4)], {"haze"})
    assert found["haze"] == pytest.approx(0.97) and found["blur"] == pytest.approx(0.4 * 0.03)


def test_where_nothing_may_be_named_none_takes_part(monkeypatch):
    blurs = entry("blur", 860.0, share=0.3), entry("defocus", 870.0, share=0.2)
    found = judged(monkeypatch, [*blurs, entry("locking", 50.0, Channel.DEPTH_ENGINE)], set())
    assert found == pytest.approx({"blur": 0.25, "defocus": 0.2 / 1.2, "locking": 0.0})  # none: 0.7 of 1.2


def test_what_formulas_lack_widens_a_shapes_interval_by_its_value_and_a_choices_not_at_all():
    focus, strength = (
        Parameter(name, "m", neutral=neutral, low=0.0, high=5.0, typical=1.0)
        for name, neutral in (("focus", 1.0), ("strength", 0.0))
    )
    (_, low, high), (_, other_low, other_high) = interval(focus, 1.5, 0.0), interval(strength, 1.5, 0.0)
    assert high - low == pytest.approx(other_high - other_low)
    place = Parameter("place", "bits", neutral=0.0, low=0.0, high=8.0, typical=1.0, choice=True)
    assert interval(place, 3.0, 1.0) == (3.0, 3.0, 3.0)


@pytest.mark.parametrize(("nats", "offset_px"), [(19.5, 0.6), (150.0, 1.8), (0.5, 3.0)])
def test_what_misplaced_cameras_explain_is_no_fault_of_the_depth_engine(nats, offset_px):
    pose_error_px = 0.27
    tried = np.linspace(0.0, offset_px, 20001)
    likelihood = nats * (1.0 - (1.0 - tried / offset_px) ** 2)
    misplaced = (likelihood - 0.5 * (tried / pose_error_px) ** 2).max()
    assert pose_error_nats(nats, np.array([0.6, 0.8]) * offset_px, pose_error_px) == pytest.approx(misplaced, abs=1e-4)


def test_what_explains_little_of_the_error_in_dn_is_no_other_explanation():
    """Full wells show in the brightest pixels, whose weights are small: errors of the scene measurement gain as much
    elsewhere."""
    well, pattern = sized("well", 100.0, 120.0, 0.1), sized("pattern", 150.0, 119.0, 0.005)
    gamma = sized("gamma", 99.0, 120.0, 0.09)
    assert equivalents(ranking_of([well, pattern, gamma]), well) == ["gamma"]
    unseen = replace(pattern, checks=Checks())
    assert equivalents(ranking_of([well, unseen]), well) == ["pattern"]


def test_formulas_excuse_nothing_that_ends_at_its_range():
    level, dark = sized("level", 9000.0, 120.0, 0.1), sized("dark", 8900.0, 120.1, 0.1)
    assert equivalents(ranking_of([level, dark]), level) == ["dark"]
    assert equivalents(ranking_of([level, replace(dark, checks=replace(dark.checks, at_range_end=True))]), level) == []


@pytest.mark.parametrize(("excess", "structure", "unknown"), [(0.3, 0.05, False), (0.3, 0.2, True), (1.2, 0.05, True)])
def test_unknown_is_what_has_structure_or_is_more_than_scene_errors_leave(excess, structure, unknown):
    left = Remainder(100.0 * (1.0 + excess), 0.0, structure)
    assert is_unexplained(ranking_of([]), left) is unknown
    first = ranking_of([], base_structure=0.05)
    named = Remainder(100.0 * (1.0 + excess), 0.0, 0.05)
    assert not is_unexplained(first, named, first)  # by structure and size


def test_how_far_a_fit_takes_calibration_and_measurement_counts_the_farthest_in_its_own_deviations():
    fitter = Fitter([], NuisancePrior(np.zeros(3), np.array([6e-4, 6e-4, 0.03]), 1, 0.03), 1)
    phi = np.array([5.0, 9.0, 20.0, 6e-4, -1.8e-3, 0.06])  # scales and black level have no prior
    assert fitter.prior_sigmas(SimpleNamespace(phi=phi)) == pytest.approx(3.0)
    base = SimpleNamespace(phi=np.array([5.0, 9.0, 20.0, 0.0, -1.2e-3, 0.06]))
    assert fitter.prior_sigmas(SimpleNamespace(phi=phi), base) == pytest.approx(1.0)  # what goes beyond the base's
    weighed_up = NuisancePrior(np.zeros(3), np.array([6e-4, 6e-4, 0.03]) / 5.0, 1, 0.03, weighed_up=25.0)
    assert Fitter([], weighed_up, 1).prior_sigmas(SimpleNamespace(phi=phi)) == pytest.approx(3.0)  # as stated
    nothing = NuisancePrior(np.array([]), np.array([]), 0, 0.03)
    assert Fitter([], nothing, 1).prior_sigmas(SimpleNamespace(phi=phi[:SCALES])) == 0.0


def test_what_a_scene_measurement_may_have_wrong_widens_an_interval():
    """An effect and a focal length that move the images alike: the data tell their sum, the scene measurement one of
    them."""
    sigma, weight = 6e-4, 1e10
    fitter = Fitter([], NuisancePrior(np.zeros(2), np.array([sigma, sigma]), 0, 0.03), 1)
    size = 1 + SCALES + 2
    alike = np.zeros(size)
    alike[[0, 1 + SCALES]] = 1.0, 1.0  # of the effect's parameter and the left camera's focal length
    gram = weight * np.outer(alike, alike) + np.diag([0.0, *[weight] * SCALES, 0.0, weight])
    space = SimpleNamespace(fixed=np.array([False]), low=np.array([-1.0]), high=np.array([1.0]))
    sums = SimpleNamespace(gram=gram[None], block_moment={"left": np.zeros((size, 1))})
    deviation = np.sqrt(fitter.covariance(SimpleNamespace(theta=np.zeros(1), space=space, sums=sums))[0, 0])
    assert deviation == pytest.approx(sigma, rel=0.01)
