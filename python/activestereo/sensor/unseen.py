# SPDX-License-Identifier: Apache-2.0
"""Lists the bodies that a sensor's picture does not show, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import kuafu
from activestereo.common.pose import camera_to_world

if TYPE_CHECKING:
    from activestereo.sensor.sensor import StereoDepthSensor

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
