# SPDX-License-Identifier: Apache-2.0
"""ManiSkill's StereoDepthCamera: observations as its cameras give them, of an active stereo sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from mani_skill.sensors.camera import Camera, CameraConfig
from numpy.typing import NDArray

import kuafu
from activestereo.late_sensor_batch import LateStereoDepthSensorBatch
from activestereo.mani_skill.config import StereoDepthCameraConfig
from activestereo.mani_skill.world import ManiSkillWorld
from activestereo.sensor_batch import StereoDepthSensorBatch

_MM = 1000.0
_FARTHEST_MM = 32767.0


class _CameraMounts:
    """Where a ManiSkill camera is in each environment."""

    def __init__(self, camera: Any, scene: kuafu.Scene) -> None:
        self._camera, self.scene = camera, scene

    @property
    def poses(self) -> torch.Tensor:
        """[E, 7], x forward, y left, z up."""
        return self._camera.get_global_pose().raw_pose


@dataclass(frozen=True)
class _Begun:
    """A late camera's picture: since which reset(), whether it is one of RGB, and from where."""

    reset: torch.Tensor
    has_rgb: bool
    params: dict[str, torch.Tensor]


class StereoDepthCamera(Camera):
    """One sensor in each environment. `rgb`, `depth`, `position` and `segmentation` have ManiSkill's shapes, types and
    units; depth 0 = no measurement, and position is what depth says. ManiSkill's normal and albedo are not there.

    With config.late an observation has the picture that the one before it began, which is rendered while ManiSkill
    simulates and the one before is matched. The first observation after reset(), of some environments too, has a
    picture of the present instead, as of a camera that has long stood there; so the one after it shows the same."""

    def __init__(self, camera_config: CameraConfig, scene: Any, articulation: Any = None) -> None:
        if not isinstance(camera_config, StereoDepthCameraConfig):
            camera_config = StereoDepthCameraConfig.fromCameraConfig(camera_config)
        super().__init__(camera_config, scene, articulation)  # a SAPIEN camera, for pose and parameters
        self._scene = scene
        self._world: ManiSkillWorld | None = None
        self._sensors: StereoDepthSensorBatch | None = None
        self._begun: _Begun | None = None

    @property
    def sensors(self) -> StereoDepthSensorBatch:
        """The sensors behind it, which have more: the infrared pair, true depth. RuntimeError before the first
        capture()."""
        if self._sensors is None:
            raise RuntimeError("no picture yet: call capture() first")
        return self._sensors

    def capture(self) -> None:
        """Brings the sensors' scene to the present state. Images are rendered when get_obs() asks for them."""
        if self._world is None:
            self._world = ManiSkillWorld.of(self._scene, self.config.device)
            config = self.config.native(self.camera.get_intrinsic_matrix()[0].cpu().numpy().astype(np.float64))
            kind = LateStereoDepthSensorBatch if self.config.late else StereoDepthSensorBatch
            self._sensors = kind(config, _CameraMounts(self.camera, self._world.scene))
            if isinstance(self._sensors, LateStereoDepthSensorBatch):
                self._world.late.add(self._sensors)
        self._world.update()

    def get_obs(
        self,
        rgb: bool = True,
        depth: bool = True,
        position: bool = True,
        segmentation: bool = True,
        normal: bool = False,
        albedo: bool = False,
        apply_texture_transforms: bool = True,
    ) -> dict[str, torch.Tensor]:
        """{modality: [E, height, width, channels]} on the simulation's device. ValueError for normal and albedo."""
        if normal or albedo:
            raise ValueError("a stereo depth camera has rgb, depth, position and segmentation, not normal or albedo")
        sensors, out = self.sensors, {}
        self._take_picture(rgb or segmentation)
        if rgb:
            out["rgb"] = np.ascontiguousarray(sensors.get_rgba8()[..., :3])
        if depth or position:
            sensors.compute_depth()
            found = np.rint(np.minimum(sensors.get_depth() * np.float32(_MM), _FARTHEST_MM))
        if depth:
            out["depth"] = found.astype(np.int16)[..., None]
        if position:
            out["position"] = self._positions(found)
        if segmentation:
            out["segmentation"] = self._segmentation()
        return {name: torch.from_numpy(image).to(self._scene.device) for name, image in out.items()}

    def get_params(self) -> dict[str, torch.Tensor]:
        """ManiSkill's, of a late camera those of the next observation's picture: ManiSkill asks for an observation's
        parameters before its picture."""
        begun = self._begun
        return begun.params if begun is not None and self._serves(begun) else super().get_params()

    def _serves(self, begun: _Begun) -> bool:
        """Whether the picture that was begun is the next observation's: not after a reset(), nor where it failed."""
        sensors = self._sensors
        return begun.reset is self._reset and isinstance(sensors, LateStereoDepthSensorBatch) and sensors.has_next

    @property
    def _reset(self) -> torch.Tensor:
        """Another object after each reset()."""
        return self._scene._reset_mask

    def _take_picture(self, with_rgb: bool) -> None:
        assert self._world is not None
        self._world.late.wait()  # another camera's picture, too: ours turns our projectors on
        sensors, begun = self.sensors, self._begun
        if not isinstance(sensors, LateStereoDepthSensorBatch):
            sensors.take_picture(infrared_only=not with_rgb)
            return
        serves = begun is not None and self._serves(begun) and (begun.has_rgb or not with_rgb)
        self._begun = None
        sensors.take_picture(infrared_only=not with_rgb)
        if not serves:
            sensors.take_picture(infrared_only=not with_rgb)
        self._begun = _Begun(self._reset, with_rgb, super().get_params())

    def _positions(self, depth_mm: NDArray[np.float32]) -> NDArray[np.int16]:
        """int16 [E, height, width, 3] millimetres in the camera's OpenGL axes: x right, y up, z backward."""
        k = self.sensors.get_config().rgb_intrinsic
        v, u = np.indices(depth_mm.shape[1:], np.float32)
        x, y = (u - k[0, 2]) / k[0, 0] * depth_mm, -(v - k[1, 2]) / k[1, 1] * depth_mm
        out = np.stack([x, y, -depth_mm], axis=-1)
        return np.rint(np.clip(out, -_FARTHEST_MM, _FARTHEST_MM)).astype(np.int16)

    def _segmentation(self) -> NDArray[np.int16]:
        """int16 [E, height, width, 1]: ManiSkill's per_scene_id, 0 = nothing there."""
        assert self._world is not None
        return self._world.bodies.semantic_ids(self.sensors.get_instance_ids()).astype(np.int16)[..., None]
