# SPDX-License-Identifier: Apache-2.0
"""Stated deviations of nuisances and formulas: how far fits go from them, and by how much they widen intervals."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects import Parameter
from activestereo.diagnose.depth_engine import pose_error_nats
from activestereo.diagnose.evidence import NuisancePrior
from activestereo.diagnose.fitter import Fitter
from activestereo.diagnose.pixels import SCALES
from activestereo.diagnose.goodness import interval


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


def test_how_far_a_fit_takes_calibration_and_measurement_counts_the_farthest_in_its_own_deviations():
    fitter = Fitter([], NuisancePrior(np.zeros(3), np.array([6e-4, 6e-4, 0.03]), 1), 1)
    phi = np.array([5.0, 9.0, 20.0, 6e-4, -1.8e-3, 0.06])  # scales and black level have no prior
    assert fitter.prior_sigmas(SimpleNamespace(phi=phi)) == pytest.approx(3.0)
    base = SimpleNamespace(phi=np.array([5.0, 9.0, 20.0, 0.0, -1.2e-3, 0.06]))
    assert fitter.prior_sigmas(SimpleNamespace(phi=phi), base) == pytest.approx(1.0)  # what goes beyond the base's
    weighed_up = NuisancePrior(np.zeros(3), np.array([6e-4, 6e-4, 0.03]) / 5.0, 1, weighed_up=25.0)
    assert Fitter([], weighed_up, 1).prior_sigmas(SimpleNamespace(phi=phi)) == pytest.approx(3.0)  # as stated
    nothing = NuisancePrior(np.array([]), np.array([]), 0)
    assert Fitter([], nothing, 1).prior_sigmas(SimpleNamespace(phi=phi[:SCALES])) == 0.0


def test_what_a_scene_measurement_may_have_wrong_widens_an_interval():
    """An effect and a focal length that move the images alike: the data tell their sum, the scene measurement one of
    them."""
    sigma, weight = 6e-4, 1e10
    fitter = Fitter([], NuisancePrior(np.zeros(2), np.array([sigma, sigma]), 0), 1)
    size = 1 + SCALES + 2
    alike = np.zeros(size)
    alike[[0, 1 + SCALES]] = 1.0, 1.0  # of the effect's parameter and the left camera's focal length
    gram = weight * np.outer(alike, alike) + np.diag([0.0, *[weight] * SCALES, 0.0, weight])
    space = SimpleNamespace(low=np.array([-1.0]), high=np.array([1.0]))
    sums = SimpleNamespace(gram=gram, block_moment={"left": np.zeros((size, 1))})
    deviation = np.sqrt(fitter.covariance(SimpleNamespace(theta=np.zeros(1), space=space, sums=sums))[0, 0])
    assert deviation == pytest.approx(sigma, rel=0.01)
