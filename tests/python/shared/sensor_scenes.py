# SPDX-License-Identifier: Apache-2.0
"""Scenes for one question to a sensor."""

import numpy as np

import kuafu
from activestereo import Mounts, StereoDepthSensor, StereoDepthSensorBatch
from activestereo.effects import builtin
from activestereo.model import Quantity, SensorModel
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh


def wall_scene(distance_m: float) -> kuafu.Scene:
    """A white wall across the whole view, in SAPIEN's axes: x forward, y left, z up."""
    scene = kuafu.Scene(kuafu.Device())
    corners = np.array([[distance_m, y, z] for y in (-9.0, 9.0) for z in (-9.0, 9.0)], np.float32)
    material = scene.add_material(kuafu.Material(base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0))
    scene.add_instance(scene.add_mesh(corners, [[0, 1, 3], [0, 3, 2]]), [material])
    return scene


def lit_triangle(device: kuafu.Device) -> kuafu.Scene:
    """A triangle at 2 m before the world's origin, in even light."""
    scene = kuafu.Scene(device)
    scene.add_instance(scene.add_mesh(np.array([[-9, -9, 2], [9, -9, 2], [0, 9, 2]], np.float32), [[0, 1, 2]]))
    scene.set_environment((1, 1, 1))
    return scene


def with_depth(sensor, infrared_only=False):
    """The sensor, or batch, after a picture and its depth."""
    sensor.take_picture(infrared_only=infrared_only)
    sensor.compute_depth()
    return sensor


def light_of(sensor: StereoDepthSensor) -> tuple[list[np.ndarray], list[np.ndarray | None]]:
    """The last pair of radiance, left and right, and what of it the laser has; None where all of it has speckle."""
    picture = sensor._engine.picture()
    lasers = picture.link.laser().images().copy() if picture.taken.is_laser_apart else (None, None)
    return list(picture.link.images().copy()), list(lasers)


def walls(distances_m, environment_count=None):
    """A wall in front of the origin in each environment, of which a sensor there sees nothing else."""
    scene = kuafu.Scene(kuafu.Device())
    bodies = Bodies(scene, environment_count)
    plaster = scene.add_material(kuafu.Material(base_color=(0.7, 0.7, 0.7, 1), specular=0.0))
    bodies.add("wall", [Shape(add_mesh(scene, solids.box()), [plaster], np.diag([0.1, 3.0, 3.0, 1.0]))])
    poses = np.array([[[d + 0.1, 0, 0, 1, 0, 0, 0]] for d in distances_m], float)
    bodies.move(poses if environment_count else poses[0])
    return scene


def sensor_or_batch(kind, config, scene):
    """A sensor at the origin, alone or in a batch of one."""
    if kind == "sensor":
        return StereoDepthSensor(config, scene)
    return StereoDepthSensorBatch(config, Mounts(scene, np.eye(4)[None]))


def model_of(**effects: dict[str, float]) -> SensorModel:
    """A model with these effects of these parameters."""
    model = SensorModel()
    for name, values in effects.items():
        model = model.with_effect(builtin()[name], {n: Quantity(v) for n, v in values.items()})
    return model
