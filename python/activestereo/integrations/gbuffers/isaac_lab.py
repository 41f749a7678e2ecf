# SPDX-License-Identifier: Apache-2.0
"""A renderer for Isaac Lab 3 that simulates an active stereo camera's 'depth' on the images of another renderer.

    CameraCfg(..., data_types=["depth", "distance_to_image_plane", "normals", "albedo"],
              renderer_cfg=ActiveStereoRendererCfg(source=NewtonWarpRendererCfg(), camera="D435"))

'distance_to_image_plane' keeps the true depth.
"""

from __future__ import annotations

from dataclasses import MISSING
from typing import Any

import numpy as np
import torch
from isaaclab.renderers import BaseRenderer, RendererCfg
from isaaclab.utils.configclass import configclass

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.integrations.gbuffers.pinhole import fitted
from activestereo.sensor.gbuffer.stereo import GBufferStereo

NEEDS = ("depth", "distance_to_image_plane", "normals", "albedo")
_OWN = ("update_camera", "read_output")


def _forwarded(name: str) -> Any:
    if isinstance(getattr(BaseRenderer, name), property):
        return property(lambda self: getattr(self.source, name))
    return lambda self, *given, **named: getattr(self.source, name)(*given, **named)


_names = [name for name in dir(BaseRenderer) if not name.startswith("_") and name not in _OWN]
# The source renderer answers all other calls, whichever this version of Isaac Lab makes.
_Forwarding: Any = type("_Forwarding", (BaseRenderer,), {name: _forwarded(name) for name in _names})


class ActiveStereoRenderer(_Forwarding):
    """Measures depth on the images of another renderer, `source`, and replaces its 'depth'. Its cameras have the left
    infrared cameras' poses, with principal points in the middle of the image."""

    def __init__(self, cfg: ActiveStereoRendererCfg) -> None:
        self.cfg, self.source = cfg, cfg.source.class_type(cfg.source)
        self._sensors: dict[tuple[int, int, int, float], GBufferStereo] = {}
        self._cameras: dict[int, tuple[Any, Any]] = {}  # orientations and K of all cameras, by render data

    def update_camera(self, render_data: Any, positions: Any, orientations: Any, intrinsics: Any) -> None:
        self.source.update_camera(render_data, positions, orientations, intrinsics)
        self._cameras[id(render_data)] = _tensor(orientations), _tensor(intrinsics)

    def read_output(self, render_data: Any, camera_data: Any) -> None:
        """Lets the source fill camera_data.output, then overwrites its 'depth' in place with the stereo camera's depth.
        Raises ValueError if camera_data.output lacks one of the data types NEEDS."""
        self.source.read_output(render_data, camera_data)
        missing = [name for name in NEEDS if name not in camera_data.output]
        if missing:
            raise ValueError(f"an active stereo camera's data_types lack {missing}, it needs {list(NEEDS)}")
        depth, planar, normal, albedo = (_tensor(camera_data.output[name]) for name in NEEDS)
        turns, k = self._cameras[id(render_data)]
        focal_px = float(k[0, 0, 0])  # read now: set_intrinsic_matrices() writes into the camera's own buffer
        (count, height, width, _), finer = planar.shape, self.cfg.supersampling
        key = count, height, width, focal_px
        if key not in self._sensors:
            fov_deg = 2.0 * float(np.rad2deg(np.arctan(0.5 * width / focal_px)))
            config = fitted(StereoDepthSensorConfig(self.cfg.camera), width, height, fov_deg, finer)
            self._sensors[key] = GBufferStereo(config, environments=count, supersampling=finer)
            self._sensors[key].restart(self.cfg.seed)
        # Turns normals from the world's axes to the cameras' (x forward, y left, z up) by their quaternions x, y, z, w.
        axis, w = -turns[:, None, None, :3].expand_as(normal), turns[:, None, None, 3:]
        twice = 2.0 * axis.cross(normal, dim=-1)
        forward, left, up = (normal + w * twice + axis.cross(twice, dim=-1)).unbind(-1)
        seen = torch.stack((-left, -up, forward), dim=-1)
        found = self._sensors[key](depth=planar[..., 0], normal=seen, albedo=albedo, outputs=("depth",))["depth"]
        depth.copy_(depth.new_tensor(found.repeat(finer, axis=1).repeat(finer, axis=2))[..., None])


def _tensor(values: Any) -> Any:
    return getattr(values, "torch", values)  # a ProxyArray, or a tensor


@configclass
class ActiveStereoRendererCfg(RendererCfg):
    """Configures an ActiveStereoRenderer. source: the configuration of the renderer whose images it measures. camera: a
    preset's name or a camera's .toml file. supersampling: factor of the images' rows and columns over the sensor's,
    whose depth is repeated to the images' size."""

    class_type: type = ActiveStereoRenderer
    source: RendererCfg = MISSING
    camera: str = "D435"
    seed: int = 0
    supersampling: int = 1

    def __post_init__(self) -> None:
        getattr(super(), "__post_init__", lambda: None)()
        # Isaac Lab starts Kit, and tells it to render, by this name. "auto_rtx" would be replaced, this class with it.
        kind = getattr(self.source, "renderer_type", "default")
        self.renderer_type = "isaac_rtx" if kind == "auto_rtx" else kind

    def provides_temporal_camera_data(self, data_type: str) -> bool:
        return self.source.provides_temporal_camera_data(data_type)
