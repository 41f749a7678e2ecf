# SPDX-License-Identifier: Apache-2.0
"""Renders GBufferStereo's input images with Newton's SensorCamera: depth, normals and albedo of all worlds, on the
model's device."""

from __future__ import annotations

from typing import Any

import newton
import warp as wp
from newton.sensors import SensorCamera

from activestereo.integrations.gbuffers.warp_arrays import as_array
from activestereo.sensor.gbuffer.stereo import GBufferStereo


@wp.kernel
def _to_camera(camera_to_world: wp.array(dtype=wp.transformf), normal: wp.array3d(dtype=wp.vec3f)):  # type: ignore
    view, v, u = wp.tid()
    n = wp.quat_rotate_inv(wp.transform_get_rotation(camera_to_world[view]), normal[view, v, u])
    normal[view, v, u] = wp.vec3f(n[0], -n[1], -n[2])


class NewtonGBuffers:
    """Renders depth, normals and albedo of a model's worlds, as arguments of a GBufferStereo with as many
    environments."""

    def __init__(self, model: newton.Model, sensor: GBufferStereo) -> None:
        (count, height, width), k = sensor.input_shape, sensor.k
        f, c = k.diagonal()[:2], k[:2, 2] + 0.5  # Newton's pixel centres are at halves
        self._rays = SensorCamera.compute_camera_rays_pinhole_opencv(width, height, *f, *c, device=model.device)
        linear = SensorCamera.RenderConfig(enable_textures=True, output_color_space=newton.utils.ColorSpace.LINEAR)
        self._model, self._camera = model, SensorCamera(model, default_render_config=linear)
        self._depth = self._camera.allocate_image_depth_forward(count, width, height)
        self._normal = self._camera.allocate_image_normal(count, width, height)
        self._albedo = wp.zeros((count, height, width, 4), wp.uint8, device=model.device)
        self._packed = wp.array(ptr=self._albedo.ptr, dtype=wp.uint32, shape=self._depth.shape, device=model.device)

    def __call__(self, state: newton.State, camera_to_world: wp.array) -> dict[str, Any]:
        """Renders a state and returns depth, normal and albedo. camera_to_world: transformf [E], of cameras that look
        along -z with y up, as all of Newton's do."""
        self._model.bvh_refit_shapes(state)
        images = {"forward_depth_image": self._depth, "normal_image": self._normal, "albedo_image": self._packed}
        self._camera.update(state, camera_to_world, self._rays, **images)
        wp.launch(_to_camera, self._depth.shape, [camera_to_world, self._normal], device=self._model.device)
        return {name: as_array(getattr(self, f"_{name}")) for name in ("depth", "normal", "albedo")}
