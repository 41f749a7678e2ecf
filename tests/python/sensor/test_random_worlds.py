# SPDX-License-Identifier: Apache-2.0
"""Environments of a batch that differ in bodies, materials, lamps and sensors, drawn from declared ranges."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import kuafu
from activestereo import Mounts, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh
from activestereo.common.declared_ranges import read_ranges
from activestereo.sensor.random_worlds import RandomWorlds, WorldRanges, drawn_bodies

EXAMPLE = Path(__file__).resolve().parents[3] / "examples/any_simulator/random_worlds.py"
ENVIRONMENTS = 3


@pytest.fixture
def config():
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.25)
    config.samples_per_pixel, config.max_bounces = 2, 1
    return config


class World:
    """A wall at 0.8 m in each environment, and a sensor that sees nothing else."""

    def __init__(self, config, ranges=None, seed=5):
        scene = kuafu.Scene(kuafu.Device())
        bodies = Bodies(scene, ENVIRONMENTS)
        paint = scene.add_material(
            kuafu.Material(base_color=(0.5, 0.4, 0.3, 1), roughness=0.5, specular=0.0, ir_albedo=0.5)
        )
        bodies.add("wall", [Shape(add_mesh(scene, solids.box()), [paint], np.diag([0.1, 3.0, 3.0, 1.0]))])
        bodies.move(np.array([[[0.9, 0, 0, 1, 0, 0, 0]]] * ENVIRONMENTS, float))
        self.batch = StereoDepthSensorBatch(config, Mounts(scene, [[0, 0, 0, 1, 0, 0, 0]] * ENVIRONMENTS))
        self.scene, self.bodies = scene, bodies
        self.worlds = None if ranges is None else RandomWorlds(bodies, self.batch, ranges, seed)

    def look(self):
        """(mean infrared light [E], disparity, RGB)."""
        self.batch.restart(0)
        self.batch.take_picture()
        self.batch.compute_depth()
        light = self.batch.get_ir_radiance()[0].mean(axis=(1, 2))
        return light, self.batch.get_disparity().copy(), self.batch.get_rgb()


def dark(**ranges):
    return WorldRanges(lamps=(0, 0), **ranges)


def test_ranges_that_change_nothing_change_no_bit(config):
    plain, drawn = World(config), World(config, dark())
    drawn.worlds.draw()
    for a, b in zip(plain.look(), drawn.look(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_seed_makes_the_same_worlds_and_environments_differ(config):
    ranges = WorldRanges(lamps=(1, 2), albedo_factor=(0.4, 1.2), laser_power=(0.5, 1.0))
    one, two, other = World(config, ranges), World(config, ranges), World(config, ranges, seed=6)
    for world in (one, two, other):
        world.worlds.draw()
    first, again, third = one.look(), two.look(), other.look()
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[2], again[2])
    assert len(np.unique(np.round(first[0], 9))) == ENVIRONMENTS
    assert not np.isclose(first[0], third[0], rtol=1e-3).any()
    one.worlds.draw([1])  # the others stay
    later = one.look()[0]
    assert later[1] != pytest.approx(first[0][1], rel=1e-3)
    np.testing.assert_array_equal(later[[0, 2]], first[0][[0, 2]])


def test_a_sensors_laser_and_exposure_scale_its_light(config):
    config.ir_ambient_radiance = 0.0
    light = World(config, dark()).look()[0]
    for ranges in (dark(laser_power=(0.5, 0.5)), dark(exposure=(0.5, 0.5)), dark(albedo_factor=(0.5, 0.5))):
        world = World(config, ranges)
        world.worlds.draw()
        np.testing.assert_allclose(world.look()[0], 0.5 * light, rtol=2e-3, err_msg=str(ranges))


def test_a_right_eye_that_has_turned_shifts_the_disparity(config):
    """A turn about the camera's y axis by an angle a shifts the disparity by f tan a at the middle of the image: here
    two pixels, which the matcher's pull towards whole ones does not change."""
    world, turn = World(config), np.arctan(2.0 / config.ir_intrinsic[0, 0])
    before = np.median(world.look()[1][:, 50:70, 90:120], axis=(1, 2))
    rotation = np.array([[[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]])
    world.batch.vary(1, np.ones(1), np.ones(1), rotation)
    shift = np.median(world.look()[1][:, 50:70, 90:120], axis=(1, 2)) - before
    assert shift[1] == pytest.approx(2.0, abs=0.12)  # two samples a pixel: other roundings of a pose draw other noise
    assert shift[0] == shift[2] == 0.0


def test_one_thing_of_all_environments_is_varied_by_an_array(config):
    """Twice the exposure is twice the light; what is not named stays as it was."""
    world = World(config)
    before = world.look()[0]
    world.batch.vary(1, laser_power=[0.5])
    halved = world.look()[0]
    world.batch.vary(exposure=[1.0, 1.0, 2.0])
    np.testing.assert_allclose(world.look()[0], halved * np.array([1.0, 1.0, 2.0]), rtol=2e-3)
    assert halved[1] < before[1] and halved[0] == pytest.approx(before[0], rel=2e-3)


def test_bodies_are_drawn_for_each_environment():
    has = drawn_bodies(WorldRanges(bodies=(1, 2)), 200, 5, seed=1)
    assert has.shape == (200, 5) and set(has.sum(axis=1)) == {1, 2}
    assert (has.mean(axis=0) > 0.2).all() and (has == drawn_bodies(WorldRanges(bodies=(1, 2)), 200, 5, seed=1)).all()


def test_lamps_go_and_what_is_wrong_is_told(config, tmp_path):
    world = World(config, WorldRanges(lamps=(2, 2)))
    scene = world.worlds._scene
    before = scene.summary.light_count
    world.worlds.close()
    assert scene.summary.light_count == before - 2 * ENVIRONMENTS
    with pytest.raises(ValueError, match=r"environments are 0 to 2, not \[3\]"):
        world.worlds.draw([3])
    with pytest.raises(ValueError, match="exposure of environment 0 is nan, expected a finite number, 0 to 1e"):
        world.batch.vary(0, np.ones(1), np.array([np.nan]), np.eye(3)[None])
    with pytest.raises(ValueError, match="right_turn of environment 0 is no rotation"):
        world.batch.vary(0, np.ones(1), np.ones(1), np.zeros((1, 3, 3)))
    with pytest.raises(ValueError, match="laser_power of environment 2 is -1"):
        world.batch.vary(laser_power=[1.0, 1.0, -1.0])
    with pytest.raises(ValueError, match=r"exposure of the batch is \[3\] numbers"):
        world.batch.vary(exposure=[1.0])
    with pytest.raises(ValueError, match="right_eye_turn_deg must lie within -5 to 5"):
        WorldRanges(right_eye_turn_deg=(-6, 0))
    (tmp_path / "ranges.toml").write_text("laser_power = [0.5, 1.0]\n")
    assert read_ranges(tmp_path / "ranges.toml", WorldRanges).laser_power == (0.5, 1.0)


def test_the_example_runs(tmp_path):
    spec = importlib.util.spec_from_file_location("random_worlds_example", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    shares = module.run(tmp_path / "random_worlds.png", environments=3, samples=2)
    assert len(set(shares)) == 3 and min(shares) > 0.2
    assert (tmp_path / "random_worlds.png").stat().st_size > 1000


def test_worlds_that_are_closed_leave_the_scene_as_it_was(config):
    world = World(config)
    plain, counts = world.look(), world.scene.summary
    worlds = RandomWorlds(world.bodies, world.batch, WorldRanges(lamps=(1, 2)), 5)
    worlds.close()
    now = world.scene.summary
    assert (now.material_count, now.light_count) == (counts.material_count, counts.light_count)
    np.testing.assert_array_equal(plain[0], world.look()[0])
