# SPDX-License-Identifier: Apache-2.0
"""The photon-transfer noise model of repeats of whole numbers, some of which never come: a tone table stretches the
dark."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.compare.noise import fit_noise_model

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
