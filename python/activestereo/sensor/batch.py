# SPDX-License-Identifier: Apache-2.0
"""StereoDepthSensorBatch: one kind of depth sensor in many environments, with one render and one match for all.

    batch = StereoDepthSensorBatch(config, Mounts(scene, poses))  # poses [E, 7], [E, S, 7] or the same with 4x4
    batch.take_picture(infrared_only=True)
    batch.compute_depth()
    depth_m = torch.from_numpy(batch.get_depth())  # [E, height, width] or [E, S, height, width], no copy

Environments are kuafu's: an instance or a light that names environment e is seen by the sensors of environment e alone,
one that names none by all (activestereo.scene_io.bodies puts bodies into them).
"""

from __future__ import annotations

import weakref
from copy import deepcopy
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
import simsense
from activestereo.camera.auto_exposure import encoded_rgb
from activestereo.camera.config_limits import FRAME, RENDER_SEED
from activestereo.camera.matching import Taken, make_engine, renderer_parameters
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.limits import POWER
from activestereo.common.pose import Pose, PoseLike, as_matrix, camera_to_world
from activestereo.common.pose_arrays import host_array, pose_fault, pose_matrices
from activestereo.model import SensorModel, read_model
from activestereo.sensor.batch_exposure import BatchExposure
from activestereo.sensor.batch_rig import BatchRig
from activestereo.sensor.cuda_maps import MAPS, PICTURES, CudaMaps, check_cuda_name
from activestereo.sensor.cuda_memory import CudaArray
from activestereo.sensor.inputs import render_settings, shutter
from activestereo.sensor.ir_link import IrLink
from activestereo.sensor.lazy_maps import LazyMaps
from activestereo.sensor.mounts import HasPoses, own_numbers, raise_broken
from activestereo.sensor.picture_memory import RGB_OUTPUTS, PictureMemory
from activestereo.sensor.pipelined_pictures import Picture, UnderWay
from activestereo.sensor.result_memory import Kind, PartOfResults
from activestereo.sensor.results import require_depth, require_picture, require_rgb


class StereoDepthSensorBatch:
    """E environments with S depth sensors in each, all of one configuration.

    config: a StereoDepthSensorConfig; it is copied. mounts: Mounts, or another object with a scene and poses (body
    axes). pose: the RGB camera's, relative to its mount. Sensors of one environment see one another's projectors, as
    real ones do. The frames of the batch differ in noise; under one seed they are the same again. Exposure is 'fixed'
    or 'settled', for each sensor by what it sees; gain then counts as exposure. One thread at a time.

    model: a SensorModel or the path of a model.json, whose effects all sensors have; its materials and medium are those
    of the whole scene until close(). ValueError for effects that act outside of the engines, which StereoDepthSensor
    has, and for a model that does not fit the scene; then nothing has been changed.

    on_cuda: pictures and maps lie where CUDA sees them, for get_cuda(); compute_depth() then computes nothing for the
    host until get_depth() or another asks. CudaError where there is no CUDA, or none on this GPU.

    environments: those of the mounts' environments that this batch is of, all by default. Its E is their number, they
    keep their numbers in the scene, and all has the bits that it has in a batch of all (SplitStereoDepthSensorBatch).

    results: where its maps lie, if not in arrays of its own.

    pipelined: pictures are rendered while those before them are matched and read. take_picture() begins them, results
    are of those before, with the same bits, and wait() comes before the scene changes: kuafu.Error, that work is under
    way, where it does not.
    """

    def __init__(
        self,
        config: StereoDepthSensorConfig,
        mounts: HasPoses,
        pose: PoseLike | None = None,
        model: SensorModel | str | PathLike[str] | None = None,
        on_cuda: bool = False,
        environments: range | None = None,
        results: PartOfResults | None = None,
        pipelined: bool = False,
    ) -> None:
        self._config = deepcopy(config)
        self._config.check()
        self._mounts, self._scene = mounts, mounts.scene
        self._exposure = BatchExposure(self._config)
        self._pose = np.eye(4) if pose is None else as_matrix(pose)
        places = pose_matrices(host_array(mounts.poses), "poses of sensors")
        self._mounts_shape = places.shape[:-2]
        if len(self._mounts_shape) not in (1, 2) or not places.size:
            raise ValueError(f"poses of sensors are [E] or [E, S] times 7 or 4x4, given {list(places.shape)}")
        self._numbers = own_numbers(environments, self._mounts_shape[0])
        self._shape = (len(self._numbers), *self._mounts_shape[1:])
        self._count = int(np.prod(self._shape))
        sensors = self._count // self._shape[0]
        self._own = slice(self._numbers.start * sensors, self._numbers.stop * sensors)  # of all sensors
        self._places = np.broadcast_to(np.eye(4), (int(np.prod(self._mounts_shape)), 4, 4)).copy()
        self._environments = np.repeat(self._numbers, sensors).tolist()
        device = self._scene.device
        self._on_cuda, self._pipelined = on_cuda, pipelined
        self._renderer = kuafu.Renderer(device, **renderer_parameters(self._config))
        self._engine = make_engine(self._config, simsense.Device(device.info.device_uuid), self._count)
        self._present = self._new_picture()
        self._next = self._new_picture() if pipelined else self._present
        self._under_way = UnderWay()
        model = read_model(Path(model)) if isinstance(model, (str, PathLike)) else model
        self._rig = BatchRig(self._config, self._scene, self._environments, model)
        try:
            self._make_rig()
        except BaseException:
            self.close()
            raise
        self._light_share = np.ones(self._count)  # of each sensor, over its exposure
        self._frame, self._speckle_draw, self._taken = -1, -1, Taken()
        self._results = results
        self._maps = LazyMaps() if on_cuda else LazyMaps("depth_rgb")
        self._cuda_maps, self._maps_on_cuda = CudaMaps(self._engine.device), LazyMaps("depth_rgb")
        weakref.finalize(self, self._under_way.let_end).atexit = False

    # ---- taking pictures ----

    def take_picture(self, infrared_only: bool = False) -> None:
        """Renders all infrared pairs, and before them the RGB pictures unless infrared_only; a pipelined batch begins
        to, and makes those before them the ones that results are of. Raises SensorPoseError, after the others' pictures
        are taken or begun, where a mount's pose is none. Pictures that failed, here or in wait(), are none."""
        self.wait()
        if self._pipelined:
            self._turn()
        else:
            self._forget_maps()
        self._next.forget()
        broken = self._place()
        taken = self._prepare()
        try:
            if not infrared_only:
                self._render_rgb(taken)
            self._render_infrared(taken)
        except BaseException:
            self._under_way.let_end()
            self._darken()
            raise
        self._next.taken, self._next.has_rgb = taken, not infrared_only
        self._next.light_share = self._light_share.copy()
        if not self._pipelined:
            self._finish()
            self._turn()
        raise_broken(broken, self._shape, self._numbers.start)

    def wait(self) -> None:
        """Until the pictures that a pipelined batch has begun are rendered: then the scene may change. Results stay
        those of the ones before."""
        if self._under_way:
            self._finish()

    @property
    def has_picture(self) -> bool:
        """Whether results are there: of a pipelined batch from the second take_picture() on, else from the first."""
        return self._present.taken is not None

    @property
    def has_next(self) -> bool:
        """Whether a pipelined batch has begun pictures, and they have not failed, that the next take_picture() makes
        the present ones."""
        return self._pipelined and self._next.taken is not None

    def render_true_depth(self) -> NDArray[np.float32]:
        """float32 [..., height, width] as get_true_depth(), of the scene and the mounts as they are now; takes no
        picture."""
        self.wait()
        broken = self._place()
        depth = self._renderer.render(
            self._scene, self._rgb_cameras, ["depth"], band="visible", environments=self._environments, spp=1
        )["depth"]
        raise_broken(broken, self._shape, self._numbers.start)
        return depth.reshape(*self._shape, *depth.shape[1:3])

    def compute_depth(self) -> None:
        """Noise, matching and registration of all pairs. What has been read of earlier pictures is computed at once;
        anything else when it is first read."""
        require_picture(self.has_picture)
        self._maps.begin(self._compute)
        if self._on_cuda:
            self._maps_on_cuda.begin(self._compute_on_cuda)

    # ---- results, all [E, ...] or [E, S, ...] ----

    def get_depth(self) -> NDArray[np.float32]:
        """float32 [..., height, width] metres in the RGB cameras; 0 = no measurement."""
        return self._output("depth_rgb")

    def get_depth_mm(self) -> NDArray[np.int16]:
        """int16 [..., height, width, 1] millimetres up to 32767 in the RGB cameras; 0 = no measurement."""
        return np.rint(np.minimum(self.get_depth() * np.float32(1000.0), 32767.0)).astype(np.int16)[..., None]

    def get_disparity(self) -> NDArray[np.float32]:
        """float32 [..., height, width] pixels in the left infrared cameras; -1 = no measurement."""
        return self._output("disparity")

    def get_ir_measured(self) -> list[NDArray[Any]]:
        """[left, right], each uint8 or uint16 [..., height, width]: what the sensors give, with noise."""
        return [self._output("ir_left"), self._output("ir_right")]

    def get_ir_radiance(self) -> NDArray[np.float32]:
        """float32 [2, ..., height, width] W/(sr m^2) at the imagers, left then right, without noise; a copy of a
        GPU's memory, elsewhere a view of what the next picture is rendered into."""
        require_picture(self.has_picture)
        height, width = self._config.ir_resolution[::-1]
        return self._present.link.images().reshape(2, *self._shape, height, width)

    def get_depth_map(self, name: str) -> NDArray[Any]:
        """'confidence', 'reason', 'points', 'rectified_left' or 'rectified_right', as StereoDepthSensor has them."""
        return self._output(name)

    def get_rgba8(self) -> NDArray[np.uint8]:
        """uint8 [..., height, width, 4]: red, green, blue, 255, sRGB-encoded where the pictures were rendered; exposed
        alike, unless the config says how."""
        return self._picture("srgb")

    def get_rgb(self) -> NDArray[np.float32]:
        """float32 [..., height, width, 3] in 0..1, as get_rgba8() but not rounded, and encoded here."""
        return encoded_rgb(self._picture("radiance"), self._config.rgb_exposure)

    def get_true_depth(self) -> NDArray[np.float32]:
        """float32 [..., height, width] metres in the RGB cameras of what is at each pixel's centre; 0 = nothing."""
        return self._picture("depth")[..., 0]

    def get_instance_ids(self) -> NDArray[np.uint32]:
        """uint32 [..., height, width] in the RGB cameras, 0xffffffff = nothing there."""
        return self._picture("instance_id")[..., 0]

    def get_material_ids(self) -> NDArray[np.uint32]:
        """uint32 [..., height, width] in the RGB cameras, 0xffffffff = nothing there."""
        return self._picture("material_id")[..., 0]

    def get_cuda(self, name: str) -> CudaArray:
        """What get_<name>() has, in CUDA memory and without a copy, as float32, uint8, uint16 or uint32: 'depth',
        'disparity', 'ir_left', 'ir_right' (of ir_measured), a map of get_depth_map(), 'rgba8', 'true_depth',
        'instance_ids' or 'material_ids'; or 'radiance', the light that get_rgb() encodes. torch.as_tensor(array,
        device="cuda") takes it. The next take_picture() or compute_depth() writes into the same memory. RuntimeError
        without on_cuda, ValueError for another name."""
        if not self._on_cuda:
            raise RuntimeError("this batch is of the host: make it with on_cuda=True")
        check_cuda_name(name, "a batch")
        if name in MAPS:
            require_depth(self._maps)
            return self._maps_on_cuda.read(MAPS[name], self._compute_on_cuda)
        require_rgb(self.has_picture, self._present.has_rgb)
        shape = self._present.rgb.targets[PICTURES[name]].shape
        return self._present.rgb.cuda(PICTURES[name], (*self._shape, *(shape[1:] if shape[-1] > 1 else shape[1:-1])))

    # ---- the batch itself ----

    @property
    def shape(self) -> tuple[int, ...]:
        """(E,) or (E, S)."""
        return self._shape

    @property
    def frame_index(self) -> int:
        """Counts the pictures, from 0; -1 before the first."""
        return self._frame

    @property
    def allocated_bytes(self) -> int:
        """What the buffers of this batch's device hold now: scene, renderer, depth engine and images."""
        return int(self._scene.device.allocated_bytes + self._engine.device.allocated_bytes)

    @property
    def stage_times(self) -> dict[str, float]:
        """{stage: milliseconds} of the last render and the last match."""
        render = {f"render: {name}": t for name, t in self._renderer.stage_times.items()}
        return render | {f"depth: {name}": t for name, t in self._engine.stage_times.items()}

    def get_config(self) -> StereoDepthSensorConfig:
        """A copy."""
        return deepcopy(self._config)

    def vary(
        self,
        environment: int | None = None,
        laser_power: ArrayLike | None = None,
        exposure: ArrayLike | None = None,
        right_turn: NDArray[np.float64] | None = None,
    ) -> None:
        """How the sensors of an environment differ from the configuration, from the next picture on: the laser's power
        [S] and the exposure [S] over what they are without this, and rotations [S, 3, 3] of the right eyes in their
        own axes, which the matcher does not know of. environment None: of all at once, each array then with the
        batch's shape, [E] or [E, S], before the rest. What is None stays as it is. ValueError for another number of
        sensors, for numbers that are negative or not finite, and for what is no rotation; then nothing has changed."""
        sensors = self._count // self._shape[0]
        own, shape, where = slice(None), self._shape, "the batch"
        if environment is not None:
            if environment not in self._numbers:
                raise ValueError(f"environments are {self._numbers[0]} to {self._numbers[-1]}, not {environment}")
            first = (environment - self._numbers.start) * sensors
            own, shape, where = slice(first, first + sensors), (sensors,), f"environment {environment}"
        shares = {}
        for name, values in (("laser_power", laser_power), ("exposure", exposure)):
            if values is None:
                continue
            shares[name] = np.asarray(values, np.float64)
            if shares[name].shape != shape:
                raise ValueError(f"{name} of {where} is {list(shape)} numbers from 0 on, not {values!r}")
            for n, value in enumerate(shares[name].ravel().tolist()):
                at = where if environment is not None else f"environment {self._numbers[n // sensors]}"
                POWER.check(f"{name} of {at}", value)
        if right_turn is not None:
            if np.shape(right_turn) != (*shape, 3, 3):
                raise ValueError(f"right_turn of {where}: {[*shape, 3, 3]}, not {np.shape(right_turn)}")
            turned = np.broadcast_to(np.eye(4), (int(np.prod(shape)), 4, 4)).copy()
            turned[:, :3, :3] = np.reshape(right_turn, (-1, 3, 3))
            broken = np.flatnonzero(pose_fault(turned))
            if broken.size:
                at = where if environment is not None else f"environment {self._numbers[int(broken[0]) // sensors]}"
                raise ValueError(f"right_turn of {at} is no rotation")
            self._rig.right_turn[own] = turned
        if "laser_power" in shares:
            self._rig.laser_power[own] = shares["laser_power"].ravel()
        if "exposure" in shares:
            self._light_share[own] = shares["exposure"].ravel()

    def count_to(self, frame: int) -> None:
        """The next picture has the number after this one: as where pictures were taken elsewhere that failed here."""
        self._frame = int(FRAME.check("a picture's number", frame))

    def restart(self, seed: int) -> None:
        """The next picture is frame 0 under this seed, of the render and of the noise: from here on all is as it was
        after the same restart."""
        seed = int(RENDER_SEED.check("the seed", seed))
        self.wait()
        self._config.render_seed = self._config.noise_seed = seed
        self._engine.set_parameters(noise_seed=seed)
        self._frame, self._speckle_draw = -1, -1
        self._present.forget()
        self._next.forget()
        self._forget_maps()

    def close(self) -> None:
        """Takes the projectors, and what else a model brought, out of the scene."""
        self._under_way.let_end()
        self._rig.leave()

    def __enter__(self) -> StereoDepthSensorBatch:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ---- inside ----

    def _new_picture(self) -> Picture:
        """Memory for pictures of all sensors."""
        device, (width, height) = self._scene.device, self._config.ir_resolution
        rgb_width, rgb_height = self._config.rgb_resolution
        return Picture(
            IrLink(device, self._engine.device, width, height, count=self._count),
            PictureMemory(device, (self._count, rgb_height, rgb_width), RGB_OUTPUTS, on_cuda=self._on_cuda),
        )

    def _make_rig(self) -> None:
        """The cameras and projectors of all sensors, and where they are on theirs."""
        c = self._config
        self._engine.set_signal(*(eye.signal for eye in self._rig.inputs.sides))
        lens: dict[str, Any] = {"distortion": c.rgb_distortion, "exposure_s": c.rgb_exposure_s}
        lens |= shutter(c.rgb_line_time_s, c.rgb_readout)
        self._rgb_on_rig = camera_to_world(Pose())
        width, height = c.rgb_resolution
        self._rgb_cameras = [kuafu.Camera(width, height, c.rgb_intrinsic, **lens) for _ in range(self._count)]

    def _place(self) -> NDArray[np.intp]:
        """Cameras and projectors to where the mounts are; returns the numbers of sensors whose mount has no pose."""
        places = pose_matrices(host_array(self._mounts.poses), "poses of sensors")
        if places.shape[:-2] != self._mounts_shape:
            raise ValueError(f"this batch is of {self._mounts_shape} sensors; the poses are of {places.shape[:-2]}")
        places = places.reshape(-1, 4, 4)
        broken = pose_fault(places)
        if self._frame < 0 or not np.array_equal(places[~broken], self._places[~broken]):
            self._speckle_draw += 1
        self._places[~broken] = places[~broken]
        rigs = self._places[self._own] @ self._pose
        self._rig.place(rigs)
        for camera, view in zip(self._rgb_cameras, rigs @ self._rgb_on_rig, strict=True):
            camera.camera_to_world = view
        return np.flatnonzero(broken[self._own])

    def _prepare(self) -> Taken:
        """Lets the next picture's emitters shine."""
        frame = self._frame + 1
        self._rig.shine(self._config.emitter_power(frame))
        return Taken(frame, max(self._speckle_draw, 0), self._rig.inputs.speckle_of_laser)

    def _darken(self) -> None:
        if not self._config.projector_always_on:
            self._rig.shine(0.0)

    def _render(self, group: str, cameras: list[kuafu.Camera], targets: Any, taken: Taken, **options: Any) -> None:
        """Renders now, or begins to where pictures are pipelined."""
        options |= render_settings(self._config, taken.frame)
        if self._pipelined:
            self._under_way.begin(group, self._renderer, self._scene, cameras, targets, **options)
        else:
            self._renderer.render(self._scene, cameras, targets, **options)

    def _render_rgb(self, taken: Taken) -> None:
        memory = self._next.rgb
        memory.forget()
        optics, scales = self._config.rgb_optics, {"srgb": self._config.rgb_exposure or 0.0}
        seen = {"band": "visible", "environments": self._environments, "optics": optics, "scales": scales}
        self._render("rgb", self._rgb_cameras, memory.targets, taken, **seen)

    def _render_infrared(self, taken: Taken) -> None:
        """The laser's part, where speckle is its alone, is kept beside it."""
        seen = {"band": "infrared", "environments": self._environments * 2, "optics": self._rig.optics}
        self._render("ir", self._rig.cameras, self._next.link.targets(taken.is_laser_apart), taken, **seen)

    def _finish(self) -> None:
        """Once the next pictures are rendered: the emitters go dark, and the pairs are exposed and delivered."""
        try:
            try:
                self._under_way.wait()
            finally:
                if not self._under_way:
                    self._darken()
            self._exposure.expose(self._next, self._rig.inputs)
        except BaseException:
            if not self._under_way:
                self._next.forget()
            raise

    def _turn(self) -> None:
        """What was rendered are the pictures now; of a pipelined batch those before give their memory to the next."""
        taken = self._next.taken
        if taken is None:
            return
        self._forget_maps()
        self._present, self._next = self._next, self._present
        self._frame, self._taken = taken.frame, taken
        if self._pipelined:
            self._next.forget()

    def _compute(self, names: list[str]) -> dict[str, NDArray[Any]]:
        taken = {} if self._results is None else self._results.take(names)
        if taken:
            leading = len(self._shape)
            self._match({name: image.reshape(self._count, *image.shape[leading:]) for name, image in taken.items()})
            return taken
        found = {name: image.reshape(self._shape_of(image)) for name, image in self._match(names).items()}
        if self._results is not None:
            self._results.learn({name: Kind(image.shape[1:], image.dtype) for name, image in found.items()})
        return found

    def _compute_on_cuda(self, names: list[str]) -> dict[str, CudaArray]:
        found = self._cuda_maps.compute(names, self._match)
        return {name: one.array(self._shape_of(one.image)) for name, one in found.items()}

    def _shape_of(self, image: NDArray[Any] | simsense.Image) -> tuple[int, ...]:
        return (*self._shape, *image.shape[1 if self._count > 1 else 0 :])

    def _match(
        self, outputs: list[str] | dict[str, simsense.Image] | dict[str, NDArray[Any]]
    ) -> dict[str, NDArray[Any]]:
        self._engine.set_parameters(
            frame_index=self._taken.frame, scene_index=self._taken.speckle_draw, first_view=self._own.start
        )
        link = self._present.link
        lasers: dict[str, Any] = link.lasers(self._taken.is_laser_apart)
        return self._engine.compute(link.left, link.right, outputs, **lasers)

    def _output(self, name: str) -> NDArray[Any]:
        require_depth(self._maps)
        return self._maps.read(name, self._compute)

    def _picture(self, name: str) -> NDArray[Any]:
        require_rgb(self.has_picture, self._present.has_rgb)
        image = self._present.rgb.read(name)
        return image.reshape(*self._shape, *image.shape[1:])

    def _forget_maps(self) -> None:
        self._maps.clear()
        self._maps_on_cuda.clear()
