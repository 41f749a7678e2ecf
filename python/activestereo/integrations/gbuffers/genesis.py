# SPDX-License-Identifier: Apache-2.0
"""Genesis' cameras: depth and segmentation."""

from __future__ import annotations

from typing import Any


def genesis_gbuffers(camera: Any) -> dict[str, Any]:
    """camera: of scene.add_camera(fov=vertical_fov_deg(sensor)). The sensor's materials are by number of the
    segmentation; 0 is nothing. Normals are found from depth: Genesis has them in 8 bits."""
    _, depth, material, _ = camera.render(rgb=False, depth=True, segmentation=True)
    return {"depth": depth * (material > 0), "material": material}
