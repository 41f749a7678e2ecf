# SPDX-License-Identifier: Apache-2.0
"""Renders GBufferStereo's input images with MuJoCo Warp: depth and geom numbers of all worlds, on its device."""

from __future__ import annotations

from typing import Any

import mujoco_warp as mjw
import warp as wp

from activestereo.integrations.gbuffers.warp_arrays import as_array
from activestereo.sensor.gbuffer.stereo import GBufferStereo


class MujocoWarpGBuffers:
    """Renders depth and geom numbers of all worlds, as arguments of a GBufferStereo that was made with
    geom_materials(). context: from mjw.create_render_context(), with render_depth and render_seg, for a model that
    set_camera() has prepared. camera: the camera's index in `context`."""

    def __init__(self, context: Any, sensor: GBufferStereo, camera: int = 0) -> None:
        self._context, self._camera, self._shape = context, camera, sensor.input_shape
        self._first = int(context.depth_adr.numpy()[camera])
        self._geoms = wp.zeros(sensor.input_shape, wp.vec2i, device=context.depth_data.device)

    def __call__(self, model: Any, data: Any) -> dict[str, Any]:
        """Renders the state of mujoco_warp's model and data, after a step or forward(), and returns depth and
        material."""
        mjw.refit_bvh(model, data, self._context)
        mjw.render(model, data, self._context)
        mjw.get_segmentation(self._context, self._camera, self._geoms)
        pixels = self._shape[1] * self._shape[2]
        depth = as_array(self._context.depth_data)[:, self._first : self._first + pixels].reshape(self._shape)
        return {"depth": depth, "material": as_array(self._geoms)[..., 0]}
