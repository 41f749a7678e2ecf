# SPDX-License-Identifier: Apache-2.0
"""A real D435 pair through the engine, beside the depth that the device itself computed of the same view."""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import simsense

DATA = Path(os.environ.get("ACTIVESTEREO_DATA", Path(__file__).parents[4] / "shared")) / "data" / "d435-real"
K = np.array([[427.12, 0, 426.93], [0, 427.12, 234.78], [0, 0, 1]])
LEFT_TO_RIGHT = np.array([[1, 0, 0, -0.05], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


@pytest.fixture(scope="module")
def pair():
    if not DATA.is_dir():
        pytest.skip(f"no real D435 pair at {DATA}; set ACTIVESTEREO_DATA to the folder that holds data/d435-real")
    left, right, device_mm = (
        np.asarray(Image.open(DATA / f"{name}.png")) for name in ("left", "right", "device_depth_mm")
    )
    return left, right, device_mm.astype(float)


def engine_mm(left, right, **settings):
    sensor = simsense.DepthSensor((848, 480), K, K, LEFT_TO_RIGHT, rectified=True, **settings)
    return 1000.0 * sensor.compute(left, right)[::2, ::2]  # the device's picture is of every second pixel


def agreement(ours_mm, device_mm):
    """Median difference in mm after an affine fit (the device's range is unknown), and both fill rates."""
    both = (ours_mm > 0) & (device_mm > 0)
    fit = np.polyfit(ours_mm[both], device_mm[both], 1)
    return (
        np.median(np.abs(np.polyval(fit, ours_mm[both]) - device_mm[both])),
        np.mean(ours_mm > 0),
        np.mean(device_mm > 0),
    )


@pytest.mark.parametrize(
    "settings",
    [{}, {"p1_penalty": 8, "p2_penalty": 32}, {"block_width": 1, "block_height": 1}],
    ids=["default", "sapien", "no-block"],
)
def test_depth_agrees_with_the_device(pair, settings):
    left, right, device_mm = pair
    median_mm, fill, device_fill = agreement(engine_mm(left, right, **settings), device_mm)
    print(f"median |difference| {median_mm:.2f} mm, fill {100 * fill:.1f} %, device {100 * device_fill:.1f} %")
    assert median_mm <= 4
    assert abs(fill - device_fill) <= 0.05


def test_disparities_do_not_gather_at_whole_pixels(pair):
    """On a scene of many slopes every fraction of a pixel is as likely as any other."""
    left, right, _ = pair
    depth = engine_mm(left, right) / 1000
    disparity = K[0, 0] * 0.05 / depth[depth > 0]
    share = np.histogram(disparity % 1, 10, (0, 1))[0] / disparity.size
    assert 0.06 < share.min() and share.max() < 0.14, np.round(share, 3)
