# SPDX-License-Identifier: Apache-2.0
"""Cameras of SAPIEN and ManiSkill: their position, normal and albedo pictures, of the host or of CUDA."""

from __future__ import annotations

from typing import Any

_PICTURES = ("Position", "Normal", "Albedo")  # RGBA, floats; x right, y up, z backward


def sapien_gbuffers(camera: Any) -> dict[str, Any]:
    """camera: sapien.render.RenderCameraComponent for one environment, or ManiSkill's RenderCamera (`camera.camera` of
    its Camera) for all. It has taken its pictures, with shader pack 'default' or 'rt' and the sensor's matrix."""
    pictures = []
    for name in _PICTURES:
        picture = camera.get_picture(name)
        pictures.append(picture[0] if isinstance(picture, list) else picture)  # ManiSkill's are lists
    position, normal, albedo = pictures
    down_and_forward = normal[..., :3] * 1.0
    down_and_forward[..., 1:] *= -1.0
    return {"depth": -position[..., 2], "normal": down_and_forward, "albedo": albedo[..., :3]}
