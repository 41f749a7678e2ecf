# SPDX-License-Identifier: Apache-2.0
"""Structure that a residual still holds."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.diagnose.fitter import ImageResidual
from activestereo.diagnose.goodness import local_structure

SHAPE = (96, 160)
NOISE_DN = 2.0


def dots(rng):
    """An image of smoothed random dots on a ramp, DN."""
    image = np.kron(rng.random((SHAPE[0] // 4, SHAPE[1] // 4)) > 0.7, np.ones((4, 4))) * 80.0
    for axis in (0, 1):
        image = (np.roll(image, 1, axis) + 2 * image + np.roll(image, -1, axis)) / 4
    return 20.0 + image + np.linspace(0, 10, SHAPE[1])


def row(image, residual, **frame):
    o = SimpleNamespace(
        side="left",
        frame=SimpleNamespace(**frame),
        weight=np.full(SHAPE, NOISE_DN**-2),
        pixels=image.size,
        view=SimpleNamespace(once=lambda *_: np.zeros(SHAPE, bool), max_dn=255),
    )
    return ImageResidual(o, image, image - 20.0, residual)


def test_noise_and_grains_are_no_structure():
    rng = np.random.default_rng(3)
    for _ in range(3):
        image = dots(rng)
        noise = NOISE_DN * rng.standard_normal(SHAPE)
        assert abs(local_structure([row(image, noise)])) < 0.01
        grains = 0.2 * image * rng.standard_normal(SHAPE)
        assert abs(local_structure([row(image, noise + grains)])) < 0.03 * np.mean(grains**2) / NOISE_DN**2


@pytest.mark.parametrize("kind", ["displaced", "brighter", "offset", "blurred"])
def test_what_moves_dims_or_blurs_smoothly_is_structure_of_its_own_size(kind):
    rng = np.random.default_rng(4)
    image = dots(rng)
    across = np.linspace(-1.0, 1.0, SHAPE[1])
    change = {
        "displaced": 0.2 * across * np.gradient(image)[1],
        "brighter": 0.08 * across * image,
        "offset": 3.0 * across * np.ones(SHAPE),
        "blurred": 0.1 * (1.0 + across) * sum(np.gradient(np.gradient(image)[axis])[axis] for axis in (0, 1)),
    }[kind]
    size = np.mean(change**2) / NOISE_DN**2
    structure = local_structure([row(image, change + NOISE_DN * rng.standard_normal(SHAPE))])
    assert (0.5 if kind == "blurred" else 0.8) * size < structure < 1.1 * size


def test_an_edge_in_one_corner_of_a_dark_picture_makes_no_structure_of_noise():
    image = np.full(SHAPE, 6.0)
    image[4::16, 4::16] += 0.02  # one half of each tile has an edge, of which the other hardly shows anything
    image[2::16, 1::16] += 8.0
    noise = NOISE_DN * np.random.default_rng(7).standard_normal((20, *SHAPE))
    assert max(abs(local_structure([row(image, residual)])) for residual in noise) < 0.05
