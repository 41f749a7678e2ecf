# SPDX-License-Identifier: Apache-2.0
"""StereoDepthSensorBatch simulates equal depth sensors in many environments, with one render and one match for all.

    batch = StereoDepthSensorBatch(config, Mounts(scene, poses))  # poses [E, 7], [E, S, 7] or the same with 4x4
    batch.take_picture(infrared_only=True)
    batch.compute_depth()
    depth_m = torch.from_numpy(batch.get_depth())  # [E, height, width] or [E, S, height, width], no copy

Environments are kuafu's: only the sensors of environment e see an instance or a light that names e. All sensors see one
that names none. activestereo.scene_io.bodies puts bodies into environments.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike, NDArray

from activestereo.camera.config_limits import RENDER_SEED
from activestereo.camera.plan import plan_of
from activestereo.camera.presets import StereoDepthSensorConfig, own_config
from activestereo.common.limits import POWER
from activestereo.common.pose import PoseLike, as_matrix, pose_fault
from activestereo.model import SensorModel
from activestereo.sensor.cuda_memory import CudaArray
from activestereo.sensor.devices import Devices
from activestereo.sensor.engine import SensorEngine
from activestereo.sensor.foreign_matcher import MatcherLike
from activestereo.sensor.maps import JoinedResults
from activestereo.sensor.mounts import HasPoses, Places, raise_broken, raise_faults
from activestereo.sensor.results import SensorResults


class StereoDepthSensorBatch(SensorResults):
    """Simulates S depth sensors in each of E environments, all with one configuration. Runs one SensorEngine on each
    device.

    config: a StereoDepthSensorConfig, which is copied, or a camera's name. mounts: Mounts, or another object with a
    scene and poses (body axes). pose: the RGB camera's pose relative to its mount; None: identity. Sensors of one
    environment see one another's projectors, as real ones do. The sensors' images have independent noise, which a seed
    repeats exactly. Exposure is 'fixed' or 'settled'. Each settled sensor exposes for its own view, and gain counts as
    exposure. Use it in one thread at a time.

    Several devices: mounts are a sequence, one for each, with a scene on that device and the poses of all environments.
    Make the same calls on all scenes. A scene may lack the objects of other devices' environments; then instances and
    materials are numbered per scene. Device k of D has the environments from k E / D to (k + 1) E / D and a thread.
    Results are one array in the host's memory. Several devices of one kind give the same bits as a single one. Only if
    config.rgb_exposure is None, each device chooses one exposure for its own RGB pictures. A picture that fails on one
    device still counts there, so all devices stay at the same picture number.

    model: a SensorModel or the path of a model.json. All sensors get its effects; the whole scene gets its materials
    and medium until close(). Raises ValueError for effects that act outside the engines (StereoDepthSensor supports
    them) and for a model that does not fit the scene. Nothing has changed then.

    on_cuda: pictures and maps lie where CUDA sees them, for get_cuda(), and the host reads them from there. Raises
    CudaError if there is no CUDA, or none on this GPU.

    pipelined: pictures are rendered while those before them are matched and read. take_picture() begins new pictures;
    results are those of the previous pictures, with the same bits. Call wait() before changing the scene; otherwise
    kuafu.Error.

    matcher: as in StereoDepthSensor; it gets all pairs in one call.
    """

    def __init__(
        self, config: StereoDepthSensorConfig | str, mounts: HasPoses | Sequence[HasPoses],
        pose: PoseLike | None = None,
        model: SensorModel | str | PathLike[str] | None = None, on_cuda: bool = False, pipelined: bool = False,
        matcher: MatcherLike = "simsense",
    ) -> None:  # fmt: skip
        self._config = own_config(config)
        plan = plan_of(self._config)
        devices = list(mounts) if isinstance(mounts, Sequence) else [mounts]
        on_mount = np.eye(4) if pose is None else as_matrix(pose)
        self._places = [Places(one, on_mount) for one in devices]
        counts = {places.shape[0] for places in self._places}
        if len(counts) != 1 or len(devices) > min(counts):
            raise ValueError(f"{len(devices)} devices take as many environments or more, not {sorted(counts)}")
        self.shape = self._places[0].shape  # (E,) or (E, S)
        count, sensors = self.shape[0], prod(self.shape[1:])
        bounds = [k * count // len(devices) for k in range(len(devices) + 1)]
        self.device_environments = [range(first, end) for first, end in zip(bounds[:-1], bounds[1:], strict=True)]
        self._own = [slice(own.start * sensors, own.stop * sensors) for own in self.device_environments]
        self._results = JoinedResults([len(own) for own in self.device_environments]) if len(devices) > 1 else None
        engines: list[SensorEngine] = []
        try:
            for k, own in enumerate(self.device_environments):
                engines.append(
                    SensorEngine(
                        plan, devices[k].scene, np.repeat(own, sensors).tolist(),
                        (len(own), *self.shape[1:]), model=model, on_cuda=on_cuda, pipelined=pipelined,
                        first_view=self._own[k].start, results=None if self._results is None else (self._results, k),
                        matcher=matcher,
                    )
                )  # fmt: skip
        except BaseException:
            for engine in engines:
                engine.close()
            raise
        self._engines = engines
        # Factors on each sensor's configured values, and the turn of its right camera.
        self._laser_power, self._light_share = np.ones((2, count * sensors))
        self._right_turn = np.broadcast_to(np.eye(4), (count * sensors, 4, 4)).copy()
        self._devices = Devices(
            [f"on the device of environments {own[0]} to {own[-1]}" for own in self.device_environments]
        )

    # ---- taking pictures ----

    def take_picture(self, infrared_only: bool = False) -> None:
        """Renders all infrared pairs, and before them the RGB pictures unless infrared_only. A pipelined batch begins
        new pictures and makes the previous ones current. Raises SensorPoseError if a mount has no pose, after the
        others' pictures are taken or begun. A failed picture, here or in wait(), leaves no result."""
        self._on_each_device(lambda engine, _: engine.turn())
        broken, rigs = self._present_places()
        try:
            self._on_each_device(
                lambda engine, k: engine.take_pictures(rigs[k], self._places[k].matrices, infrared_only, None)
            )
        finally:
            last = max(engine.frame for engine in self._engines)
            for engine in self._engines:
                engine.frame = last
        raise_broken(broken, self.shape)

    @property
    def has_next(self) -> bool:
        """Returns whether a pipelined batch has begun pictures without a failure; the next take_picture() makes them
        current."""
        return all(engine.has_next for engine in self._engines)

    def render_true_depth(self) -> NDArray[np.float32]:
        """Renders depth float32 [..., height, width], metres, as get_true_depth() gives it, for the present scene and
        mounts. Takes no picture."""
        self.wait()
        broken, rigs = self._present_places()
        depth = self._devices.join(self._on_each_device(lambda engine, k: engine.render_true_depth(rigs[k])))
        raise_broken(broken, self.shape)
        return depth

    def compute_depth(self) -> None:
        """Applies noise, matches all pairs and registers their depth to the RGB cameras. Computes at once those maps
        that were read for earlier pictures, and any other map when it is first read."""
        if self._results is not None:
            self._results.begin()
        self._on_each_device(lambda engine, _: engine.match())

    # ---- results ----

    def get_ir_radiance(self) -> NDArray[np.float32]:
        """Returns float32 [2, ..., height, width] W/(sr m^2) at the imagers, left then right, without noise. On a
        single CPU device it is a view of the next picture's memory, else a copy."""
        light = self._on_each_device(lambda engine, _: engine.light())
        return light[0] if len(light) == 1 else np.concatenate(light, axis=1)

    def get_pointcloud(self, with_rgb: bool = False) -> NDArray[np.float32]:
        """Returns float32 [..., height, width, 3], metres in the RGB cameras' axes (x right, y down, z forward), 0 = no
        measurement. with_rgb: the last axis has 6 numbers, x, y, z and the colour 0..1."""
        points = np.moveaxis(self.rgb_rays(), 0, -1).astype(np.float32) * self.get_depth()[..., None]
        return np.concatenate([points, self.get_rgb()], axis=-1) if with_rgb else points

    def get_cuda(self, name: str, device: int = 0) -> CudaArray:
        """Returns the array of get_<name>() in CUDA memory without a copy, as float32, uint8, uint16 or uint32. Names
        are 'depth', 'disparity', 'ir_left', 'ir_right' (of ir_measured), a map of get_depth_map(), 'rgba8',
        'true_depth', 'instance_ids' or 'material_ids'; or 'radiance', the light that get_rgb() encodes.
        torch.as_tensor(array, device="cuda") takes it. The next take_picture() or compute_depth() writes into the same
        memory. device: number of the device whose environments the array holds. Raises RuntimeError without on_cuda,
        ValueError for another name."""
        if device not in range(len(self._engines)):
            raise ValueError(f"devices are 0 to {len(self._engines) - 1}, not {device}")
        return self._cuda(self._engines[device], name)

    # ---- the batch itself ----

    @property
    def allocated_bytes(self) -> int:
        """Returns the bytes in all buffers of this batch's devices now: scene, renderer, depth engine and images."""
        return sum(e.scene.device.allocated_bytes + e.matcher.device.allocated_bytes for e in self._engines)

    def vary(
        self, environment: int | None = None, laser_power: ArrayLike | None = None, exposure: ArrayLike | None = None,
        right_turn: NDArray[np.float64] | None = None,
    ) -> None:  # fmt: skip
        """Makes the sensors of an environment differ from the configuration, from the next picture on.

        laser_power [S] and exposure [S] are factors on the configured values. The rotations [S, 3, 3] turn the right
        cameras in their own axes; the matcher does not know of them. environment: its number; None: all, and the arrays
        begin with the batch's shape, [E] or [E, S], in place of [S]. Another argument that is None keeps its values.
        Raises ValueError, which lists the environments, for a wrong number of sensors, negative or non-finite numbers,
        and matrices that are no rotation. Nothing has changed then."""
        sensors = self.shape[1:] or (1,)
        first, last, shape, where = 0, self.shape[0], self.shape, "the batch"
        if environment is not None:
            if environment not in range(last):
                raise ValueError(f"environments are 0 to {last - 1}, not {environment}")
            first, last, shape, where = environment, environment + 1, sensors, f"environment {environment}"
        own, each = slice(first * prod(sensors), last * prod(sensors)), np.repeat(range(first, last), prod(sensors))
        shares = {}
        for name, values in (("laser_power", laser_power), ("exposure", exposure)):
            if values is None:
                continue
            try:
                shares[name] = np.asarray(values, np.float64)
            except (TypeError, ValueError):
                shares[name] = np.empty(0)
            if shares[name].shape != shape:
                raise ValueError(f"{name} of {where} is {list(shape)} numbers from 0 on, not {values!r}")
            raise_faults(name, each, [POWER.fault(value) for value in shares[name].ravel().tolist()])
        if right_turn is not None:
            if np.shape(right_turn) != (*shape, 3, 3):
                raise ValueError(f"right_turn of {where}: {[*shape, 3, 3]}, not {np.shape(right_turn)}")
            turned = np.broadcast_to(np.eye(4), (len(each), 4, 4)).copy()
            turned[:, :3, :3] = np.reshape(right_turn, (-1, 3, 3))
            raise_faults("right_turn", each, ["is no rotation" if bad else None for bad in pose_fault(turned)])
            self._right_turn[own] = turned
        if "laser_power" in shares:
            self._laser_power[own] = shares["laser_power"].ravel()
        if "exposure" in shares:
            self._light_share[own] = shares["exposure"].ravel()
        for engine, mine in zip(self._engines, self._own, strict=True):
            engine.rig.in_scene.laser_power, engine.light_share = self._laser_power[mine], self._light_share[mine]
            engine.rig.right_turn = self._right_turn[mine]

    def restart(self, seed: int | Sequence[int]) -> None:
        """Makes the next picture frame 0 under this seed, for render and noise. Pictures repeat exactly after the same
        restart.

        seed: a number, or one for each environment, [E]. With one for each, an environment's noise does not depend on
        its place among the others; light samples depend on the configuration's render_seed and the environment's
        number. Raises ValueError, which lists the environments, for an invalid seed; nothing has changed then."""
        if np.ndim(seed) == 0:
            one = int(RENDER_SEED.check("the seed", seed))
            self._config.render_seed = self._config.noise_seed = one
            self._on_each_device(lambda engine, _: engine.restart(one))
            return
        if np.shape(seed) != self.shape[:1]:
            raise ValueError(f"seeds are {list(np.shape(seed))}, expected a number or [{self.shape[0]}]")
        seeds = np.asarray(seed).tolist()
        raise_faults("the seed", np.arange(len(seeds)), [RENDER_SEED.fault(one) for one in seeds])
        sensors = range(prod(self.shape[1:]))
        own = [one + (sensor << 32) for one in seeds for sensor in sensors]  # sensors of an environment differ
        self._on_each_device(lambda engine, k: engine.restart(self._config.render_seed, own[self._own[k]]))

    # ---- inside ----

    def _poses(self) -> NDArray[np.float64]:
        _, rigs = self._present_places()
        return np.concatenate(rigs).reshape(*self.shape, 4, 4)

    def _present_places(self) -> tuple[NDArray[np.bool_], list[NDArray[np.float64]]]:
        """Reads the mounts. Returns a mask [sensors], true where a mount has no valid pose, and the RGB cameras' poses
        [sensors, 4, 4] of each device."""
        broken = np.concatenate([one.read()[own] for one, own in zip(self._places, self._own, strict=True)])
        return broken, [one.rigs(own) for one, own in zip(self._places, self._own, strict=True)]
