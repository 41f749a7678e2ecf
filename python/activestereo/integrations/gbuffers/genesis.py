# SPDX-License-Identifier: Apache-2.0
"""Reads depth and segmentation from Genesis' cameras."""

from __future__ import annotations

from typing import Any


def genesis_gbuffers(camera: Any) -> dict[str, Any]:
    """Renders GBufferStereo's arguments with `camera`, made by scene.add_camera(fov=vertical_fov_deg(sensor)). The
    segmentation's numbers are those of the sensor's materials; 0 is nothing. Normals are left to GBufferStereo, because
    Genesis has them in 8 bits."""
    _, depth, material, _ = camera.render(rgb=False, depth=True, segmentation=True)
    return {"depth": depth * (material > 0), "material": material}
