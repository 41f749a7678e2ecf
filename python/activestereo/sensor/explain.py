# SPDX-License-Identifier: Apache-2.0
"""Explains a picture: how much each light contributes to its infrared light, and why a body is not visible in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.pose import camera_to_world
from activestereo.scene_io.staging import ALL_SIDES, LAMPS, SURFACES

if TYPE_CHECKING:
    from activestereo.sensor.sensor import StereoDepthSensor


_Record = TypeVar("_Record")
_SAMPLES = 4  # few per pixel, because only means over many pixels are used
_GROUPS = {group: f"light_group_{group}" for group in (LAMPS, SURFACES, ALL_SIDES)}


@dataclass(frozen=True)
class LightShare:
    """States which lights make the infrared light in the middle of the left camera's picture. Only the tenth of these
    pixels that the projector lights most count; without a projector all do.

    distance_m: median distance of these pixels. projector: the projector's share of their light, 0..1. brightest,
    brightest_share: name and share of the brightest other light; None if there is none."""

    distance_m: float
    projector: float
    brightest: str | None
    brightest_share: float


def light_share(sensor: StereoDepthSensor) -> LightShare | None:
    """Measures LightShare by a render with few samples and separate outputs for each group of lights. Returns None if
    the picture shows no surface or no infrared light."""
    has_projector = sensor.get_config().light_pattern is not None
    names = ["depth", "position", *_GROUPS.values(), *(["projector"] if has_projector else [])]
    seen = sensor.get_pictures(names, "left", samples_per_pixel=_SAMPLES, denoise="none")
    # Measure at surfaces in the middle third of the picture, or in all of it if the middle shows none.
    has_surface = seen["depth"][..., 0] > 0
    height, width = has_surface.shape
    middle = np.zeros(has_surface.shape, bool)
    middle[height // 3 : -(height // 3), width // 3 : -(width // 3)] = True
    middle &= has_surface
    if not middle.any():
        middle = has_surface
    if not middle.any():
        return None
    distance_m, place = float(np.median(seen["depth"][middle])), np.median(seen["position"][middle], axis=0)
    if has_projector:
        dots = seen["projector"][..., 0]
        middle &= dots >= np.quantile(dots[middle], 0.9)
    light = {name: float(np.mean(seen[name][middle])) for name in names[2:]}
    total = sum(light.values())
    if total <= 0.0:
        return None
    group = max(_GROUPS, key=lambda number: light[_GROUPS[number]])
    share = light[_GROUPS[group]] / total
    name, part = _brightest(sensor.scene, group, place)
    return LightShare(
        distance_m=distance_m,
        projector=light.get("projector", 0.0) / total,
        brightest=name if share > 0.0 else None,
        brightest_share=share * part,
    )


def _brightest(scene: kuafu.Scene, group: int, point: NDArray[np.floating[Any]]) -> tuple[str, float]:
    """Returns (name, share of the group's light) of the brightest light in a group, by its unshadowed irradiance at
    `point`."""
    if group == ALL_SIDES:
        return "the light from all sides", 1.0
    if group == SURFACES:
        materials = _present(scene.get_material, scene.summary.material_count)
        level = [material.ir_emission for material in materials]
        count = sum(value > 0 for value in level)
        name = f"'{materials[int(np.argmax(level))].name}'"
        return (name if count == 1 else f"{name} and {count - 1} other shining surfaces"), 1.0
    lights = _present(scene.get_light, scene.summary.light_count)
    falls = [0.0 if light.kind == "projector" else _irradiance(light, point) for light in lights]
    best = int(np.argmax(falls))
    name = lights[best].name or f"lamp {best}"
    return f"'{name}'", falls[best] / max(sum(falls), 1e-30)


def _present(get: Callable[[int], _Record], count: int) -> list[_Record]:
    """Returns the first `count` records of get(number). Skips numbers whose record was removed, such as a model's
    lights."""
    out: list[_Record] = []
    number = 0
    while len(out) < count:
        try:
            out.append(get(number))
        except kuafu.ArgumentError:
            pass
        number += 1
    return out


def _irradiance(light: kuafu.Light, point: NDArray[np.floating[Any]]) -> float:
    """Returns a light's infrared irradiance, W/m^2, at `point` on a surface facing it, before the camera's
    ir_ambient_scale."""
    pose = np.asarray(light.light_to_world)
    level = (light.ir_share or 1.0) * light.intensity[0] if light.ir_intensity is None else light.ir_intensity
    if light.kind == "directional":
        return level
    away = point - pose[:3, 3]
    square = max(float(away @ away), 1e-12)
    if light.kind == "spot" and away @ pose[:3, 2] < np.cos(light.outer_rad) * np.sqrt(square):
        return 0.0
    return level / square


_SIDE = 256  # pixels of each face of the cube around the camera
# Rotations from the camera's axes (x right, y down, z forward) to those of a camera that looks in that direction.
_AROUND = {
    "outside the picture": np.eye(3),
    "to the right of the picture": np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
    "to the left of the picture": np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "below the picture": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "above the picture": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "behind the camera": np.diag([-1, 1, -1]),
}
_NOWHERE = "hidden behind others, transparent, or smaller than a pixel"


def unseen_bodies(sensor: StereoDepthSensor) -> list[tuple[str, str]]:
    """Returns (body, reason) for each body that no pixel of the RGB picture shows within the sensor's range, in the
    scene's order."""
    config, scene = sensor.get_config(), sensor.scene
    ids, depth = sensor.get_instance_ids(), sensor.get_true_depth()
    out: dict[int, str] = {}
    missing = set(range(scene.summary.instance_count))
    for number in np.unique(ids[depth > 0]).tolist():
        missing.discard(number)
        near, far = (float(end(depth[(ids == number) & (depth > 0)])) for end in (np.min, np.max))
        if near > config.max_depth_m:
            out[number] = f"{near:.3g} m away, beyond the sensor's {config.max_depth_m:g} m"
        elif far < config.min_depth_m:
            out[number] = f"{far:.3g} m away, nearer than the sensor's {config.min_depth_m:g} m"
    if missing:  # cameras that look around from the sensor's place
        pose, middle = camera_to_world(sensor.get_pose()), 0.5 * (_SIDE - 1)
        k = np.array([[0.5 * _SIDE, 0, middle], [0, 0.5 * _SIDE, middle], [0, 0, 1]])
        cameras = []
        for turn in _AROUND.values():
            view = pose.copy()
            view[:3, :3] = pose[:3, :3] @ turn
            cameras.append(kuafu.Camera(_SIDE, _SIDE, k, view))
        settings: dict[str, Any] = {"band": "visible", "environments": [0] * len(cameras), "spp": 1, "max_bounces": 0}
        images = kuafu.Renderer(scene.device).render(scene, cameras, ["instance_id"], **settings)["instance_id"]
        for where, image in zip(_AROUND, images, strict=True):
            found = missing & set(np.unique(image).tolist())
            out |= dict.fromkeys(found, where)
            missing -= found
    out |= dict.fromkeys(missing, _NOWHERE)
    return [(scene.instance_name(number) or f"body {number}", out[number]) for number in sorted(out)]
