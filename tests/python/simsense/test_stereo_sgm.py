# SPDX-License-Identifier: Apache-2.0
"""StereoSGM: cv2.StereoSGBM's parameters and result; beside it where OpenCV is installed."""

import inspect

import numpy as np
import pytest

import simsense

SHAPE = (120, 240)
USUAL = dict(numDisparities=48, blockSize=5, P1=8 * 25, P2=32 * 25, disp12MaxDiff=1, uniquenessRatio=10)
USUAL |= dict(speckleWindowSize=50, speckleRange=2)


@pytest.fixture(scope="module")
def pair():
    """A slanted random texture, disparity 10..34 from top to bottom."""
    random = np.random.default_rng(3)
    left, right = np.empty(SHAPE, np.uint8), np.empty(SHAPE, np.uint8)
    truth = 10 + np.arange(SHAPE[0]) // 5
    for y, d in enumerate(truth):
        row = random.integers(0, 200, SHAPE[1] + 40)
        left[y], right[y] = row[: SHAPE[1]], row[d : SHAPE[1] + d]
    return left, right, truth


def test_parameters_are_those_of_opencv_in_its_order():
    parameters = inspect.signature(simsense.StereoSGM).parameters.values()
    assert " ".join(p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD) == (
        "minDisparity numDisparities blockSize P1 P2 disp12MaxDiff preFilterCap uniquenessRatio "
        "speckleWindowSize speckleRange mode"
    )


def test_result_is_in_sixteenths_of_pixels(pair):
    left, right, truth = pair
    stereo = simsense.StereoSGM(**USUAL)
    disparity = stereo.compute(left, right)
    assert disparity.dtype == np.int16 and disparity.shape == SHAPE
    inside = disparity[8:-8, 50:-8]
    error = inside / 16 - truth[8:-8, None]
    assert (inside == -16).mean() < 0.1
    assert (np.abs(error[inside >= 0]) < 1).mean() > 0.98
    given = np.empty(SHAPE, np.int16)
    assert stereo.compute(left, right, given) is given
    np.testing.assert_array_equal(given, disparity)
    for wrong in (np.empty(SHAPE, np.float32), [0]):
        with pytest.raises(ValueError, match="int16"):
            stereo.compute(left, right, wrong)


def test_first_disparity_moves_the_invalid_value(pair):
    left, right, truth = pair
    for first, count in ((15, 32), (-20, 64)):
        stereo = simsense.StereoSGM(minDisparity=first, numDisparities=count, blockSize=5, uniquenessRatio=10)
        disparity = stereo.compute(left, right)
        assert disparity.min() == (first - 1) * 16
    assert np.median(disparity[60, 60:200]) / 16 == pytest.approx(truth[60], abs=0.5)


def test_images_may_have_three_channels_or_sixteen_bits(pair):
    left, right, _ = pair
    stereo = simsense.StereoSGM(**USUAL)
    expected = stereo.compute(left, right)
    np.testing.assert_array_equal(stereo.compute(np.dstack([left] * 3), np.dstack([right] * 3)), expected)
    np.testing.assert_array_equal(stereo.compute(left.astype(np.uint16) * 200, right.astype(np.uint16) * 200), expected)


def test_setters_change_and_refuse(pair):
    left, right, _ = pair
    stereo = simsense.StereoSGM.create(**USUAL, mode=simsense.StereoSGM.MODE_HH)
    before = (stereo.compute(left, right) > 0).mean()
    stereo.setUniquenessRatio(60)
    assert stereo.getUniquenessRatio() == 60
    assert (stereo.compute(left, right) > 0).mean() < before
    for name, value in (("BlockSize", 4), ("NumDisparities", 8), ("P2", 1), ("Mode", 9)):
        old = getattr(stereo, f"get{name}")()
        with pytest.raises(ValueError):
            getattr(stereo, f"set{name}")(value)
        assert getattr(stereo, f"get{name}")() == old
    with pytest.raises(ValueError, match="differ"):
        stereo.compute(left, right[:-1])
    with pytest.raises(ValueError, match="float"):
        stereo.compute(left.astype(float), right)


def test_at_least_as_right_as_opencv(pair):
    cv2 = pytest.importorskip("cv2", reason="python3-opencv is not installed")
    left, right, truth = pair

    def share_within_a_pixel(stereo):
        inside = stereo.compute(left, right)[8:-8, 60:-8] / 16
        return (np.abs(inside - truth[8:-8, None]) < 1).mean()

    ours = share_within_a_pixel(simsense.StereoSGM(**USUAL, mode=simsense.StereoSGM.MODE_HH4))
    theirs = share_within_a_pixel(
        cv2.StereoSGBM_create(minDisparity=0, **USUAL, preFilterCap=31, mode=cv2.STEREO_SGBM_MODE_HH4)
    )
    print(f"within a pixel: simsense {100 * ours:.1f} %, OpenCV {100 * theirs:.1f} %")
    assert ours >= theirs - 0.01
