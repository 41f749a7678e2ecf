# SPDX-License-Identifier: Apache-2.0
"""The photon-transfer noise model of repeats of whole numbers, some of which never come: a tone table stretches the
dark."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.noise import comb_of, fit_noise_model

BLACK_DN, READ_DN, SPECKLE = 4.0, 1.0, 0.13


def tone(dn):
    return BLACK_DN + 255.0 * (np.maximum(dn - BLACK_DN, 0.0) / 255.0) ** 0.9


@pytest.fixture(scope="module")
def model_and_images():
    rng = np.random.default_rng(2)
    signal = rng.gamma(0.6, 14.0, (240, 400)) + 2.0

    def exposed():
        value = (
            BLACK_DN
            + signal * (1.0 + SPECKLE * rng.standard_normal(signal.shape))
            + READ_DN * rng.standard_normal(signal.shape)
        )
        return np.clip(np.rint(tone(np.rint(value))), 0, 255)

    first, second = exposed(), exposed()
    mean, variance = (first + second) / 2, (first - second) ** 2 / 2
    statistics = [([SimpleNamespace(gain=1.0)] * 2, "left", mean, variance)]
    return fit_noise_model(statistics, BLACK_DN, 255), tone(BLACK_DN + signal), variance


def test_missing_numbers_do_not_make_the_noise_look_smaller(model_and_images):
    noise_model, expected, variance = model_and_images
    for low, high in ((5, 9), (9, 14), (14, 30), (30, 80)):
        here = (expected >= low) & (expected < high)
        assert noise_model.variance(expected[here]).mean() == pytest.approx(variance[here].mean(), rel=0.15)


@pytest.mark.parametrize("step, noise", [(11.0, 0.5), (11.0, 3.0), (4.0, 8.0)])
def test_the_noise_of_coarse_steps_holds_all_of_their_rounding(step, noise):
    """Two roundings of one value agree where steps are wider than the noise; their error does not vanish."""
    rng = np.random.default_rng(5)
    value = rng.uniform(60.0, 180.0, (200, 300))
    first, second = (step * np.rint((value + noise * rng.standard_normal(value.shape)) / step) for _ in range(2))
    statistics = [([SimpleNamespace(gain=1.0)] * 2, "left", (first + second) / 2, (first - second) ** 2 / 2)]
    model = fit_noise_model(statistics, 0.0, 255, comb_of([first, second], 255).step_dn)
    assert model.variance(value).mean() == pytest.approx(noise**2 + ROUNDING_VARIANCE * step**2, rel=0.05)


def test_the_mean_error_of_rounding_is_what_many_exposures_show():
    rng, step, noise = np.random.default_rng(6), 11.0, 2.0
    value = np.linspace(12.0, 200.0, 400)
    rounded = step * np.rint((value + noise * rng.standard_normal((4000, 400))) / step)
    comb = comb_of([rounded], 255)
    assert comb.step_dn == pytest.approx(step, rel=0.03)
    said = comb.mean_error(value, np.full(400, noise**2 + ROUNDING_VARIANCE * step**2))
    assert said == pytest.approx(rounded.mean(axis=0) - value, abs=0.3)


def test_whole_numbers_are_no_comb():
    assert comb_of([np.random.default_rng(7).integers(0, 200, (50, 50))], 255) is None
