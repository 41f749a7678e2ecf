# SPDX-License-Identifier: Apache-2.0
"""Replaces the depth cameras of ManiSkill 3 environments by active stereo sensors. Needs the package mani_skill.

    import activestereo.integrations.mani_skill
    env = gymnasium.make("PickCube-v1", obs_mode="rgb+depth", sensor_configs={"use_stereo_depth": True})

ManiSkill has no registry of sensors: its environments make a `StereoDepthCamera` for each `StereoDepthCameraConfig`.
The import replaces ManiSkill's classes of these names; the replaced classes need CUDA and SAPIEN 2.
"""

from __future__ import annotations

import warnings
import weakref
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import mani_skill.envs.sapien_env
import mani_skill.sensors.depth_camera
import numpy as np
import torch
from mani_skill.sensors.camera import Camera, CameraConfig
from mani_skill.sensors.depth_camera import StereoDepthCameraConfig as ManiSkillConfig
from numpy.typing import NDArray

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.computed_once import computed_once
from activestereo.integrations.sapien.scene import Looks, is_visible, light_record, own_matrix, parts, render_system
from activestereo.scene_io.bodies import Bodies, Shape
from activestereo.sensor.batch import StereoDepthSensorBatch
from activestereo.sensor.cuda_memory import CudaError, cuda_tensor, wait_for

_AMBIENT = (0.3, 0.3, 0.3)


class ManiSkillWorld:
    """Mirrors the actors and links of a ManiSkillScene in `scene`, a kuafu.Scene with an environment for each parallel
    scene.

    Poses come from ManiSkill's own batched structs, so a simulation on a GPU gathers them there and the host reads them
    once. Hidden objects are left out. The ambient light is the first scene's. device: 'auto', 'cpu' or an index.
    """

    _known: weakref.WeakValueDictionary[int, ManiSkillWorld] = weakref.WeakValueDictionary()

    def __init__(self, scene: Any, device: str | int = "auto") -> None:
        if scene.parallel_in_single_scene:
            raise ValueError("parallel_in_single_scene: environments side by side in one scene see each other")
        self.mani_skill_scene = scene
        self.scene = kuafu.Scene(kuafu.Device(device))
        self.count = len(scene.sub_scenes)
        self.bodies = Bodies(self.scene, self.count)
        self._looks = Looks(self.scene)
        # For each body, in order: ManiSkill's struct, and the environments of its objects.
        self._places: dict[str, tuple[Any, list[int]]] = {}
        self.scene.set_environment(_AMBIENT)
        for environment, sub_scene in enumerate(scene.sub_scenes):
            system = render_system(sub_scene)
            if system is None:
                continue
            if environment == 0:
                self.scene.set_environment(tuple(system.ambient_light))
            for light in system.lights:
                record = light_record(light, environment)
                if record is not None:
                    self.scene.add_light(record)
        self.update()
        ManiSkillWorld._known[id(scene)] = self

    @classmethod
    def for_scene(cls, scene: Any, device: str | int = "auto") -> ManiSkillWorld:
        """Returns the world that mirrors a ManiSkill scene; makes one at the first call."""
        known = cls._known.get(id(scene))
        return cls(scene, device) if known is None or known.mani_skill_scene is not scene else known

    def update(self) -> int:
        """Moves the scene to ManiSkill's present state. Returns the number of shapes that moved. Raises BodyPoseError,
        with environment and body, if a state has turned NaN; the other environments have moved."""
        structs = list(self.mani_skill_scene.actors.items())  # by unique names
        for name, articulation in self.mani_skill_scene.articulations.items():
            structs += [(f"{name}: {link.name}", link) for link in articulation.links]
        seen = {id(struct): (name, struct) for name, struct in structs if not getattr(struct, "hidden", False)}
        for name in [name for name, (struct, _) in self._places.items() if id(struct) not in seen]:
            self.bodies.remove(name)
            del self._places[name]
        known = {id(struct) for struct, _ in self._places.values()}
        for number in [number for number in seen if number not in known]:
            name, struct = seen[number]
            # A struct's objects share their geometry; each environment has its own materials.
            entities = [getattr(thing, "entity", thing) for thing in struct._objs]
            environments = struct._scene_idxs.tolist()
            own: dict[int, list[Shape]] = {}
            if is_visible(entities[0]):
                first = self._looks.shapes(entities[0], name)
                for environment, entity in zip(environments, entities, strict=True):
                    own[environment] = [  # the meshes are those of the first environment
                        replace(shape, materials=[self._looks.material(part.material)])
                        for shape, (part, _) in zip(first, parts(entity), strict=True)
                    ]
            self.bodies.add(name, own, semantic_id=entities[0].per_scene_id)
            self._places[name] = (struct, environments)
        # Poses [E, bodies, 7] on the simulation's device.
        device = self.mani_skill_scene.device
        out = torch.zeros((self.count, len(self._places), 7), device=device)
        out[..., 3] = 1.0
        for body, (struct, environments) in enumerate(self._places.values()):
            out[environments, body] = struct.pose.raw_pose.to(out)
        return self.bodies.move(out)


# Below this width the infrared images have twice the depth's size and the matcher small windows, because its usual
# windows would blur objects of ten pixels.
_SMALL_PX = 256
# Largest disparity that the matcher looks for, as a share of the image's width.
_MOST_DISPARITY = 0.5


class StereoDepthCameraConfig(ManiSkillConfig):
    """Configures a StereoDepthCamera, with these fields beyond ManiSkill's CameraConfig.

    model: a preset's name. samples_per_pixel: of rendered images. min_depth, max_depth: metres. sensor: a
    StereoDepthSensorConfig that replaces these four; the RGB image keeps the CameraConfig's size and intrinsics.
    device: 'auto', 'cpu' or an index. on_cuda: observations stay on the rendering GPU; None: if the simulation is on
    CUDA."""

    def __init__(
        self, *args: Any, min_depth: float = 0.1, max_depth: float = 10.0, model: str = "sapien-D435",
        samples_per_pixel: int = 4, device: str | int = "auto", sensor: StereoDepthSensorConfig | None = None,
        on_cuda: bool | None = None, **kwargs: Any,
    ) -> None:  # fmt: skip
        super().__init__(*args, min_depth=min_depth, **kwargs)
        self.max_depth = max_depth
        self.model = model
        self.samples_per_pixel = samples_per_pixel
        self.device = device
        self.sensor = sensor
        self.on_cuda = on_cuda

    @classmethod
    def fromCameraConfig(cls, cfg: CameraConfig) -> StereoDepthCameraConfig:
        """Returns a stereo configuration with the fields of a CameraConfig; the method's name is ManiSkill's."""
        return cls(**cfg.__dict__)

    def native(self, intrinsic: NDArray[np.float64]) -> StereoDepthSensorConfig:
        """Returns the configuration for activestereo's sensor. intrinsic: 3x3 in SAPIEN's convention, the middle of the
        first pixel at (0.5, 0.5)."""
        config = deepcopy(self.sensor) or self._preset_config(intrinsic)
        config.rgb_resolution = (self.width, self.height)
        config.rgb_intrinsic = own_matrix(intrinsic)
        return config

    def _preset_config(self, intrinsic: NDArray[np.float64]) -> StereoDepthSensorConfig:
        config = StereoDepthSensorConfig(self.model)
        scale = 2 if self.width < _SMALL_PX else 1
        focal_px, lit = config.ir_intrinsic[0, 0], _tangents(config)
        config.ir_resolution = (scale * self.width, scale * self.height)
        config.ir_intrinsic = own_matrix(np.diag([scale, scale, 1.0]) @ intrinsic)
        # A field of view wider than the preset's gets a pattern that is wider by the same factor.
        config.light_pattern_scale = max(1.0, float((_tangents(config) / lit).max()))
        config.min_depth_m, config.max_depth_m = self.min_depth, self.max_depth
        config.samples_per_pixel = self.samples_per_pixel
        nearest = int(np.ceil(config.focal_baseline_px_m / self.min_depth)) + 1
        config.max_disparity = max(32, min(nearest, int(_MOST_DISPARITY * config.ir_resolution[0])))
        if self.width < _SMALL_PX:
            config.block_width = config.block_height = 3
            config.p1, config.p2 = 4, 16
            # Scale the pattern so that the projector's dots are larger than a pixel.
            dots = 0.5 * focal_px / config.ir_intrinsic[0, 0]
            config.light_pattern_scale = max(config.light_pattern_scale, dots)
        return config


def _tangents(config: StereoDepthSensorConfig) -> NDArray[np.float64]:
    """Returns the tangents of half the infrared cameras' horizontal and vertical fields of view."""
    return 0.5 * np.array(config.ir_resolution) / np.diag(config.ir_intrinsic)[:2]


_MM = 1000.0
_FARTHEST_MM = 32767.0


@dataclass
class Observations:
    """Makes observations from a batch's last picture and depth, on the rendering GPU (on_cuda) or on the host."""

    sensors: StereoDepthSensorBatch
    on_cuda: bool

    def rgb(self) -> torch.Tensor:
        """Returns the colour images, uint8 [E, height, width, 3]."""
        return self._image("rgba8")[..., :3].contiguous()

    def depth_mm(self) -> torch.Tensor:
        """Returns depth in whole millimetres, float32 [E, height, width]."""
        return (self._image("depth") * _MM).clamp(max=_FARTHEST_MM).round()

    def positions(self, depth_mm: torch.Tensor) -> torch.Tensor:
        """Returns the points of depth_mm, int16 [E, height, width, 3] millimetres in the camera's OpenGL axes: x right,
        y up, z backward."""
        points = self._rays() * depth_mm[..., None]
        return points.clamp(-_FARTHEST_MM, _FARTHEST_MM).round().to(torch.int16)

    def segmentation(self, semantic_ids: NDArray[np.integer]) -> torch.Tensor:
        """Returns ManiSkill's per_scene_id of the object at each pixel, int16 [E, height, width, 1], 0 = nothing there.
        semantic_ids: this id for each instance of the mirrored scene; the last entry is for no instance."""
        ids = torch.from_numpy(semantic_ids.astype(np.int16))
        instances = self._image("instance_ids").view(torch.int32)  # values above 2^31 are negative
        known = torch.where(instances < 0, len(ids) - 1, instances.clamp(max=len(ids) - 1))
        return ids.to(instances.device)[known][..., None]

    def _image(self, name: str) -> torch.Tensor:
        """Returns the sensors' get_<name>() on the device of the observations."""
        if self.on_cuda:
            return cuda_tensor(self.sensors.get_cuda(name))
        return torch.from_numpy(getattr(self.sensors, f"get_{name}")())

    @computed_once
    def _rays(self) -> torch.Tensor:
        """Returns ray directions through the pixels, float32 [height, width, 3], in the camera's OpenGL axes, with z =
        -1."""
        rays = np.moveaxis(self.sensors.rgb_rays(), 0, -1) * (1.0, -1.0, -1.0)
        return torch.from_numpy(np.ascontiguousarray(rays, np.float32)).to(self._image("depth").device)


@dataclass
class _CameraMounts:
    """Reads the poses of a ManiSkill camera in all environments, as a batch's mounts."""

    camera: Any
    scene: kuafu.Scene

    @property
    def poses(self) -> torch.Tensor:
        """Returns the poses [E, 7], position and quaternion, axes x forward, y left, z up."""
        return self.camera.get_global_pose().raw_pose


class StereoDepthCamera(Camera):
    """An active stereo sensor in each environment. `rgb`, `depth`, `position` and `segmentation` have ManiSkill's
    shapes, types and units; depth 0 = no measurement; position is computed from the measured depth. ManiSkill's normal
    and albedo are absent.

    With config.on_cuda observations stay on the sensors' GPU, and no image passes through the host. Raises CudaError
    without CUDA on this GPU. If on_cuda is None and the simulation is on CUDA, a UserWarning replaces the error and
    images pass through the host."""

    def __init__(self, camera_config: CameraConfig, scene: Any, articulation: Any = None) -> None:
        if not isinstance(camera_config, StereoDepthCameraConfig):
            camera_config = StereoDepthCameraConfig.fromCameraConfig(camera_config)
        super().__init__(camera_config, scene, articulation)  # a SAPIEN camera, for pose and parameters
        self._scene = scene
        self._world: ManiSkillWorld | None = None
        self._observations: Observations | None = None

    @property
    def sensors(self) -> StereoDepthSensorBatch:
        """Returns the batch of sensors behind the camera, for further results: the infrared pair, true depth. Raises
        RuntimeError before the first capture()."""
        if self._observations is None:
            raise RuntimeError("no picture yet: call capture() first")
        return self._observations.sensors

    def capture(self) -> None:
        """Updates kuafu's copy of the scene to ManiSkill's present state. get_obs() renders the images."""
        if self._world is None:
            self._world = ManiSkillWorld.for_scene(self._scene, self.config.device)
            self._observations = self._make_observations(self._world)
        self._world.update()

    def get_obs(
        self, rgb: bool = True, depth: bool = True, position: bool = True, segmentation: bool = True,
        normal: bool = False, albedo: bool = False, apply_texture_transforms: bool = True,
    ) -> dict[str, torch.Tensor]:  # fmt: skip
        """Returns {modality: [E, height, width, channels]} on the simulation's device. Raises ValueError for normal and
        albedo."""
        if normal or albedo:
            raise ValueError("a stereo depth camera has rgb, depth, position and segmentation, not normal or albedo")
        sensors, seen, out = self.sensors, self._observations, {}
        assert self._world is not None and seen is not None
        sensors.take_picture(infrared_only=not (rgb or segmentation))
        if rgb:
            out["rgb"] = seen.rgb()
        if depth or position:
            sensors.compute_depth()
            depth_mm = seen.depth_mm()
        if depth:
            out["depth"] = depth_mm.to(torch.int16)[..., None]
        if position:
            out["position"] = seen.positions(depth_mm)
        if segmentation:
            out["segmentation"] = seen.segmentation(self._world.bodies.semantic_id_table)
        return {name: wait_for(image).to(self._scene.device) for name, image in out.items()}

    def _make_observations(self, world: ManiSkillWorld) -> Observations:
        config = self.config.native(self.camera.get_intrinsic_matrix()[0].cpu().numpy().astype(np.float64))
        mounts = _CameraMounts(self.camera, world.scene)
        is_there = self._scene.device.type == "cuda"
        on_cuda = is_there if self.config.on_cuda is None else self.config.on_cuda
        try:
            return Observations(StereoDepthSensorBatch(config, mounts, on_cuda=on_cuda), on_cuda)
        except CudaError as error:
            if self.config.on_cuda:
                raise
            warnings.warn(f"observations pass through the host: {error}", stacklevel=3)
            return Observations(StereoDepthSensorBatch(config, mounts), False)


mani_skill.envs.sapien_env.StereoDepthCamera = StereoDepthCamera
mani_skill.sensors.depth_camera.StereoDepthCamera = StereoDepthCamera
mani_skill.sensors.depth_camera.StereoDepthCameraConfig = StereoDepthCameraConfig
