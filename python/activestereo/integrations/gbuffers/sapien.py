# SPDX-License-Identifier: Apache-2.0
"""Reads position, normal and albedo pictures from cameras of SAPIEN and ManiSkill, on the host or on CUDA."""

from __future__ import annotations

from typing import Any

_PICTURES = ("Position", "Normal", "Albedo")  # RGBA, floats; x right, y up, z backward


def sapien_gbuffers(camera: Any) -> dict[str, Any]:
    """Returns GBufferStereo's arguments from the pictures that a camera has taken, with shader pack 'default' or 'rt'
    and the sensor's matrix. camera: a sapien.render.RenderCameraComponent for one environment, or ManiSkill's
    RenderCamera (`camera.camera` of its Camera) for all."""
    pictures = []
    for name in _PICTURES:
        picture = camera.get_picture(name)
        pictures.append(picture[0] if isinstance(picture, list) else picture)  # ManiSkill's are lists
    position, normal, albedo = pictures
    down_and_forward = normal[..., :3] * 1.0
    down_and_forward[..., 1:] *= -1.0
    return {"depth": -position[..., 2], "normal": down_and_forward, "albedo": albedo[..., :3]}
