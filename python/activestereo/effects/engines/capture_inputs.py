# SPDX-License-Identifier: Apache-2.0
"""Makes the EngineInputs of a capture's frame from its calibration, pose and settings, before any effect. Corrects
calibration and scene by values that a fit finds beside the effects: focal lengths, albedos, material fields.

Changes the materials and the medium of a kuafu scene as effects ask, and restores them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.capture.capture import Capture, Frame
from activestereo.common.lens import lens_fields
from activestereo.common.pose import carried_twist, motion_of_twist
from activestereo.effects.core.engine import EngineCamera, EngineInputs
from activestereo.effects.core.moved import frame_signal

# The texture that a measured value replaces.
_TEXTURES = {
    "roughness": "metallic_roughness_texture",
    "metallic": "metallic_roughness_texture",
    "specular": "specular_texture",
    "transmission": "transmission_texture",
    "ir_albedo": "ir_albedo_texture",
}


def set_surface(material: kuafu.Material, values: Mapping[str, float]) -> None:
    """Sets measured fields of a material, {name: value}, and removes the textures that they replace."""
    for name, value in values.items():
        setattr(material, name, value)
        setattr(material, _TEXTURES[name], None)
    if "roughness" in values:
        material.transmission_roughness = values["roughness"]


@dataclass(frozen=True)
class SceneMeasurement:
    """Corrections of calibration and scene. focal: relative change of the left and the right focal length. albedo:
    {material id: factor on its infrared albedo}. surfaces: {material id: {field of kuafu's Material: new value}}."""

    focal: tuple[float, float] = (0.0, 0.0)
    albedo: dict[int, float] = field(default_factory=dict)
    surfaces: dict[int, dict[str, float]] = field(default_factory=dict)

    def apply(self, inputs: EngineInputs) -> None:
        """Corrects the focal lengths, material fields and albedos of the inputs in place."""
        for side, change in zip(inputs.sides, self.focal, strict=True):
            if change:
                side.scale_focal(1.0 + change)
        for number, values in self.surfaces.items():
            set_surface(inputs.material(number), values)
        for number, factor in self.albedo.items():
            material = inputs.material(number)
            textures = material.ir_albedo_texture, material.base_color_texture
            if material.ir_albedo is None and textures == (None, None):
                material.ir_albedo = material.base_color[0]
            if material.ir_albedo is None:
                red, green, blue, alpha = material.base_color
                material.base_color = (min(1.0, red * factor), green, blue, alpha)
            else:
                material.ir_albedo = min(1.0, material.ir_albedo * factor)


# The box of a medium extends beyond scene and rig by this margin.
_MARGIN_M = 0.05


def bounds_around(scene: kuafu.Scene, places: Iterable[NDArray[np.float64]]) -> tuple[tuple[float, ...], ...]:
    """Returns the lowest and the highest corner of a box around the scene and the rig's places [3], with a margin."""
    summary = scene.summary
    corners = [summary.bounds_min_m, summary.bounds_max_m] if summary.triangle_count else []
    points = np.array([*corners, *places])
    return tuple(points.min(axis=0) - _MARGIN_M), tuple(points.max(axis=0) + _MARGIN_M)


def capture_inputs(
    capture: Capture, frame: Frame, scene: kuafu.Scene, pattern: NDArray[np.float32], seed: int = 0
) -> EngineInputs:
    """Returns the engines' inputs for a frame, with the projector at 1 W/sr and ambient radiance 1. Nuisances (DN per
    second and gain, found by a fit) scale the images later. The exposure is an instant, also in a moving frame, until
    an effect changes it."""
    rig, own = capture.rig, capture.rig.projector

    def moved(left_to_it: NDArray[np.float64]) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Returns (pose [4][4] of a rig's part in the world, its velocities in its own frame as keyword arguments).
        left_to_it: from the left camera's frame to the part's."""
        linear, angular = carried_twist(left_to_it, frame.camera_velocity).reshape(2, 3)
        pose = frame.camera_to_world @ np.linalg.inv(left_to_it)
        return pose, {"linear_velocity": linear, "angular_velocity": angular}

    def side(name: str, left_to_side: NDArray[np.float64]) -> EngineCamera:
        camera, (pose, velocities) = rig.camera(name), moved(left_to_side)
        lens = lens_fields(camera.distortion)
        seen = kuafu.Camera(camera.width, camera.height, camera.K, pose, **lens, **velocities)
        return EngineCamera(seen, kuafu.Optics(), frame_signal(frame))

    pose, velocities = moved(own.left_to_projector)
    return EngineInputs(
        left=side("left", np.eye(4)),
        right=side("right", rig.left_to_right),
        projector=kuafu.Light(
            kind="projector", name="projector", k=own.K, ir_intensity=1.0, light_to_world=pose, **velocities
        ),
        pattern=pattern,
        frame=frame,
        scene_materials=scene.get_material,
        material_count=scene.summary.material_count,
        bounds_m=bounds_around(scene, (f.camera_to_world[:3, 3] for f in capture.frames)),
        max_dn=float(rig.max_dn),
        seed=seed,
    )


def _fields(record: Any) -> dict[str, Any]:
    """Returns {name: value} of all fields of one of kuafu's records."""
    return {n: getattr(record, n) for n, value in vars(type(record)).items() if isinstance(value, property)}


def record_key(record: Any) -> tuple:
    """Returns (name, value) of all fields of one of kuafu's records, () for None. Equal keys mean equal records."""
    values = {} if record is None else _fields(record)
    return tuple((n, v.tobytes() if isinstance(v, np.ndarray) else v) for n, v in values.items())


def copy_record(record: Any, **changes: Any) -> Any:
    """Returns a copy of one of kuafu's records, with other values of some fields."""
    return type(record)(**_fields(record) | changes)


def copy_later(record: Any, delay_s: float) -> Any:
    """Returns a copy of a kuafu.Camera or kuafu.Light at its pose `delay_s` seconds after its time: pose exp(t [v, w]),
    with its velocities in its own frame."""
    if delay_s == 0.0:
        return copy_record(record)
    name = "light_to_world" if isinstance(record, kuafu.Light) else "camera_to_world"
    motion = motion_of_twist(delay_s * np.concatenate([record.linear_velocity, record.angular_velocity]))
    return copy_record(record, **{name: getattr(record, name) @ motion})


def world_key(inputs: EngineInputs) -> tuple:
    """Returns a key of the materials and the medium, which all poses of one render share."""
    materials = tuple((number, record_key(m)) for number, m in sorted(inputs.materials.items()))
    return materials, record_key(inputs.medium)


def keeps_surfaces(inputs: EngineInputs) -> bool:
    """Returns whether the inputs change diffuse albedos at most: no other material field, no fog, no added light."""
    same = all(
        record_key(m)
        == record_key(copy_record(inputs.scene_materials(number), base_color=m.base_color, ir_albedo=m.ir_albedo))
        for number, m in inputs.materials.items()
    )
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
