# SPDX-License-Identifier: Apache-2.0
"""A batch over two devices, against the same batch on one."""

import threading

import numpy as np
import pytest

import kuafu
from activestereo import Mounts, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.sensor.mounts import SensorPoseError
from sensor_scenes import walls

DISTANCES_M = (0.5, 0.6, 0.8)
POSES = np.array([[[0, 0, 0, 1, 0, 0, 0], [0.1, 0, 0, 1, 0, 0, 0]]] * 3, float)  # two sensors in each environment


@pytest.fixture(scope="module")
def config():
    config = StereoDepthSensorConfig("D435").scaled(0.125)  # settles its exposure; speckle stays where nothing moves
    config.samples_per_pixel, config.max_bounces = 16, 1
    config.rgb_exposure = 0.5  # chosen by each device for itself where it is not said
    return config


def mounts(poses=POSES):
    return Mounts(walls(DISTANCES_M, len(DISTANCES_M)), poses)


def pictures(batch, all_mounts):
    """Two of them; between, the first environment's sensors alone move, which draws new speckle everywhere."""
    for moved_m in (0.0, 0.01):
        for one in all_mounts:
            one.poses = one.poses.copy()
            one.poses[0, ..., 0] += moved_m
        batch.take_picture()
        batch.compute_depth()
        left, right = batch.get_ir_measured()
        names = ("depth", "disparity", "ir_radiance", "rgba8", "rgb", "true_depth", "instance_ids", "material_ids")
        maps = {name: getattr(batch, f"get_{name}")() for name in names}
        yield maps | {"ir_left": left, "ir_right": right, "confidence": batch.get_depth_map("confidence")}


def same_bits(one, whole, split, parts, frames=2):
    for expected, found in zip(pictures(one, [whole]), pictures(split, parts), strict=True):
        assert (expected["depth"] > 0).mean() > 0.5
        for name, image in expected.items():
            np.testing.assert_array_equal(found[name], image, err_msg=name)
    assert split.frame_index == frames - 1


def test_two_devices_give_the_bits_of_one(config):
    whole, halves = mounts(), [mounts(), mounts()]
    with StereoDepthSensorBatch(config, whole) as one, StereoDepthSensorBatch(config, halves) as split:
        assert split.shape == one.shape == (3, 2) and split.device_environments == [range(1), range(1, 3)]
        same_bits(one, whole, split, halves)
        np.testing.assert_array_equal(split.render_true_depth(), one.render_true_depth())


def test_a_split_batch_of_one_device_has_its_shapes(config):
    only = mounts()
    with StereoDepthSensorBatch(config, [only]) as split:
        split.take_picture(infrared_only=True)
        split.compute_depth()
        depth = split.get_depth()
        assert split.get_depth_mm().shape == (*depth.shape, 1)
        assert split.render_true_depth().shape == depth.shape


def test_so_does_a_device_for_each_sensor(config):
    poses = POSES[:, 1]  # from where most of the wall is measured
    whole, parts = mounts(poses), [mounts(poses) for _ in range(3)]
    with StereoDepthSensorBatch(config, whole) as one, StereoDepthSensorBatch(config, parts) as split:
        assert split.shape == one.shape == (3,) and [len(own) for own in split.device_environments] == [1] * 3
        same_bits(one, whole, split, parts)


def test_a_pose_that_is_none_is_told_with_its_number_and_costs_no_other_picture(config):
    halves = [mounts(), mounts()]
    with StereoDepthSensorBatch(config, halves) as split:
        poses = POSES.copy()
        poses[2, 1] = np.nan
        for one in halves:
            one.poses = poses
        with pytest.raises(SensorPoseError, match=r"environment 2, sensor 1.* 1 of 6") as caught:
            split.take_picture(infrared_only=True)
        assert caught.value.environment == 2
        split.restart(3)
        assert split.frame_index == -1


def test_mounts_that_do_not_fit_are_errors(config):
    with pytest.raises(ValueError, match="4 devices take as many environments or more, not"):
        StereoDepthSensorBatch(config, [mounts()] * 4)
    with pytest.raises(ValueError, match="0 devices"):
        StereoDepthSensorBatch(config, [])


def test_a_picture_that_one_device_lost_leaves_all_in_step(config, monkeypatch):
    """And names the environments that lost it; the other devices' projectors go dark, too."""
    whole, halves = mounts(), [mounts(), mounts()]
    with StereoDepthSensorBatch(config, whole) as one, StereoDepthSensorBatch(config, halves) as split:
        one.take_picture(infrared_only=True)

        def fails(*args):
            raise kuafu.Error("lost for once")

        with monkeypatch.context() as patch, pytest.raises(kuafu.Error, match="for once") as caught:
            patch.setattr(split._engines[1].rig, "ir_cameras", fails)
            split.take_picture(infrared_only=True)
        assert caught.value.__notes__ == ["on the device of environments 1 to 2"]
        for scene in (half.scene for half in halves):
            assert all(scene.get_light(number).ir_intensity == 0.0 for number in range(scene.summary.light_count))
        with pytest.raises(RuntimeError, match="no picture yet"):
            split.compute_depth()
        same_bits(one, whole, split, halves, frames=3)


def test_closing_ends_the_threads_and_leaves_results(config):
    count = threading.active_count()
    with StereoDepthSensorBatch(config, [mounts(), mounts()]) as split:
        split.take_picture(infrared_only=True)
        split.compute_depth()
        assert threading.active_count() == count + 2
    assert threading.active_count() == count
    assert split.get_depth().shape[:2] == (3, 2)
    split.close()


def test_results_stay_while_they_are_held_and_their_memory_is_used_again(config):
    with StereoDepthSensorBatch(config, [mounts(), mounts()]) as split:
        addresses, held = [], []
        for n in range(6):
            split.take_picture(infrared_only=True)
            split.compute_depth()
            depth = split.get_depth()
            addresses.append(depth.ctypes.data)
            if n < 2:
                held.append((depth[1:, 0], depth[1:, 0].copy()))
            del depth
        assert len(set(addresses)) < 6
        for view, copy in held:
            np.testing.assert_array_equal(view, copy)
