# SPDX-License-Identifier: Apache-2.0
"""Renders GBufferStereo's input images with mujoco.Renderer: depth, and the geoms' numbers as material numbers."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

import kuafu
from activestereo.integrations.mujoco import geom_surface
from activestereo.sensor.gbuffer.stereo import GBufferStereo


def geom_materials(model: mujoco.MjModel) -> dict[int, kuafu.Material]:
    """Returns {number of a geom: its kuafu.Material without textures} of all geoms of the model, for GBufferStereo's
    argument `materials`."""
    return {geom: kuafu.Material(**geom_surface(model, geom)) for geom in range(model.ngeom)}


def set_camera(model: mujoco.MjModel, camera: int, sensor: GBufferStereo) -> None:
    """Gives the model's camera number `camera` the sensor's resolution and matrix K. Raises ValueError for a principal
    point above or below the middle before MuJoCo 3.6, which moves the picture the other way."""
    k, (_, height, width) = sensor.k, sensor.input_shape
    if [int(part) for part in mujoco.__version__.split(".")[:2]] < [3, 6] and abs(0.5 * (height - 1) - k[1, 2]) > 0.05:
        raise ValueError(
            f"MuJoCo {mujoco.__version__} moves cy the wrong way: pip install 'mujoco>=3.6', or give the sensor "
            "centred(config) of activestereo.integrations.gbuffers.pinhole"
        )
    model.cam_resolution[camera] = model.cam_sensorsize[camera] = width, height
    model.cam_intrinsic[camera] = k[0, 0], k[1, 1], 0.5 * (width - 1) - k[0, 2], 0.5 * (height - 1) - k[1, 2]


class MujocoGBuffers:
    """Renders one environment's depth and geom numbers with mujoco.Renderer, as arguments of a GBufferStereo that was
    made with geom_materials(). camera: number of the model's camera that set_camera() has prepared."""

    def __init__(self, model: mujoco.MjModel, sensor: GBufferStereo, camera: int = 0) -> None:
        self._camera, (_, height, width) = camera, sensor.input_shape
        self._renderer = mujoco.Renderer(model, height, width)

    def __call__(self, data: mujoco.MjData) -> dict[str, Any]:
        renderer = self._renderer
        renderer.update_scene(data, self._camera)
        renderer.enable_segmentation_rendering()
        numbers, kinds = np.moveaxis(renderer.render(), -1, 0)
        renderer.enable_depth_rendering()
        is_geom = kinds == mujoco.mjtObj.mjOBJ_GEOM
        return {"depth": np.where(is_geom, renderer.render(), 0.0), "material": np.where(is_geom, numbers, -1)}
