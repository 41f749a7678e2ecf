# SPDX-License-Identifier: Apache-2.0
"""Sensors in a batch, alike and varied."""

import gc

import numpy as np
import pytest
from activestereo import Mount, Mounts, Pose, StereoDepthSensor, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.effects import builtin
from activestereo.sensor.mounts import SensorPoseError
from sensor_scenes import model_of, sensor_or_batch, walls, with_depth

FORWARD = [0, 0, 0, 1, 0, 0, 0]


@pytest.fixture
def config():
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.25)
    config.samples_per_pixel, config.max_bounces = 4, 2
    return config


def median(depth):
    return np.median(depth[depth > 0])


def test_a_batch_of_one_is_one_sensor_to_the_bit(config):
    batch = StereoDepthSensorBatch(config, Mounts(walls([0.8], 1), [FORWARD]))
    sensor = StereoDepthSensor(config, Mount(walls([0.8])))
    for _ in range(2):
        for one in (batch, sensor):
            with_depth(one)
        for name in ("get_depth", "get_disparity", "get_true_depth", "get_rgb", "get_rgba8", "get_instance_ids"):
            np.testing.assert_array_equal(getattr(batch, name)()[0], getattr(sensor, name)(), err_msg=name)
        np.testing.assert_array_equal(batch.get_ir_measured()[1][0], sensor.get_ir_measured()[1])


def test_a_devices_preset_is_exposed_in_each_environment_as_alone():
    config = StereoDepthSensorConfig("D435").scaled(0.25)  # settles its exposure, has speckle of the laser alone
    config.samples_per_pixel = 4
    batch = with_depth(StereoDepthSensorBatch(config, Mounts(walls([0.4, 1.5], 2), [FORWARD] * 2)))
    for k, distance in enumerate((0.4, 1.5)):
        sensor = with_depth(StereoDepthSensor(config, walls([distance])))
        counts, alone = batch.get_ir_measured()[0][k], sensor.get_ir_measured()[0]
        assert counts.mean() == pytest.approx(alone.mean(), rel=0.03)
        assert median(batch.get_depth()[k]) == pytest.approx(median(sensor.get_depth()), rel=0.01)
    config.ir_exposure_mode = "converging"
    with pytest.raises(ValueError, match="of a batch is 'fixed' or 'settled', not 'converging'"):
        StereoDepthSensorBatch(config, Mounts(walls([0.4], 1), [FORWARD]))


def test_each_environment_is_seen_by_its_own_sensor(config):
    batch = with_depth(StereoDepthSensorBatch(config, Mounts(walls([0.6, 0.8, 1.0], 3), [FORWARD] * 3)))
    depth = batch.get_depth()
    assert depth.shape == (3, 120, 212) and depth.dtype == np.float32
    for image, truth, distance in zip(depth, batch.get_true_depth(), (0.6, 0.8, 1.0), strict=True):
        assert median(truth) == pytest.approx(distance, rel=0.02)
        assert median(image) == pytest.approx(median(truth), rel=0.01)
    millimetres = batch.get_depth_mm()
    assert millimetres.shape == (3, 120, 212, 1) and millimetres.dtype == np.int16
    np.testing.assert_allclose(millimetres[..., 0] / 1000, depth, atol=0.00051)
    assert batch.get_rgb().shape == (3, 120, 212, 3) and batch.get_ir_radiance().shape == (2, 3, 120, 212)


def test_each_environment_has_the_noise_of_its_own_seed(config):
    """The same light counts alike at any place of the batch, under the same seed."""
    batch = StereoDepthSensorBatch(config, Mounts(walls([0.8, 0.8], 2), [FORWARD] * 2))

    def counts(seeds):
        batch.restart(seeds)
        batch.take_picture(infrared_only=True)
        batch.get_ir_radiance()[:, 1] = batch.get_ir_radiance()[:, 0]
        batch.compute_depth()
        return batch.get_ir_measured()[0].copy()

    first, turned, other = counts([5, 9]), counts(np.array([9, 5])), counts([5, 6])
    np.testing.assert_array_equal(first, counts([5, 9]))
    np.testing.assert_array_equal(first, turned[::-1])
    np.testing.assert_array_equal(first[0], other[0])
    assert (first[1] != other[1]).mean() > 0.1 and (first[0] != first[1]).mean() > 0.1
    batch.restart(3)
    with pytest.raises(ValueError, match=r"seeds are \[3\], expected a number or \[2\]"):
        batch.restart([1, 2, 3])
    with pytest.raises(ValueError, match="the seed of environment 0 is -1, .*; environment 1 is 1.5, expected a whole"):
        batch.restart([-1, 1.5])


def test_several_sensors_in_each_environment(config):
    poses = np.array([[FORWARD, [0.2, 0, 0, 1, 0, 0, 0]]] * 2, float)
    batch = with_depth(StereoDepthSensorBatch(config, Mounts(walls([0.8, 1.0], 2), poses)))
    assert batch.shape == (2, 2) and batch.get_depth().shape == (2, 2, 120, 212)
    truth = [[median(batch.get_true_depth()[e, s]) for s in range(2)] for e in range(2)]
    np.testing.assert_allclose(truth, [[0.8, 0.6], [1.0, 0.8]], rtol=0.02)


def test_poses_of_torch_go_in_and_depth_goes_out_without_a_copy(config):
    torch = pytest.importorskip("torch", reason="the package torch is not installed (pip install torch)")
    mounts = Mounts(walls([0.8, 1.0], 2), torch.tensor([FORWARD] * 2, dtype=torch.float32))
    batch = StereoDepthSensorBatch(config, mounts)
    mounts.poses = mounts.poses + torch.tensor([0.1, 0, 0, 0, 0, 0, 0])
    with_depth(batch)
    depth = torch.from_numpy(batch.get_depth())
    assert depth.data_ptr() == batch.get_depth().ctypes.data and tuple(depth.shape) == (2, 120, 212)
    assert torch.from_dlpack(batch.get_depth()).data_ptr() == depth.data_ptr()
    assert float(depth[0][depth[0] > 0].median()) == pytest.approx(0.7, rel=0.03)


def test_a_mount_without_a_pose_is_named_and_the_others_are_seen(config):
    mounts = Mounts(walls([0.6, 0.8, 1.0], 3), np.array([FORWARD] * 3, float))
    batch = StereoDepthSensorBatch(config, mounts)
    mounts.poses = mounts.poses.copy()
    mounts.poses[1, 0] = np.nan
    said = "environment 1: the mount's pose is not a finite rigid one; 1 of 3"
    with pytest.raises(SensorPoseError, match=said) as caught:
        batch.take_picture()
    assert caught.value.environment == 1 and caught.value.environments == [1]
    batch.compute_depth()
    assert median(batch.get_depth()[2]) == pytest.approx(median(batch.get_true_depth()[2]), rel=0.01)
    mounts.poses[2, 3:] = 0.0
    with pytest.raises(SensorPoseError, match="environment 1; environment 2: the mount's pose .* 2 of 3") as caught:
        batch.take_picture()
    assert caught.value.environments == [1, 2]
    mounts.poses = [FORWARD] * 2
    with pytest.raises(ValueError, match=r"this batch is of \(3,\) sensors; the poses are of \(2,\)"):
        batch.take_picture()
    with pytest.raises(RuntimeError, match="no picture yet"):
        batch.compute_depth()


def test_poses_that_fit_no_batch_are_refused(config):
    scene = walls([0.6], 1)
    for poses in (FORWARD, np.zeros((0, 7)), np.zeros((1, 1, 1, 7))):
        with pytest.raises(ValueError, match=r"\[E\] or \[E, S\]"):
            StereoDepthSensorBatch(config, Mounts(scene, poses))


@pytest.mark.parametrize("kind", ["sensor", "batch"])
def test_projectors_go_with_a_forgotten_sensor(config, kind):
    scene = walls([0.8], 1)
    sensor = sensor_or_batch(kind, config, scene)
    sensor.take_picture(infrared_only=True)
    assert scene.summary.light_count == 1
    gc.disable()  # a sensor that nothing refers to is gone at once, without the collector of cycles
    del sensor
    gc.enable()
    assert scene.summary.light_count == 0


def test_sensors_do_not_see_one_anothers_dots_unless_asked(config):
    scene = walls([0.8])

    def light():
        sensor = StereoDepthSensor(config, scene)
        sensor.take_picture(infrared_only=True)
        return sensor.get_ir()[0].mean()

    alone, beside = light(), Pose([0.0, 0.1, 0.0])
    for config.projector_always_on in (False, True):
        with StereoDepthSensor(config, scene, pose=beside) as other:
            other.take_picture(infrared_only=True)
            if config.projector_always_on:
                assert light() > 1.3 * alone
            else:
                assert light() == pytest.approx(alone, rel=0.01)


def typical(name: str) -> dict[str, float]:
    return {p.name: p.typical for p in builtin()[name].parameters}


@pytest.mark.parametrize(
    "name", ["vignetting", "principal_point_offset", "haze", "specular", "second_projector", "shot_noise"]
)
def test_a_models_effects_are_each_sensors_own(config: StereoDepthSensorConfig, name: str) -> None:
    model = model_of(**{name: typical(name)})
    plain = StereoDepthSensorBatch(config, Mounts(walls([0.8], 1), [FORWARD]))
    batch = StereoDepthSensorBatch(config, Mounts(walls([0.8], 1), [FORWARD]), model=model)
    sensor = StereoDepthSensor(config, Mount(walls([0.8])), model=model)
    for one in (plain, batch, sensor):
        with_depth(one, infrared_only=True)
    for one, alone in zip(batch.get_ir_measured(), sensor.get_ir_measured(), strict=True):
        np.testing.assert_array_equal(one[0], alone)
    np.testing.assert_array_equal(batch.get_depth()[0], sensor.get_depth())
    assert not np.array_equal(batch.get_ir_measured(), plain.get_ir_measured())


def test_a_restart_seeds_the_effects_draws_as_a_new_batch_does(config: StereoDepthSensorConfig) -> None:
    model, mounts = model_of(dot_gain_spread=typical("dot_gain_spread")), Mounts(walls([0.8], 1), [FORWARD])
    seen = []
    for noise_seed in (0, 7):
        config.noise_seed = config.render_seed = noise_seed
        with StereoDepthSensorBatch(config, mounts, model=model) as batch:
            batch.restart(7)
            seen.append(with_depth(batch, infrared_only=True).get_ir_radiance().copy())
    np.testing.assert_array_equal(*seen)


def test_a_model_goes_with_its_batch(config: StereoDepthSensorConfig) -> None:
    scene = walls([0.8, 1.2], 2)
    before = scene.get_material(0).specular, scene.summary.light_count
    model = model_of(specular=typical("specular"), haze=typical("haze"), second_projector=typical("second_projector"))
    with StereoDepthSensorBatch(config, Mounts(scene, [FORWARD] * 2), model=model):
        assert scene.summary.light_count == before[1] + 4
        assert scene.get_material(0).specular != before[0]
    assert (scene.get_material(0).specular, scene.summary.light_count) == before
    with pytest.raises(ValueError, match="such sensors have no quantisation"):
        StereoDepthSensorBatch(config, Mounts(scene, [FORWARD] * 2), model=model_of(quantisation={"step_dn": 16.0}))
    assert scene.summary.light_count == before[1]


def test_a_batchs_points_and_cameras_are_its_sensors(config: StereoDepthSensorConfig) -> None:
    turned = Pose([0.1, 0.0, 0.05], [0.96, 0.1, 0.2, 0.1])
    there = np.stack([turned.to_transformation_matrix(), np.eye(4)])[:, None]
    config.rgb_distortion = (0.05, 0.0, 0.001, 0.0, 0.0)
    batch = StereoDepthSensorBatch(config, Mounts(walls([0.8, 1.0], 2), there))
    sensor = StereoDepthSensor(config, Mount(walls([0.8])), pose=turned)
    for one in (batch, sensor):
        with_depth(one)
    points = batch.get_pointcloud(with_rgb=True)
    assert points.shape == (2, 1, 120, 212, 6)
    np.testing.assert_array_equal(points[..., 2], batch.get_depth())
    seen, alone = batch.get_depth()[0, 0] > 0, sensor.get_depth() > 0
    ways = [cloud / cloud[:, 2:] for cloud in (points[0, 0][seen & alone][:, :3], sensor.get_pointcloud()[seen[alone]])]
    np.testing.assert_allclose(*ways, atol=1e-6)
    cameras = {"rgb": sensor.rgb_camera(), "left": sensor.ir_cameras()[0], "right": sensor.ir_cameras()[1]}
    for name, camera in cameras.items():
        info = batch.camera_info(name)
        assert (info.width, info.height, batch.get_intrinsics(name).shape) == (212, 120, (2, 1, 3, 3))
        np.testing.assert_allclose(batch.get_intrinsics(name)[1, 0], camera.k, rtol=1e-6)
        np.testing.assert_allclose(batch.get_extrinsics(name)[0, 0], camera.camera_to_world, atol=1e-6)
        np.testing.assert_allclose(sensor.get_extrinsics(name), camera.camera_to_world, atol=1e-6)
    with pytest.raises(ValueError, match="unknown camera 'lift' .*did you mean 'left'"):
        batch.get_extrinsics("lift")


def test_all_environments_that_cannot_be_varied_so_are_named(config: StereoDepthSensorConfig) -> None:
    with StereoDepthSensorBatch(config, Mounts(walls([0.8] * 4, 4), [FORWARD] * 4)) as batch:
        with pytest.raises(ValueError, match="laser_power of environment 1 is -1, .*; environment 3 is nan"):
            batch.vary(laser_power=[1.0, -1.0, 1.0, np.nan])
        for values in ("bright", [1.0, [2.0], 1.0, 1.0], [1.0, 2.0]):
            with pytest.raises(ValueError, match=r"exposure of the batch is \[4\] numbers from 0 on, not"):
                batch.vary(exposure=values)
        with pytest.raises(ValueError, match="right_turn of environment 0 is no rotation; environment 2 is no"):
            batch.vary(right_turn=np.stack([2 * np.eye(3), np.eye(3)] * 2))


ENVIRONMENTS = 3


@pytest.fixture
def batch():
    """Each environment's sensor sees a wall at 0.8 m and nothing else, in the projector's light alone."""
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.25)
    config.samples_per_pixel, config.max_bounces, config.ir_ambient_radiance = 2, 1, 0.0
    scene = walls([0.8] * ENVIRONMENTS, ENVIRONMENTS)
    with StereoDepthSensorBatch(config, Mounts(scene, [FORWARD] * ENVIRONMENTS)) as batch:
        yield batch


def look(batch):
    """(mean infrared light [E], disparity)."""
    batch.restart(0)
    with_depth(batch, infrared_only=True)
    return batch.get_ir_radiance()[0].mean(axis=(1, 2)), batch.get_disparity().copy()


def test_a_sensors_laser_and_exposure_scale_its_light_and_what_is_not_named_stays(batch):
    light = look(batch)[0]
    batch.vary(1, laser_power=[0.5])
    np.testing.assert_allclose(look(batch)[0], light * [1.0, 0.5, 1.0], rtol=2e-3)
    batch.vary(exposure=[1.0, 1.0, 2.0])
    np.testing.assert_allclose(look(batch)[0], light * [1.0, 0.5, 2.0], rtol=2e-3)


def test_a_right_eye_that_has_turned_shifts_the_disparity(batch):
    """A turn about the camera's y axis by an angle a shifts the disparity by f tan a at the middle of the image: here
    two pixels, which the matcher's pull towards whole ones does not change."""
    turn = np.arctan(2.0 / batch.get_config().ir_intrinsic[0, 0])
    before = np.median(look(batch)[1][:, 50:70, 90:120], axis=(1, 2))
    rotation = np.array([[[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]])
    batch.vary(1, right_turn=rotation)
    shift = np.median(look(batch)[1][:, 50:70, 90:120], axis=(1, 2)) - before
    assert shift[1] == pytest.approx(2.0, abs=0.12)  # two samples a pixel: other roundings of a pose draw other noise
    assert shift[0] == shift[2] == 0.0
