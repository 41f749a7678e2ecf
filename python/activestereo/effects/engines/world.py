# SPDX-License-Identifier: Apache-2.0
"""Puts effects' changes of the world (materials, the medium) into a kuafu scene, and takes them back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import kuafu
from activestereo.effects.core.engine import EngineInputs, moved_pose


def record_key(record: Any) -> tuple:
    """Returns (name, value) of all fields of one of kuafu's records, () for None. Equal keys mean equal records."""
    if record is None:
        return ()
    names = [n for n, value in vars(type(record)).items() if isinstance(value, property)]
    return tuple(
        (n, value.tobytes() if isinstance(value, np.ndarray) else value)
        for n in names
        for value in [getattr(record, n)]
    )


def copy_record(record: Any) -> Any:
    """Returns a copy of one of kuafu's records, field by field. Cameras need copy_camera: their constructor takes
    arguments."""
    return type(record)(
        **{n: getattr(record, n) for n, value in vars(type(record)).items() if isinstance(value, property)}
    )


def copy_camera(camera: kuafu.Camera, delay_s: float) -> kuafu.Camera:
    """Returns a copy of the camera at its pose `delay_s` seconds after its time."""
    names = ("lens_model", "distortion", "lens_radius_m", "focus_m", "shutter", "readout", "exposure_s", "line_time_s")
    fields = {name: getattr(camera, name) for name in (*names, "linear_velocity", "angular_velocity")}
    pose = moved_pose(camera.camera_to_world, camera.linear_velocity, camera.angular_velocity, delay_s)
    return kuafu.Camera(camera.width, camera.height, camera.k, pose, camera.near_m, camera.far_m, **fields)


def copy_light(light: kuafu.Light, delay_s: float = 0.0) -> kuafu.Light:
    """Returns a copy of the light at its pose `delay_s` seconds after its time."""
    later = copy_record(light)
    later.light_to_world = moved_pose(light.light_to_world, light.linear_velocity, light.angular_velocity, delay_s)
    return later


def world_key(inputs: EngineInputs) -> tuple:
    """Returns a key of the materials and the medium, which all poses of one render share."""
    materials = tuple((number, record_key(m)) for number, m in sorted(inputs.materials.items()))
    return materials, record_key(inputs.medium)


def keeps_surfaces(inputs: EngineInputs) -> bool:
    """Returns whether the inputs change nothing in the world but diffuse albedos: no new gloss, glass, fog or lamp."""

    def as_in_scene(number: int, material: kuafu.Material) -> kuafu.Material:
        own = inputs.scene_materials(number)
        own.base_color, own.ir_albedo = material.base_color, material.ir_albedo
        return own

    changed = inputs.materials.items()
    same = all(record_key(m) == record_key(as_in_scene(number, m)) for number, m in changed)
    return same and inputs.medium is None and not inputs.added_lights


@contextmanager
def changed_world(scene: kuafu.Scene, inputs: EngineInputs) -> Iterator[None]:
    """Gives the scene the inputs' materials and medium while the context lasts, and restores it afterwards."""
    before = {number: scene.get_material(number) for number in inputs.materials}
    try:
        enter_world(scene, inputs)
        yield
    finally:
        for number, material in before.items():
            scene.set_material(number, material)
        if inputs.medium is not None:
            scene.set_medium(None)


def enter_world(scene: kuafu.Scene, inputs: EngineInputs) -> None:
    """Gives the scene the inputs' materials and medium."""
    for number, material in inputs.materials.items():
        scene.set_material(number, material)
    if inputs.medium is not None:
        scene.set_medium(inputs.medium)
