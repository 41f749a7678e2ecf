# SPDX-License-Identifier: Apache-2.0
"""census_noise_dn from Python: dark noise loses its disparities, a bright pattern keeps them."""

import numpy as np

import simsense

_WIDTH, _HEIGHT, _SHIFT = 160, 96, 8


def _matcher(**parameters):
    k = np.array([[100.0, 0, _WIDTH / 2], [0, 100.0, _HEIGHT / 2], [0, 0, 1]])
    camera = simsense.Camera(_WIDTH, _HEIGHT, k)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    return simsense.Engine(
        simsense.Device("host"), camera, camera, left_to_right, rectified=True, max_disparity=32, **parameters
    )


def _valid_share(engine_options, scale):
    rng = np.random.default_rng(4)
    left = rng.integers(0, 256, (_HEIGHT, _WIDTH)) * scale + 10
    right = np.roll(left, -_SHIFT, axis=1)
    noisy = [
        np.clip(np.rint(image + rng.normal(0, 1, image.shape)), 0, 255).astype(np.uint8) for image in (left, right)
    ]
    disparity = _matcher(**engine_options).compute(*noisy, outputs=("disparity",))["disparity"]
    inner = disparity.reshape(_HEIGHT, _WIDTH)[8:-8, 40:-8]
    return float((np.abs(inner - _SHIFT) < 1).mean())


def test_a_pattern_above_the_noise_is_matched_and_one_below_it_is_not():
    quiet = {"census_noise_dn": 6}
    assert _valid_share(quiet, scale=0.5) > 0.95
    assert _valid_share({}, scale=0.015) > _valid_share(quiet, scale=0.015) + 0.2
    assert _valid_share(quiet, scale=0.015) < 0.05
