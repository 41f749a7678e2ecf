# SPDX-License-Identifier: Apache-2.0
"""A sensor under a model: the engines get what the model says, and the scene is given back."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import kuafu
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.camera.camera_file import camera_names
from activestereo.effects import Parameter, Stage, builtin, effect
from activestereo.effects.core.surfaces import SURFACES
from activestereo.common.pose import body_pose
from activestereo.scene_io.example_scene import CAMERA_TO_WORLD
from activestereo.sensor.image_effects import ModelCostWarning
from activestereo.capture.capture import Camera
from sensor_scenes import model_of, with_depth
from activestereo.model import Imager, Quantity, Rig, SensorModel, write_model

EFFECTS = builtin()
POSE = body_pose(CAMERA_TO_WORLD)
KEPT = Parameter("kept", "1", neutral=1.0, low=0.0, high=1.0, typical=0.9)


@pytest.fixture
def config() -> StereoDepthSensorConfig:
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.25)
    config.samples_per_pixel, config.max_bounces, config.ir_speckle_noise = 4, 1, 0.0
    return config


def pair_of(config, scene, model=None) -> list[np.ndarray]:
    """The infrared pair in counts, float."""
    sensor = StereoDepthSensor(config, scene, pose=POSE, model=model)
    sensor.take_picture(infrared_only=True)
    images = [255.0 * image.astype(np.float64) for image in sensor.get_ir()]
    sensor.close()
    return images


@pytest.fixture
def scene(table_top, device):
    scene = kuafu.Scene(device)
    scene.load(table_top)
    return scene


@pytest.mark.parametrize("camera", camera_names())
@pytest.mark.filterwarnings("ignore::activestereo.sensor.image_effects.ModelCostWarning")
def test_a_camera_takes_every_effect_at_its_typical_values(scene, camera):
    names = (scene.material_name(0),)
    model = SensorModel()
    for e in EFFECTS.values():
        values = {n: Quantity(v) for n, v in e.typical_values.items() if n != SURFACES.name}
        model = model.with_effect(e, values, names if SURFACES in e.parameters else ())
    StereoDepthSensor(StereoDepthSensorConfig(camera).scaled(0.125), scene, pose=POSE, model=model).close()


def test_optics_of_a_model_are_the_sensors(config, scene):
    plain, changed = pair_of(config, scene), pair_of(config, scene, model_of(vignetting={"exponent": 2.0}))
    k = config.ir_intrinsic
    v, u = np.mgrid[0 : plain[0].shape[0], 0 : plain[0].shape[1]]
    fall = (1 + ((u - k[0, 2]) / k[0, 0]) ** 2 + ((v - k[1, 2]) / k[1, 1]) ** 2) ** -1.0
    lit = (plain[0] < 250) & (changed[0] < 250)
    np.testing.assert_allclose((changed[0] - 5.0)[lit], ((plain[0] - 5.0) * fall)[lit], atol=0.1, rtol=1e-3)


def test_the_engine_keeps_the_calibration_while_the_camera_has_moved(config, scene):
    model = model_of(principal_point_offset={"cx_px": 1.5, "cy_px": 0.0})
    sensor = StereoDepthSensor(config, scene, pose=POSE, model=model)
    left, right = sensor.ir_cameras()
    assert right.k[0, 2] - left.k[0, 2] == pytest.approx(1.5)
    assert sensor.engine.rectified[0][0, 2] == pytest.approx(config.ir_intrinsic[0, 2])


def test_surfaces_are_changed_and_given_back(config, scene):
    names = [scene.material_name(n) for n in range(scene.summary.material_count)]
    clay = names.index("clay")
    model = SensorModel().with_effect(
        EFFECTS["specular"], {"factor": Quantity(0.8), "roughness": Quantity(0.3)}, ("clay",)
    )
    before, textures = scene.get_material(clay), scene.summary.texture_count
    sensor = StereoDepthSensor(config, scene, pose=POSE, model=model)
    assert scene.get_material(clay).specular == pytest.approx(0.8)
    sensor.set_conditions(temperature_c=40.0)
    sensor.take_picture(infrared_only=True)
    assert scene.get_material(clay).specular == pytest.approx(0.8)  # not twice
    sensor.close()
    assert scene.get_material(clay).specular == before.specular == 0.0
    assert scene.summary.texture_count <= textures + 1


def test_a_material_that_the_scene_lacks_is_named_and_nothing_is_changed(config, scene):
    model = model_of(vignetting={"exponent": 1.0}).with_effect(
        EFFECTS["specular"], {"factor": Quantity(0.8)}, ("jelly",)
    )
    lights = scene.summary.light_count
    with pytest.raises(ValueError, match="specular: the scene has no material 'jelly'"):
        StereoDepthSensor(config, scene, pose=POSE, model=model)
    assert scene.summary.light_count == lights


def test_what_depends_on_warmth_follows_the_conditions(config, scene):
    model = model_of(thermal_drift={"cx_px_per_k": 0.05, "focal_per_k": 0.0})
    sensor = StereoDepthSensor(config, scene, pose=POSE, model=model)
    assert sensor.ir_cameras()[1].k[0, 2] == pytest.approx(config.ir_intrinsic[0, 2])
    sensor.set_conditions(temperature_c=45.0)
    assert sensor.ir_cameras()[1].k[0, 2] == pytest.approx(config.ir_intrinsic[0, 2] + 1.0)


def test_a_users_effect_acts_at_its_stage_and_says_what_it_costs(config, scene):
    @effect("dimmer", stage=Stage.CHARGE, family="x", source="x", parameters=[KEPT])
    def dimmer(signal, view, kept):
        """Less light is counted."""
        return signal * kept

    model = SensorModel().with_effect(dimmer, {"kept": Quantity(0.6)})
    plain = pair_of(config, scene)
    with pytest.warns(ModelCostWarning, match="dimmer"):
        dimmed = pair_of(config, scene, model)
    lit = plain[1] < 250
    np.testing.assert_allclose((dimmed[1] - 5.0)[lit], 0.6 * (plain[1] - 5.0)[lit], atol=1e-2)


@pytest.mark.parametrize("is_laser_apart", [False, True])
def test_an_effect_on_light_changes_the_laser_s_part_as_the_whole(config, scene, is_laser_apart):
    """Half of the projector's light, which alone has speckle or has none: the room's light stays."""

    @effect("half_laser", stage=Stage.PROJECTOR, family="x", source="x", parameters=[KEPT])
    def half_laser(light, view, kept):
        """Less of the projector's light arrives."""
        return replace(light, direct=kept * light.direct, indirect=kept * light.indirect, flat=kept * light.flat)

    def taken(model, laser_mw):
        config.laser_power_mw, config.ir_speckle_of_laser = laser_mw, is_laser_apart
        sensor = StereoDepthSensor(config, scene, pose=POSE, model=model)
        sensor.take_picture(infrared_only=True)
        picture = sensor._engine.picture()
        images = [picture.link.images().copy()]
        images += [picture.link.laser().images().copy()] if is_laser_apart else []
        sensor.close()
        return images

    with pytest.warns(ModelCostWarning, match="half_laser"):
        found = taken(SensorModel().with_effect(half_laser, {"kept": Quantity(0.5)}), config.laser_power_mw)
    expected = taken(None, 0.5 * config.laser_power_mw)
    for image, other in zip(found, expected, strict=True):
        assert image.mean() == pytest.approx(other.mean(), rel=0.02)


@pytest.mark.parametrize(("name", "values"), [("quantisation", {"step_dn": 16.0}), ("post_filter", {"step_px": 0.5})])
def test_built_in_effects_of_images_act_on_counts_and_on_disparity(config, scene, name, values):
    with pytest.warns(ModelCostWarning, match=name):
        sensor = StereoDepthSensor(config, scene, pose=POSE, model=model_of(**{name: values}))
    with_depth(sensor, infrared_only=True)
    if name == "quantisation":
        assert set(np.unique(sensor.get_ir_measured()[0])) <= {*range(0, 256, 16), 255}
    else:
        disparity = sensor.get_disparity()[sensor.get_disparity() > 0]
        np.testing.assert_allclose(disparity, np.rint(disparity / 0.5) * 0.5, atol=1e-3)
        assert (sensor.get_depth() > 0).mean() > 0.5
    sensor.close()


@pytest.mark.filterwarnings("ignore::activestereo.sensor.image_effects.ModelCostWarning")
def test_a_sensor_averages_over_the_frames_that_it_took(config, scene):
    def change(alpha):
        config.ir_speckle_noise = 0.3
        model = model_of(temporal_filter={"alpha": alpha, "delta_px": 1.0})
        sensor, taken = StereoDepthSensor(config, scene, pose=POSE, model=model), []
        for _ in range(6):
            with_depth(sensor, infrared_only=True)
            taken.append(sensor.get_disparity())
        sensor.close()
        both = (taken[-1] > 0) & (taken[-2] > 0) & (np.abs(taken[-1] - taken[-2]) < 0.9)
        return np.mean((taken[-1] - taken[-2])[both] ** 2)

    assert change(0.4) < 0.4 * change(1.0)  # by theory 0.4 / (2 - 0.4) * 0.4 = 0.1 where the noise is small


def test_a_model_of_engine_fields_alone_warns_of_nothing(config, scene):
    with warnings.catch_warnings():
        warnings.simplefilter("error", ModelCostWarning)
        pair_of(config, scene, model_of(veiling_glare={"fraction": 0.1}))


def test_a_configuration_from_a_model_has_its_rig_imager_and_scales(tmp_path):
    k = np.array([[300.0, 0, 150.0], [0, 301.0, 90.0], [0, 0, 1]])
    to_right, to_projector = np.eye(4), np.eye(4)
    to_right[0, 3], to_projector[:2, 3] = -0.06, (-0.02, 0.01)
    camera = Camera(320, 180, k)
    model = SensorModel(
        rig=Rig(camera, camera, to_right, to_projector, bit_depth=10, exposure_s=0.004, gain=2.0),
        imager=Imager(Quantity(0.25 + 1 / 12), Quantity(0.01), Quantity(0.002)),
        nuisances={"projector_scale": Quantity(60000.0), "black_dn": Quantity(7.0)},
    )
    write_model(tmp_path / "model.json", model)
    config = StereoDepthSensorConfig.from_model(tmp_path / "model.json")
    assert config.ir_resolution == (320, 180) and config.rectified
    assert config.rgb_resolution == (320, 181) and config.max_disparity == 48  # the D435's at this size
    assert np.linalg.norm(config.trans_pose_r.p - config.trans_pose_l.p) == pytest.approx(0.06)
    assert np.linalg.norm(config.pose_rgb_irproj.p - config.trans_pose_l.p) == pytest.approx(np.hypot(0.02, 0.01))
    assert (config.ir_black_level_dn, config.projector_intensity, config.ir_camera_exposure) == (7.0, 1.5, 0.004)
    noise = {"adc_noise_dn": 0.5, "shot_noise": 0.1, "speckle_shape": 500.0, "speckle_scale": 0.002}
    assert config.ir_signal == pytest.approx({"bit_depth": 10, "gain": 2.0, **noise})


def test_an_eye_that_opens_later_stands_where_the_rig_is_by_then(config, scene):
    lights = scene.summary.light_count
    sensor = StereoDepthSensor(config, scene, pose=POSE, model=model_of(exposure_desync={"delay_s": 0.01}))
    at_rest = [camera.camera_to_world for camera in sensor.ir_cameras()]
    sensor.set_velocity([0.5, 0.0, 0.0])
    moving = [camera.camera_to_world for camera in sensor.ir_cameras()]
    np.testing.assert_array_equal(moving[0], at_rest[0])
    np.testing.assert_allclose(moving[1][:3, 3] - at_rest[1][:3, 3], 0.005 * at_rest[0][:3, 0], atol=1e-6)
    sensor.take_picture(infrared_only=True)
    assert min(image.max() for image in sensor.get_ir()) > 0.3  # both cameras see dots
    sensor.close()
    assert scene.summary.light_count == lights
