# SPDX-License-Identifier: Apache-2.0
"""The rows of a pair are told by patches that lie in one place alone."""

import numpy as np
import pytest

from activestereo.compare.camera_order import camera_order


def test_an_edge_that_runs_sideways_tells_no_row():
    rng, (height, width) = np.random.default_rng(3), (240, 424)
    v, u = np.mgrid[:height, : width + 10]
    scene = 60.0 + 80.0 / (1.0 + np.exp(-(v % 80 - 40 + 0.08 * u)))  # slanted edges, eighty rows apart
    scene[:, 200:300] += rng.uniform(0, 60, (height, 100))
    pair = [image + rng.normal(0, 1.0, image.shape) for image in (scene[:, :-10], scene[:, 10:])]
    order = camera_order([pair])
    assert 30 <= order.patches < 60 and order.row_spread_px < 0.1 and not order.is_swapped
    assert order.row_offset_px == pytest.approx(0.0, abs=0.05)
