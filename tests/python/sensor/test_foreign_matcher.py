# SPDX-License-Identifier: Apache-2.0
"""Other matchers' disparities, and other simulators' noise."""

import numpy as np
import pytest
from scipy.stats import norm
from sensor_scenes import wall_scene, walls, with_depth

from activestereo import Mounts, StereoDepthSensor, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.sensor.depth_modes import IsaacSettings, isaac, one_view_depth, redwood, simkinect

_DISPARITY_PX = 6.25


def config():
    out = StereoDepthSensorConfig("D435").scaled(0.15)
    out.samples_per_pixel, out.depth_maps = 2, ("confidence", "reason", "points")
    return out


def constant(left, right):
    """A function: one disparity, sure of the left half."""
    assert left.ndim == 3 and left.dtype == np.uint8 and left.shape == right.shape
    disparity = np.full(left.shape, _DISPARITY_PX, np.float32)
    disparity[:, :5] = np.nan
    confidence = np.zeros(left.shape, np.float32)
    confidence[..., : left.shape[2] // 2] = 1.0
    return disparity, confidence


@pytest.fixture(scope="module")
def wall():
    return wall_scene(0.8)


def test_a_function_s_disparities_become_depth_points_confidence_and_reasons(wall):
    with StereoDepthSensor(config(), wall, matcher=constant) as sensor:
        with_depth(sensor)
        disparity, settings = sensor.get_disparity(), sensor.get_config()
        assert (disparity[5:] == _DISPARITY_PX).all() and (disparity[:5] == -1).all()
        expected_m = settings.focal_baseline_px_m / _DISPARITY_PX
        depth = sensor.get_depth()
        assert np.median(depth[depth > 0]) == pytest.approx(expected_m, rel=1e-3)
        confidence = sensor.get_depth_map("confidence")
        assert confidence[10, 1] == 1 and confidence[10, -1] == 0 and confidence[0, 1] == 0
        assert (sensor.get_depth_map("reason")[:5] > 0).all() and (sensor.get_depth_map("reason")[5:] == 0).all()
        assert sensor.get_ir_measured()[0].shape == disparity.shape


def test_a_batch_asks_the_matcher_once_for_all_pairs():
    asked = []

    def matcher(left, right):
        asked.append(left.shape)
        return np.full(left.shape, _DISPARITY_PX, np.float32), None

    batch = StereoDepthSensorBatch(config(), Mounts(walls([0.7, 1.1], 2), [np.eye(4)] * 2), matcher=matcher)
    for _ in range(2):  # what was read of the first picture is computed at once of the second
        asked.clear()
        with_depth(batch, infrared_only=True)
        assert (batch.get_disparity() == _DISPARITY_PX).all() and batch.get_disparity().ndim == 3
    assert asked == [(2, *config().ir_resolution[::-1])]


@pytest.mark.parametrize("matcher", ["simsense", constant])
def test_points_are_the_rgb_camera_s_whatever_matches(wall, matcher):
    with StereoDepthSensor(config(), wall, matcher=matcher) as sensor:
        with_depth(sensor)
        points = sensor.get_depth_map("points")
        assert len(points[points[..., 2] > 0]) > 1000
        np.testing.assert_allclose(points[points[..., 2] > 0], sensor.get_pointcloud(), rtol=1e-4, atol=1e-5)


def test_opencv_s_matcher_and_simsense_s_agree_about_a_wall(wall):
    pytest.importorskip("cv2", reason="OpenCV is not installed (apt-get install python3-opencv)")
    medians = []
    for name in ("simsense", "opencv"):
        with StereoDepthSensor(config(), wall, matcher=name) as sensor:
            with_depth(sensor, infrared_only=True)
            disparity = sensor.get_disparity()
            medians.append(np.median(disparity[disparity > 0]))
    assert medians[1] == pytest.approx(medians[0], abs=0.25)


@pytest.mark.parametrize(
    "matcher, told",
    [
        ("sgm", "expected 'simsense', 'opencv'"),
        (lambda left, right: (left[:, 1:].astype(np.float32), None), "the matcher gives disparities of"),
    ],
)
def test_what_is_no_matcher_is_told(wall, matcher, told):
    with pytest.raises(ValueError, match=told):
        with StereoDepthSensor(config(), wall, matcher=matcher) as sensor:
            with_depth(sensor, infrared_only=True)
            sensor.get_disparity()


_WALL_M = np.full((1, 120, 160), 1.0, np.float32)


def _isaac(gray, **settings):
    return isaac(_WALL_M, gray, 400.0, 0.05, IsaacSettings(**settings), np.random.default_rng(0))


def test_isaac_sees_a_textured_wall_within_its_range_in_steps_of_a_quarter_of_a_pixel():
    texture = np.random.default_rng(1).random(_WALL_M.shape, np.float32)
    depth = _isaac(texture)
    assert (depth[..., 20:] > 0).all() and not depth[..., :20].any()  # 20 px: beyond the second view
    steps = 20.0 / depth[..., 20:] / 0.25
    assert np.allclose(steps, np.rint(steps), atol=1e-3)
    assert np.std(20.0 / depth[..., 20:]) == pytest.approx(np.hypot(0.25, 0.25 / np.sqrt(12.0)), rel=0.05)
    assert not _isaac(np.full(_WALL_M.shape, 0.5, np.float32)).any()
    assert not _isaac(texture, min_distance_m=1.1).any() and not _isaac(texture, max_disparity_px=19.0).any()


def test_the_datasheets_noise_grows_with_the_square_of_depth():
    random = np.random.default_rng(0)
    near, far = (
        one_view_depth("datasheet", np.full_like(_WALL_M, z), None, 1.0, 20.0, random).std() for z in (1.0, 3.0)
    )
    assert near == pytest.approx(0.08 / 20.0, rel=0.05)
    assert far == pytest.approx(9.0 * near, rel=0.05)


def test_redwoods_disparities_are_eighths_of_a_normal_distribution_of_every_other_pixel():
    fb, sigma_px, depth_m = 35.0, 0.027778, 0.7995

    def found(true_m, **options):
        return redwood(true_m, fb, np.random.default_rng(0), **options)

    eighths = 8.0 * fb / found(np.full_like(_WALL_M, depth_m))
    np.testing.assert_allclose(eighths, np.rint(eighths), atol=0.01)
    edge = np.floor(8.0 * fb / depth_m) + 0.5
    assert (eighths < edge).mean() == pytest.approx(norm.cdf((edge - 8.0 * fb / depth_m) / 8.0 / sigma_px), abs=0.02)
    assert not found(10.0 * _WALL_M).any() and found(11.0 * _WALL_M, farthest_m=np.inf).all()
    every_other = np.full((1, 40, 40), 2.0, np.float32)
    every_other[:, ::2, ::2] = 1.0
    np.testing.assert_allclose(found(every_other), 1.0, atol=0.01)


def test_simkinect_is_half_a_step_too_near_and_empty_at_edges():
    """round(n + 0.5 + N(0, 1/6)) is n or n + 1, as often; at an edge no 1 / 1.2 of a window is near its mean."""
    fb, random = 40.0, np.random.default_rng(1)
    depth = np.full((1, 60, 80), fb / 30.0, np.float32)
    found = simkinect(depth, fb, random)
    steps = 8 * fb / found[found > 0]
    assert set(np.rint(steps)) == {240, 241} and np.mean(steps) == pytest.approx(240.5, abs=0.03)
    depth[..., 40:] = fb / 60.0
    found = simkinect(depth, fb, random)[0, 10:-10]
    assert (found[:, [15, 65]] > 0).all() and (found[:, 36:44] == 0).mean() > 0.1
