# SPDX-License-Identifier: Apache-2.0
"""Renders room light that was measured on each surface, in place of even light from all sides.

A scene whose asset has the extras {"room_light": "emission"} stores in each surface's emission the room's light that
the surface sends out. `activestereo calibrate world` measures it. All bounces are in it, so it lights nothing else.
Nothing mirrors it: the surfaces of such a scene are matt.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

import kuafu
from activestereo.capture.capture import Capture
from activestereo.scene_io.scene_files import load_scene_file, read_document

# The share of a pixel's samples for bounced light in such a room. That light is the projector's alone, a hundredth of
# its direct light. It has no dots, and is blurred over its neighbourhood.
BOUNCED_SHARE = 1.0 / 16.0
_SPREAD_PX = 1.5
BOUNCED_VERSION = f"{BOUNCED_SHARE} spread {_SPREAD_PX}"
# Emission has no noise: more samples only cover a pixel's square more evenly.
_MOST_SAMPLES = 4


def has_room_light(scene_path: Path) -> bool:
    """Returns whether a scene file's emission is measured room light."""
    if scene_path.suffix.lower() not in (".gltf", ".glb"):
        return False
    extras = read_document(scene_path).get("asset", {}).get("extras")
    return isinstance(extras, dict) and extras.get("room_light") == "emission"


def is_measured_room(capture: Capture) -> bool:
    """Returns whether `calibrate world` made a capture and two or more of its train views have poses and depth."""
    posed = capture.measured.get("poses", {}).get("frames", [])
    train = [f for f in capture.frames if f.id in posed and f.split == "train" and f.depth_path is not None]
    return len(train) > 1 and has_room_light(capture.scene_path)


class RoomLight:
    """Renders the measured room light of a scene, from a kuafu scene of its own. Its surfaces emit that light and
    reflect nothing."""

    def __init__(self, device: kuafu.Device, scene_path: Path) -> None:
        self._scene = kuafu.Scene(device)
        load_scene_file(self._scene, scene_path)
        for number in range(self._scene.summary.material_count):
            material = self._scene.get_material(number)
            material.base_color, material.ir_albedo = (0.0, 0.0, 0.0, 1.0), 0.0
            material.ir_emission = material.emission[0]  # which glTF has for visible light alone
            self._scene.set_material(number, material)

    def images(self, renderer: kuafu.Renderer, cameras: Sequence[Any], spp: int, **options: Any) -> np.ndarray:
        """Returns radiance [camera][height][width][1] under an ambient scale of 1. No light is sampled, since the first
        hit emits all of it."""
        room = renderer.render(
            self._scene, cameras, ("ambient",), band="infrared", max_bounces=0, light_sampling="bsdf",
            spp=min(spp, _MOST_SAMPLES), **options,
        )  # fmt: skip
        return np.asarray(room["ambient"])


def spread(bounced: np.ndarray, pixel: float = 1.0) -> np.ndarray:
    """Blurs bounced light [camera][height][width][1], which is smooth, to reduce its noise. pixel: the width of its
    pixels, in camera pixels."""
    sigma = _SPREAD_PX / pixel
    return np.asarray(gaussian_filter(bounced, (0.0, sigma, sigma, 0.0), mode="nearest"))


def light_by_room(scene: kuafu.Scene, device: kuafu.Device, scene_path: Path) -> RoomLight | None:
    """Sets the ambient light of a loaded scene. If the file has measured room light, it is set to 0, and the result is
    the RoomLight that renders it. Otherwise it is 1 from all sides, and the result is None."""
    if not has_room_light(scene_path):
        scene.set_environment((1.0, 1.0, 1.0), ir_radiance=1.0)
        return None
    scene.set_environment((0.0, 0.0, 0.0), ir_radiance=0.0)
    for number in range(scene.summary.material_count):
        material = scene.get_material(number)
        material.emission, material.ir_emission, material.emission_texture = (0.0, 0.0, 0.0), 0.0, None
        scene.set_material(number, material)
    return RoomLight(device, scene_path)
