# SPDX-License-Identifier: Apache-2.0
"""A MuJoCo model mirrored into a scene, against MuJoCo's own rays."""

from types import SimpleNamespace

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="the package mujoco is not installed (pip install mujoco)")

import kuafu
from activestereo import StereoDepthSensor
from activestereo.scene_io.bodies import BodyPoseError
from activestereo.integrations.mujoco import MujocoScene

XML = """<mujoco>
<asset>
  <texture name="planks" type="2d" builtin="checker" rgb1=".8 .6 .4" rgb2=".3 .2 .1" width="64" height="64"/>
  <texture name="die" type="cube" builtin="gradient" rgb1="1 0 0" rgb2="0 0 1" width="16" height="16"/>
  <material name="wood" texture="planks" texrepeat="4 4" specular="0"/>
  <material name="painted" texture="die"/>
  <material name="steel" rgba=".6 .6 .6 1" metallic="1" roughness=".3"/>
  <mesh name="wedge" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1"/>
  <hfield name="dune" nrow="5" ncol="7" size=".2 .15 .05 .01"/>
</asset>
<worldbody>
  <light name="lamp" pos=".3 .3 1.5" dir="-.2 -.2 -1"/>
  <light name="sun" type="directional" dir="0 .3 -1"/>
  <geom name="floor" type="plane" size="0 0 .1" material="wood"/>
  <geom name="dune" type="hfield" hfield="dune" pos="-.3 .45 0"/>
  <geom name="hidden" type="box" size=".1 .1 .1" pos=".2 0 .4" group="3"/>
  <geom name="clear" type="box" size=".1 .1 .1" pos=".2 0 .4" rgba="1 1 1 0"/>
  <body name="die" pos="0 0 .05" euler="0 0 20"><freejoint/>
    <geom name="die" type="box" size=".06 .05 .04" material="painted"/></body>
  <body name="ball" pos=".2 .2 .06"><freejoint/><geom name="ball" type="sphere" size=".06" material="steel"/></body>
  <body name="egg" pos="-.2 .2 .06"><freejoint/>
    <geom name="egg" type="ellipsoid" size=".04 .05 .06" rgba=".9 .8 .7 1"/></body>
  <body name="can" pos=".2 -.2 .06"><freejoint/>
    <geom name="can" type="cylinder" size=".04 .06" rgba=".2 .7 .3 1"/></body>
  <body name="pill" pos="-.2 -.2 .06" euler="90 0 0"><freejoint/>
    <geom name="pill" type="capsule" size=".03 .05"/></body>
  <body name="wedge" pos="0 -.25 .02"><freejoint/><geom name="wedge" type="mesh" mesh="wedge" rgba=".9 .9 .1 1"/></body>
  <body name="arm" pos="-.75 0 .55"><camera name="wrist" xyaxes="0 -1 0 .6 0 .85"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(XML)


def state(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def ray_depth(model, data, config, groups=(1, 1, 1, 0, 0, 0)):
    """Depth of the pixels' centres, by MuJoCo's rays, and the geoms they hit."""
    camera = model.camera("wrist").id
    to_world = data.cam_xmat[camera].reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])
    width, height = config.rgb_resolution
    v, u = np.mgrid[:height, :width]
    rays = np.linalg.inv(config.rgb_intrinsic) @ np.stack([u.ravel(), v.ravel(), np.ones(u.size)])
    rays = (to_world @ rays).T
    depth, geoms = np.zeros(u.size), np.full(u.size, -1)
    hit = np.zeros((1, 1), np.int32)
    for i, ray in enumerate(rays):  # of a length that makes the distance the depth
        depth[i] = mujoco.mj_ray(model, data, data.cam_xpos[camera], ray, np.array(groups, np.uint8), 1, -1, hit)
        geoms[i] = hit[0, 0]
    return depth.reshape(height, width), geoms.reshape(height, width)


def test_true_depth_is_that_of_mujocos_rays(model, small_config):
    config = small_config.scaled(0.25)
    config.samples_per_pixel = 1
    data = state(model)
    world = MujocoScene(model, data)
    sensor = StereoDepthSensor(config, world.mount("wrist"))
    sensor.take_picture()
    depth, (expected, geoms) = sensor.get_true_depth(), ray_depth(model, data, config)
    seen = {model.geom(g).name for g in np.unique(geoms) if g >= 0}
    assert seen >= {"floor", "die", "ball", "egg", "can", "pill", "wedge", "dune"}
    flat = np.isin(geoms, [model.geom(name).id for name in ("floor", "die", "wedge")]) & (depth > 0)
    same = np.isclose(depth, expected, atol=1e-5)
    assert same[flat].mean() > 0.99  # but for silhouettes, where a pixel's centre may fall on either side
    round_ones = np.isin(geoms, [model.geom(name).id for name in ("ball", "egg", "can", "pill")])
    assert np.isclose(depth, expected, atol=5e-4)[round_ones].mean() > 0.97  # triangles lie below the curve
    names = {model.geom(int(k) - 1).name for k in np.unique(sensor.get_picture("semantic_id")) if k}
    assert names == seen


def test_only_what_moved_is_updated_and_it_is_seen_where_it_is(model, small_config):
    config = small_config.scaled(0.25)
    config.samples_per_pixel = 1
    data = state(model)
    world = MujocoScene(model, data)
    sensor = StereoDepthSensor(config, world.mount("wrist"))
    assert world.update() == 0
    first = model.jnt_qposadr[model.body("ball").jntadr[0]]
    data.qpos[first : first + 3] = (0.1, 0.0, 0.3)
    mujoco.mj_forward(model, data)
    assert world.update() == 1
    sensor.take_picture()
    expected, geoms = ray_depth(model, data, config)
    ball = geoms == model.geom("ball").id
    assert ball.sum() > 20
    assert np.isclose(sensor.get_true_depth(), expected, atol=5e-4)[ball].mean() > 0.97


def test_a_sensor_rides_on_a_camera_or_a_body(model):
    world = MujocoScene(model, state(model))
    camera, body = world.mount("wrist"), world.mount(body="die")
    forward = camera.pose[:3, 0]
    to_middle = -camera.pose[:3, 3] / np.linalg.norm(camera.pose[:3, 3])
    assert forward @ to_middle > 0.99
    np.testing.assert_allclose(body.pose[:3, 3], [0, 0, 0.05], atol=1e-9)
    with pytest.raises(ValueError, match="no camera 'wirst' .known: wrist"):
        world.mount("wirst")
    with pytest.raises(ValueError, match="name one of them"):
        world.mount()


def test_looks_come_from_the_model(model):
    world = MujocoScene(model, state(model))
    scene = world.scene
    materials = {m.name: m for m in map(scene.get_material, range(scene.summary.material_count))}
    assert materials["steel"].metallic == 1.0 and materials["steel"].roughness == pytest.approx(0.3)
    assert materials["wood"].base_color_texture is not None and materials["wood"].specular == 0.0
    assert scene.summary.texture_count == 2
    lights = [scene.get_light(k) for k in range(scene.summary.light_count)]
    assert {(k.name, k.kind) for k in lights} == {("lamp", "spot"), ("sun", "directional")}
    np.testing.assert_allclose(lights[1].intensity, np.pi * 0.7, rtol=1e-6)


def test_lights_are_switched_and_dimmed_with_the_model():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom size=".1"/><light type="directional" dir="0 0 -1"/>
        <light type="directional" dir="0 1 -1" active="false"/></worldbody></mujoco>"""
    )
    world = MujocoScene(model, state(model))
    assert world.scene.summary.light_count == 1
    model.light_diffuse[0] *= 0.5
    model.light_active[1] = True
    world.update()
    intensities = [world.scene.get_light(n).intensity[0] for n in range(2)]
    np.testing.assert_allclose(intensities, [0.5 * np.pi * 0.7, np.pi * 0.7], rtol=1e-6)
    model.light_active[0] = False
    world.update()
    assert world.scene.get_light(0).intensity == (0.0, 0.0, 0.0)
    model.vis.headlight.active = False
    told = []
    world.scene = SimpleNamespace(set_environment=told.append)
    world._lights, model.light_active[:] = {}, False
    world.update()
    world.update()
    assert told == [(0.0, 0.0, 0.0)]


def test_a_lambertian_floor_shines_as_mujoco_says(model):
    """Under a directional light d at an angle a its radiance is colour times (d cos a + ambient)."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><visual><headlight ambient=".1 .1 .1" diffuse="0 0 0"/></visual>
        <asset><material name="matt" rgba=".5 .5 .5 1" specular="0"/></asset>
        <worldbody><light type="directional" dir="0 1 -1" diffuse=".6 .6 .6" ambient="0 0 0"/>
        <geom type="plane" size="5 5 .1" material="matt"/></worldbody></mujoco>"""
    )
    world = MujocoScene(model, state(model))
    down = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2], [0, 0, 0, 1]]
    camera = kuafu.Camera(16, 16, [[40, 0, 7.5], [0, 40, 7.5], [0, 0, 1]], down)
    renderer = kuafu.Renderer(world.scene.device)
    image = renderer.render(world.scene, camera, ["radiance"], band="visible", spp=64)["radiance"]
    assert image.mean() == pytest.approx(0.5 * (0.6 * np.cos(np.pi / 4) + 0.1), rel=0.02)


def test_a_batch_of_states_and_one_that_went_to_nan(model):
    states = [state(model) for _ in range(3)]
    world = MujocoScene(model, states)
    assert world.mount("wrist").poses.shape == (3, 4, 4)
    for data in states:
        data.qpos[2] += 0.1
    states[1].geom_xpos[model.geom("die").id] = np.nan
    for data in (states[0], states[2]):
        mujoco.mj_forward(model, data)
    with pytest.raises(BodyPoseError, match="environment 1, body 'die'") as caught:
        world.update()
    assert (caught.value.environment, caught.value.body) == (1, "die")
    mujoco.mj_forward(model, states[1])
    assert world.update() == 1  # the others had moved before
