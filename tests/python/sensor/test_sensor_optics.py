# SPDX-License-Identifier: Apache-2.0
"""The sensor's lenses and shutters: depth through a distorting lens, and a rig that moves while it exposes."""

from copy import deepcopy

import numpy as np
import pytest

import kuafu
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.common.pose import as_matrix, camera_to_world
from sensor_scenes import wall_scene, with_depth
from virtual_sensor.held_out.rig import moved

LENS = (-0.08, 0.02, 2e-4, -3e-4, 0.0)  # a barrel of some percent, as wide-angle modules have
RATIONAL_LENS = (0.12, -0.05, 2e-4, -3e-4, 0.01, 0.2, -0.03, 0.01)  # as strong a barrel, by its denominator
DISTANCE_M = 0.9


def wall_error(sensor):
    """[p50, p90] of the relative depth error on the wall, and the share measured, in the RGB picture's inner part."""
    with_depth(sensor)
    depth, truth = (d[20:-20, 40:-40] for d in (sensor.get_depth(), sensor.get_true_depth()))
    error = np.abs(depth / truth - 1)[depth > 0]
    return np.percentile(error, [50, 90]), (depth > 0).mean()


@pytest.mark.parametrize("lens", [LENS, RATIONAL_LENS], ids=["polynomial", "rational"])
def test_depth_through_a_lens_is_as_good_as_without_one(small_config, lens):
    """The lens bends the corners by 17 pixels; a sensor that takes no note of it errs by several times as much."""
    small_config.max_bounces, small_config.ir_speckle_noise = 0, 0.0
    bent = deepcopy(small_config)
    bent.ir_distortion = lens
    plain, through_lens, unaware = (
        StereoDepthSensor(c, wall_scene(DISTANCE_M)) for c in (small_config, bent, small_config)
    )
    unaware._engine.rig.ir_cameras = through_lens._engine.rig.ir_cameras
    (ideal, ideal_fill), (error, fill), (wrong, _) = (wall_error(s) for s in (plain, through_lens, unaware))
    assert ideal[0] < 0.005 and ideal_fill > 0.99
    assert fill > 0.98 and error[0] < ideal[0] + 0.002 and error[1] < ideal[1] + 0.005
    assert wrong[0] > 4 * error[0] and wrong[1] > 4 * error[1]


@pytest.mark.parametrize(
    "lens", [(-0.2, 0.05, 1e-3, 0.0, 0.0), (0.1, 0.05, 1e-3, 0.0, 0.0, 0.3, 0.02, 0.01)], ids=["polynomial", "rational"]
)
def test_points_through_the_rgb_lens_lie_on_the_wall_and_where_they_are_seen(small_config, lens):
    small_config.max_bounces = 0
    small_config.rgb_distortion = lens
    sensor = StereoDepthSensor(small_config, wall_scene(DISTANCE_M))
    error, fill = wall_error(sensor)
    assert error[0] < 0.005 and fill > 0.98
    rows, columns = np.nonzero(sensor.get_depth())
    points = sensor.get_pointcloud()
    seen = sensor.get_picture("position")[rows, columns] @ np.linalg.inv(sensor.rgb_camera().camera_to_world)[:3, :3].T
    np.testing.assert_allclose(points[:, :2] / points[:, 2:], seen[:, :2] / seen[:, 2:], atol=1e-4)


@pytest.mark.parametrize("field", ["ir_distortion", "rgb_distortion"])
def test_a_lens_that_is_none_is_refused(small_config, field):
    with pytest.raises(ValueError, match=f"{field} is .*, expected 5 numbers"):
        setattr(small_config, field, (0.1, 0.2))


def test_a_still_sensor_takes_the_pictures_of_a_pinhole_at_rest(small_config, table_top):
    small_config.samples_per_pixel = small_config.max_bounces = 1
    small_config.rgb_exposure_s = small_config.rgb_line_time_s = small_config.ir_line_time_s = 1e-3
    with_shutters, at_rest = (StereoDepthSensor(small_config, table_top) for _ in range(2))
    with_shutters.set_velocity([0, 0, 0])

    def pinhole(camera):
        return kuafu.Camera(camera.width, camera.height, camera.k, camera.camera_to_world)

    rgb, pair = pinhole(at_rest.rgb_camera()), [pinhole(c) for c in at_rest.ir_cameras()]
    at_rest.rgb_camera, at_rest.ir_cameras = lambda: rgb, lambda: pair
    for sensor in (with_shutters, at_rest):
        sensor.take_picture()
    np.testing.assert_array_equal(with_shutters.get_rgb(), at_rest.get_rgb())
    np.testing.assert_array_equal(with_shutters.get_ir(), at_rest.get_ir())


@pytest.mark.parametrize("readout", ["rows_down", "rows_up"])
def test_shutters_of_the_configuration_are_the_cameras(small_config, readout):
    """kuafu's laws say what they do to an edge: tests/kuafu/frame/camera_law_test.cpp."""
    small_config.ir_line_time_s, small_config.ir_readout, small_config.rgb_exposure_s = 1e-4, readout, 0.01
    sensor = StereoDepthSensor(small_config, wall_scene(DISTANCE_M))
    for camera in sensor.ir_cameras():
        seen = camera.shutter, camera.readout, camera.line_time_s, camera.exposure_s
        assert seen == ("rolling", readout, 1e-4, small_config.ir_camera_exposure)
    assert (sensor.rgb_camera().line_time_s, sensor.rgb_camera().exposure_s) == (0.0, 0.01)


def test_the_whole_rig_moves_as_one_body(small_config):
    """Wherever the left camera goes with its twist, the others and the projector stay at their places beside it."""
    sensor = StereoDepthSensor(small_config, wall_scene(1.0))
    sensor.set_velocity([0.3, -0.2, 0.5], [0.4, 1.5, -0.7])
    sensor.take_picture(infrared_only=True)
    left, right = sensor.ir_cameras()
    rgb, projector = sensor.rgb_camera(), sensor.scene.get_light(0)
    assert left.linear_velocity == pytest.approx((0.3, -0.2, 0.5))
    assert left.angular_velocity == pytest.approx((0.4, 1.5, -0.7))

    def at_both_times(thing, pose):
        return moved(pose, [thing.linear_velocity, thing.angular_velocity], [0.0, 0.8])

    to_left = np.linalg.inv(at_both_times(left, left.camera_to_world))
    poses = right.camera_to_world, rgb.camera_to_world, projector.light_to_world
    for thing, pose in zip((right, rgb, projector), poses, strict=True):
        np.testing.assert_allclose(*(to_left @ at_both_times(thing, pose)), atol=1e-7)
    np.testing.assert_allclose(
        projector.light_to_world, camera_to_world(as_matrix(small_config.pose_rgb_irproj)), atol=1e-7
    )


def test_dots_on_a_wall_stay_where_they_are_in_a_sensor_that_slides_along_it(small_config):
    """The projector goes with the cameras, so that its light stands still; without it dots would run by 5 pixels."""
    small_config.max_bounces, small_config.ir_camera_exposure = 0, 0.02
    # Sideways, in the left camera's axes.
    along_wall = camera_to_world(small_config.trans_pose_l)[:3, :3].T @ [0.0, -1.0, 0.0]
    contrast = {}
    for case in ("still", "moving", "left behind"):
        sensor = StereoDepthSensor(small_config, wall_scene(DISTANCE_M))
        sensor._engine.rig.shine(sensor._rigs())
        if case == "left behind":
            sensor._engine.rig.shine = lambda rigs: None
        if case != "still":
            sensor.set_velocity(along_wall)
        contrast[case] = sensor.get_picture("radiance", "left").std()
        sensor.close()
    assert contrast["moving"] == pytest.approx(contrast["still"], rel=0.02)
    assert contrast["left behind"] < 0.8 * contrast["still"]


def test_a_scaled_sensor_reads_out_in_the_same_time():
    config = StereoDepthSensorConfig("D435")
    config.rgb_line_time_s, config.rgb_distortion = 2e-5, LENS
    half = config.scaled(0.5)
    assert half.rgb_line_time_s * half.rgb_resolution[1] == pytest.approx(2e-5 * 480)
    config.rgb_readout = "columns_left"
    half = config.scaled(0.5)
    assert half.rgb_line_time_s * half.rgb_resolution[0] == pytest.approx(2e-5 * 848)
    assert half.rgb_distortion == LENS and half.ir_line_time_s == 0.0
