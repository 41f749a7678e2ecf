# SPDX-License-Identifier: Apache-2.0
"""Automatic exposure on a lit wall, the laser's settings, static speckle and fireflies."""

import kuafu
import numpy as np
import pytest
import simsense
from sensor_scenes import sensor_or_batch, wall_scene, with_depth

from activestereo import Pose, StereoDepthSensor, StereoDepthSensorConfig
from activestereo.camera.auto_exposure import AutoExposure, Setting, rgb_exposure, srgb

AROUND = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if (y, x) != (0, 0)]


def wall(distance_m=1.0, room=0.25):
    scene = wall_scene(distance_m)
    scene.set_environment((room, room, room))
    return scene


@pytest.fixture
def config():
    config = StereoDepthSensorConfig("D435").scaled(0.25)
    config.samples_per_pixel, config.max_bounces = 2, 0
    return config


def mean_count(sensor):
    return float(with_depth(sensor, infrared_only=True).get_ir_measured()[0].mean())


@pytest.mark.parametrize("room", [0.02, 0.25, 20.0])
def test_a_settled_exposure_has_the_target_whatever_the_light(config, room):
    config.ir_exposure_limits_s = (1e-6, 10.0)
    found = mean_count(StereoDepthSensor(config, wall(room=room)))
    assert found == pytest.approx(config.ir_exposure_target_dn, abs=1.5)


@pytest.mark.parametrize("kind", ["sensor", "batch"])
@pytest.mark.parametrize(
    "more", [{"response_exponent": 0.5}, {"response_exponent": 2.0}, {"black_level_dn_per_k": 1.0}]
)
def test_a_settled_exposure_counts_what_the_imager_gives(config, kind, more):
    """A bent response, and a black level that is 30 counts higher at 55 degrees."""
    config.ir_exposure_limits_s = (1e-6, 10.0)
    config.ir_signal |= more | {"temperature_c": 55.0}
    found = mean_count(sensor_or_batch(kind, config, wall()))
    assert found == pytest.approx(config.ir_exposure_target_dn, abs=1.5)


@pytest.mark.parametrize("mode", ["settled", "converging"])
def test_a_black_level_beyond_the_target_asks_for_less_light(mode):
    """As an effect may raise it; a configuration that says so is refused."""
    signal = simsense.signal_preset("neutral") | {"responsivity_e": 100.0, "black_level_dn": 88.0}
    rule = AutoExposure(mode, Setting(0.01, 1.0), 68.0, (0.001, 0.1), (1.0, 16.0))
    after = rule.after(rule.start, signal, np.ones((8, 8), np.float32), 255.0)
    assert after == Setting(0.001 if mode == "settled" else 0.005, 1.0)


def test_it_converges_over_frames_and_gain_follows_exposure_at_its_limit(config):
    config.ir_exposure_mode, config.ir_camera_exposure = "converging", 0.0005
    config.ir_exposure_limits_s = (1e-6, 0.008)
    sensor = StereoDepthSensor(config, wall())
    seen = []
    for _ in range(9):
        seen.append((mean_count(sensor), sensor.get_config().ir_camera_exposure, sensor.get_config().ir_camera_gain))
    means, exposures, gains = np.array(seen).T
    errors = np.abs(means - config.ir_exposure_target_dn)
    assert exposures[0] == 0.0005 and errors[0] > 20 and errors[-1] < 1.5
    assert np.all(exposures[1:3] == 2 * exposures[:2]), "at most twice the light a frame"
    assert exposures[-1] == 0.008 and gains[-1] > 1.2 and np.all(gains[exposures < 0.008] == 1.0)


def test_a_new_exposure_reaches_all_that_the_engines_are_told(config):
    """Inputs that are changed equal those that are made again."""
    config.ir_exposure_limits_s = (1e-6, 10.0)
    sensor = StereoDepthSensor(config, wall(room=3.0))
    sensor.set_conditions(temperature_c=50.0)
    sensor.take_picture(infrared_only=True)
    now, changed = sensor.get_config(), sensor.engine_inputs()
    told = sensor.engine.signal
    for temperature_c in (51.0, 50.0):
        sensor.set_conditions(temperature_c)
    afresh = sensor.engine_inputs()
    assert afresh is not changed and changed.frame.exposure_s == now.ir_camera_exposure != config.ir_camera_exposure
    assert sensor.engine.signal == told
    for a, b in zip(changed.sides, afresh.sides, strict=True):
        assert a.signal == b.signal and a.camera.exposure_s == b.camera.exposure_s == now.ir_camera_exposure


def test_the_region_alone_is_looked_at(config):
    dark, bright = (106, 0, 212, 120), (0, 0, 106, 120)
    scene = wall()
    corners = np.array([[0.9, y, z] for y in (-9.0, 0.0) for z in (-9.0, 9.0)], np.float32)
    material = scene.add_material(kuafu.Material(base_color=(0.05, 0.05, 0.05, 1.0), specular=0.0))
    scene.add_instance(scene.add_mesh(corners, [[0, 1, 3], [0, 3, 2]]), [material])
    exposures = {}
    for region in (dark, bright):
        config.ir_exposure_region = region
        sensor = StereoDepthSensor(config, scene)
        sensor.take_picture(infrared_only=True)
        exposures[region] = sensor.get_config().ir_camera_exposure * sensor.get_config().ir_camera_gain
        sensor.close()
    assert exposures[dark] > 3 * exposures[bright]
    config.ir_exposure_region = (0, 0, 500, 10)
    with pytest.raises(ValueError, match="not inside of 212x120"):
        StereoDepthSensor(config, scene)


def test_light_of_the_dots_goes_with_the_lasers_setting_and_the_emitter(config):
    config.ir_exposure_mode, config.ir_ambient_scale, config.ir_ambient_radiance = "fixed", 0.0, 0.0
    config.ir_signal, config.ir_speckle_of_laser, config.ir_speckle_noise = None, False, 0.0
    config.laser_power_mw = 300.0
    twice = StereoDepthSensor(config, wall(room=0.0))
    config.laser_power_mw, config.emitter = 150.0, "alternating"
    once = StereoDepthSensor(config, wall(room=0.0))
    for sensor in (twice, once):
        sensor.take_picture(infrared_only=True)
    assert twice.get_ir()[0].mean() - 20 / 255 == pytest.approx(2 * (once.get_ir()[0].mean() - 20 / 255), rel=0.05)
    levels = []
    for _ in range(3):
        once.take_picture(infrared_only=True)
        levels.append(once.get_ir()[0].max() * 255)
    assert levels[0] == levels[2] == pytest.approx(20.0) and levels[1] > 25.0
    config.laser_power_mw = 400.0
    with pytest.raises(ValueError, match="laser_power_mw is 400, expected 0 to 360"):
        StereoDepthSensor(config, wall())


def test_speckle_stands_still_with_the_sensor_and_differs_between_the_cameras(config):
    config.ir_signal |= {"shot_noise": 0.0, "adc_noise_dn": 0.0, "prnu": 0.0}
    config.ir_signal |= {"speckle_shape": 4.0, "speckle_scale": 0.25}
    config.ir_exposure_mode, config.ir_ambient_scale, config.ir_ambient_radiance = "fixed", 0.0, 0.0
    sensor = StereoDepthSensor(config, wall(0.4, room=0.0))
    images, clean = [], []
    for pose in (Pose(), Pose(), Pose([1e-4, 0.0, 0.0])):
        sensor.set_local_pose(pose)
        with_depth(sensor, infrared_only=True)
        images.append(np.float64(sensor.get_ir_measured()))
        clean.append(255.0 * np.float64(sensor.get_ir()))
    lit = (clean[0][0] > 40) & (clean[0][0] < 150)
    factors = [(i[0][lit] - 20) / (c[0][lit] - 20) for i, c in zip(images, clean, strict=True)]
    assert np.corrcoef(factors[0], factors[1])[0, 1] > 0.9
    assert abs(np.corrcoef(factors[0], factors[2])[0, 1]) < 0.2
    assert 0.2 < factors[0].std() < 0.6
    right = (clean[0][1] > 40) & (clean[0][1] < 150) & lit
    assert abs(np.corrcoef(((images[0] - 20) / (clean[0] - 20))[:, right])[0, 1]) < 0.3


def test_presets_limit_fireflies_in_the_optics():
    config = StereoDepthSensorConfig("d435").scaled(0.25)
    scene = wall()
    assert config.ir_optics["firefly_factor"] == 1.5 and StereoDepthSensorConfig("sapien-d435").ir_optics is None
    for optics, expected in ((config.ir_optics, 1.5), ({"firefly_factor": 3.0}, 3.0), (None, 0.0)):
        config.ir_optics = optics
        with StereoDepthSensor(config, scene) as sensor:
            assert [side.optics.firefly_factor for side in sensor.engine_inputs().sides] == [expected, expected]
    bright = []
    for optics in (None, {"firefly_factor": 1.5}):
        config.ir_optics, config.samples_per_pixel, config.denoise = optics, 1, "none"
        with StereoDepthSensor(config, scene) as sensor:
            sensor.take_picture(infrared_only=True)
            image = sensor.get_ir()[0]
            around = np.max([np.roll(image, shift, (0, 1)) for shift in AROUND], axis=0)[1:-1, 1:-1]
            bright.append(np.count_nonzero(image[1:-1, 1:-1] > 3.0 * around))
    assert bright[1] <= bright[0]


def test_rgb_is_encoded_as_the_standard_says_and_exposed_by_the_median():
    linear = np.concatenate([[-1.0, 0.0], np.geomspace(1e-6, 2.0, 5001)]).astype(np.float32)
    clipped = np.clip(np.float64(linear), 0.0, 1.0)
    expected = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(srgb(linear), expected, atol=2e-5)
    assert srgb(linear[:2]).tolist() == [0.0, 0.0] and srgb(np.float32([1.0, 7.0])).tolist() == [1.0, 1.0]
    image = np.random.default_rng(1).uniform(0.5, 1.5, (40, 60, 3)).astype(np.float32)
    image[:, :30] = 0.0
    assert rgb_exposure(image) == pytest.approx(0.25, rel=0.1)
