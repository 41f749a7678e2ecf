# SPDX-License-Identifier: Apache-2.0
"""Reads depth and segmentation from Genesis' cameras."""

from __future__ import annotations

from typing import Any


def genesis_gbuffers(camera: Any) -> dict[str, Any]:
    """Renders GBufferStereo's arguments with `camera`, made by scene.add_camera(fov=vertical_fov_deg(sensor)). The
    segmentation must hold the sensor's material numbers; 0 is empty. GBufferStereo computes the normals, because
    Genesis has them in 8 bits only."""
    _, depth, material, _ = camera.render(rgb=False, depth=True, segmentation=True)
    return {"depth": depth * (material > 0), "material": material}
