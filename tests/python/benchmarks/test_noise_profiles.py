# SPDX-License-Identifier: Apache-2.0
"""Noise models of other simulators: a fit finds the noise that was put in, and their files say what was found."""

from argparse import ArgumentTypeError
import xml.etree.ElementTree as xml

import numpy as np
import pytest

from activestereo.benchmarks.noise_profiles import Distance, distance
from activestereo.benchmarks.noise_profiles import PROFILES
from activestereo.benchmarks.noise_profiles import fitted
from activestereo.benchmarks.noise_profiles import Views
from activestereo.cli import model as command
from activestereo.cli.arguments import names_of

_K = np.array([[430.0, 0.0, 79.5], [0.0, 430.0, 31.5], [0.0, 0.0, 1.0]])
_SIGMA_PX, _HOLES = 0.3, 0.1


@pytest.fixture(scope="module")
def views():
    """A sensor with Gaussian noise of disparity, and a tenth of the pixels without depth."""
    random = np.random.default_rng(3)
    truth = np.broadcast_to(np.linspace(1.0, 4.0, 160, dtype=np.float32), (2, 64, 160)).copy()
    px = 430.0 * 0.05 / truth + _SIGMA_PX * random.standard_normal(truth.shape)
    found = np.where(random.random(truth.shape) < _HOLES, 0.0, 430.0 * 0.05 / px).astype(np.float32)
    return Views(truth, found, random.random(truth.shape, np.float32), _K, 0.05, 0.2, 10.0)


@pytest.fixture(scope="module")
def profiles(views):
    return {name: fitted(kind, views) for name, kind in PROFILES.items()}


def test_a_distance_is_what_was_put_in(views):
    assert distance(views, views.found_m) == Distance(0.0, 0.0)
    moved = np.where(views.found_m > 0, 21.5 / (21.5 / np.maximum(views.found_m, 0.1) + 0.1), 0.0)
    assert distance(views, moved).error_px == pytest.approx(0.1, rel=0.01)
    half = np.where(np.arange(64)[:, None] < 32, views.found_m, 0.0)
    assert distance(views, half).holes == pytest.approx(0.5 * (1.0 - _HOLES), abs=0.01)


def test_noise_of_disparity_is_found_again(profiles):
    isaac = profiles["isaac"]
    assert np.hypot(isaac.sigma_px, isaac.step_px / np.sqrt(12.0)) == pytest.approx(_SIGMA_PX, rel=0.1)
    mapping = profiles["elevation_mapping"]
    for depth_m in (1.5, 3.5):  # z^2 sigma / (f B)
        sigma_m = mapping.a + mapping.b * (depth_m - mapping.c) ** 2
        assert sigma_m == pytest.approx(depth_m**2 * _SIGMA_PX / 21.5, rel=0.25)
    assert profiles["gazebo"].stddev_m == pytest.approx(0.07, rel=0.5)  # of sigmas from 0.014 to 0.22 m


def test_a_fit_is_nearer_than_the_default(views, profiles):
    for name, profile in profiles.items():
        default = type(profile)()
        far = [distance(views, one.apply(views, np.random.default_rng(5))) for one in (default, profile)]
        least = 0.75 if name == "gazebo" else 0.5  # one sigma in metres for depths from 1 to 4 m
        assert far[1].error_px <= least * far[0].error_px, profile
        assert far[1].total < far[0].total


def test_files_say_what_was_found(views, profiles):
    texts = {name: profile.file_text(views) for name, profile in profiles.items()}
    noise = xml.fromstring(texts["gazebo"]).find(".//camera/noise")
    assert float(noise.find("stddev").text) == pytest.approx(profiles["gazebo"].stddev_m, rel=1e-4)
    assert f"noiseSigma = {profiles['isaac'].sigma_px:.6g}" in texts["isaac"]
    pairs = dict(line.split(": ") for line in texts["elevation_mapping"].splitlines())
    assert float(pairs["sensor_processor/normal_factor_b"]) == pytest.approx(profiles["elevation_mapping"].b)


def test_the_command_knows_all_formats_and_refuses_others():
    assert tuple(PROFILES) == command.EXPORTS
    with pytest.raises(ArgumentTypeError, match="unknown system 'gazeb'.*gazebo"):
        names_of("system", command.EXPORTS)("isaac,gazeb")
