# SPDX-License-Identifier: Apache-2.0
"""Isaac Lab 3: a renderer whose 'depth' an active stereo camera measures in another renderer's images.

    CameraCfg(..., data_types=["depth", "distance_to_image_plane", "normals", "albedo"],
              renderer_cfg=ActiveStereoRendererCfg(source=NewtonWarpRendererCfg(), camera="D435"))

'distance_to_image_plane' stays the truth.
"""

from __future__ import annotations

from dataclasses import MISSING
from typing import Any

import numpy as np
import torch
from isaaclab.renderers import BaseRenderer, RendererCfg
from isaaclab.utils import configclass

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.integrations.gbuffers.pinhole import centred
from activestereo.sensor.gbuffer.stereo import GBufferStereo

_NEEDS = ("depth", "distance_to_image_plane", "normals", "albedo")
_OWN = ("update_camera", "read_output")


def _passed_on(name: str) -> Any:
    return lambda self, *given, **named: getattr(self.source, name)(*given, **named)


_methods = [name for name in dir(BaseRenderer) if callable(getattr(BaseRenderer, name)) and not name.startswith("_")]
# All else that an Isaac Lab's version has its renderers do, the other renderer does.
_Forwarding: Any = type("_Forwarding", (BaseRenderer,), {n: _passed_on(n) for n in _methods if n not in _OWN})


class ActiveStereoRenderer(_Forwarding):
    """source: the renderer that sees, from where left infrared cameras are, principal points in the middle."""

    def __init__(self, cfg: ActiveStereoRendererCfg) -> None:
        self.cfg, self.source = cfg, cfg.source.class_type(cfg.source)
        self._focal_px = 0.0
        self._sensors: dict[tuple[int, ...], GBufferStereo] = {}
        self._turns: dict[int, Any] = {}

    def update_camera(self, render_data: Any, positions: Any, orientations: Any, intrinsics: Any) -> None:
        self.source.update_camera(render_data, positions, orientations, intrinsics)
        self._turns[id(render_data)] = _tensor(orientations)
        self._focal_px = float(_tensor(intrinsics)[0, 0, 0])

    def read_output(self, render_data: Any, camera_data: Any) -> None:
        """ValueError where the camera lacks one of the data types above."""
        self.source.read_output(render_data, camera_data)
        missing = [name for name in _NEEDS if name not in camera_data.output]
        if missing:
            raise ValueError(f"an active stereo camera's data_types lack {missing}, it needs {list(_NEEDS)}")
        depth, planar, normal, albedo = (_tensor(camera_data.output[name]) for name in _NEEDS)
        sensor = self._sensor(tuple(planar.shape[:3]))
        seen = _in_camera(_tensor(self._turns[id(render_data)]), normal)
        found = sensor(depth=planar[..., 0], normal=seen, albedo=albedo, outputs=("depth",))["depth"]
        depth.copy_(depth.new_tensor(found)[..., None])

    def _sensor(self, shape: tuple[int, ...]) -> GBufferStereo:
        if shape not in self._sensors:
            fov_deg = 2.0 * float(np.rad2deg(np.arctan(0.5 * shape[2] / self._focal_px)))
            config = StereoDepthSensorConfig(self.cfg.camera).resized(shape[2], shape[1], fov_deg)
            self._sensors[shape] = GBufferStereo(centred(config), environments=shape[0])
            self._sensors[shape].restart(self.cfg.seed)
        return self._sensors[shape]


def _tensor(values: Any) -> Any:
    return getattr(values, "torch", values)  # a ProxyArray, or a tensor


def _in_camera(turns: Any, normal: Any) -> Any:
    """Normals of the world in the axes of cameras whose quaternions x, y, z, w are of x forward, y left, z up."""
    axis, w = -turns[:, None, None, :3].expand_as(normal), turns[:, None, None, 3:]
    twice = 2.0 * axis.cross(normal, dim=-1)
    forward, left, up = (normal + w * twice + axis.cross(twice, dim=-1)).unbind(-1)
    return torch.stack((-left, -up, forward), dim=-1)


@configclass
class ActiveStereoRendererCfg(RendererCfg):
    """source: the configuration of the renderer that sees. camera: a preset's name or a camera's .toml file."""

    class_type: type = ActiveStereoRenderer
    source: RendererCfg = MISSING
    camera: str = "D435"
    seed: int = 0
