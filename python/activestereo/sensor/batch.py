# SPDX-License-Identifier: Apache-2.0
"""StereoDepthSensorBatch simulates equal depth sensors in many environments, with one render and one match for all.

    batch = StereoDepthSensorBatch(config, Mounts(scene, poses))  # poses [E, 7], [E, S, 7] or the same with 4x4
    batch.take_picture(infrared_only=True)
    batch.compute_depth()
    depth_m = torch.from_numpy(batch.get_depth())  # [E, height, width] or [E, S, height, width], no copy

Environments are kuafu's. An instance or a light may have an environment number: then only the sensors of this
environment see it. Without a number all sensors see it. activestereo.scene_io.bodies puts bodies into environments.
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
from activestereo.common.limits import FACTOR
from activestereo.common.pose import PoseLike, as_matrix, pose_fault
from activestereo.model import SensorModel
from activestereo.sensor.engine import SensorEngine
from activestereo.sensor.foreign_matcher import MatcherLike
from activestereo.sensor.mounts import HasPoses, Places, raise_broken, raise_faults
from activestereo.sensor.results import SensorResults


class StereoDepthSensorBatch(SensorResults):
    """Simulates S depth sensors in each of E environments, all with one configuration. To use several GPUs, start one
    process for each, with its own scene and batch.

    config: a StereoDepthSensorConfig, which is copied, or a camera's name. mounts: Mounts, or another object with a
    scene and poses (body axes). pose: the RGB camera's pose relative to its mount; None: identity. Sensors of one
    environment see one another's projectors, as real ones do. The sensors' images have independent noise, which a seed
    repeats exactly. Exposure is 'fixed' or 'settled'. With 'settled' the product of exposure and gain adapts to each
    sensor's own images. Use it in one thread at a time.

    model: a SensorModel or the path of a model.json. All sensors get its effects; the whole scene gets its materials
    and medium until close(). Raises ValueError for effects that neither renderer nor depth engine computes
    (StereoDepthSensor supports them), and for a model that does not fit the scene. Nothing has changed then.

    on_cuda: pictures and maps lie in memory that CUDA can access, for get_cuda(); the host copies them from there.
    Raises CudaError if there is no CUDA, or none on this GPU.

    matcher: as in StereoDepthSensor; it gets all pairs in one call.
    """

    def __init__(
        self, config: StereoDepthSensorConfig | str, mounts: HasPoses, pose: PoseLike | None = None,
        model: SensorModel | str | PathLike[str] | None = None, on_cuda: bool = False,
        matcher: MatcherLike = "simsense",
    ) -> None:  # fmt: skip
        self._config = own_config(config)
        plan = plan_of(self._config)
        self._places = Places(mounts, np.eye(4) if pose is None else as_matrix(pose))
        self.shape = self._places.shape  # (E,) or (E, S)
        count, sensors = self.shape[0], prod(self.shape[1:])
        self._engine = SensorEngine(
            plan, mounts.scene, np.repeat(range(count), sensors).tolist(), self.shape, model=model, on_cuda=on_cuda,
            matcher=matcher,
        )  # fmt: skip

    # ---- taking pictures ----

    def take_picture(self, infrared_only: bool = False) -> None:
        """Renders all infrared pairs, and before them the RGB pictures unless infrared_only. Raises SensorPoseError if
        a mount has no pose, after the others' pictures are taken. A failed picture leaves no result."""
        self._engine.drop_pictures()
        broken = self._places.read()
        self._engine.take_pictures(self._places.rigs(), infrared_only)
        raise_broken(broken, self.shape)

    def render_true_depth(self) -> NDArray[np.float32]:
        """Renders depth float32 [..., height, width], metres, as get_true_depth() gives it, for the present scene and
        mounts. Takes no picture."""
        broken = self._places.read()
        depth = self._engine.render_true_depth(self._places.rigs())
        raise_broken(broken, self.shape)
        return depth

    def compute_depth(self) -> None:
        """Applies noise, matches all pairs and registers their depth to the RGB cameras. Also computes the maps that
        were read for earlier pictures. Any other map is computed when it is first read."""
        self._engine.match()

    # ---- results ----

    def get_ir_radiance(self) -> NDArray[np.float32]:
        """Returns float32 [2, ..., height, width] W/(sr m^2) at the imagers, left then right, without noise. It is a
        view, which the next picture overwrites, or a copy of a discrete GPU's own memory."""
        return self._engine.light()

    def get_pointcloud(self, with_rgb: bool = False) -> NDArray[np.float32]:
        """Returns float32 [..., height, width, 3], metres in the RGB cameras' axes (x right, y down, z forward), 0 = no
        measurement. with_rgb: the last axis is x, y, z, red, green, blue, with colours 0..1."""
        points = np.moveaxis(self.rgb_rays(), 0, -1).astype(np.float32) * self.get_depth()[..., None]
        return np.concatenate([points, self.get_rgb()], axis=-1) if with_rgb else points

    # ---- the batch itself ----

    @property
    def allocated_bytes(self) -> int:
        """Returns the bytes in all buffers of this batch now: scene, renderer, depth engine and images."""
        return self._engine.scene.device.allocated_bytes + self._engine.matcher.device.allocated_bytes

    def vary(
        self, environment: int | None = None, laser_power: ArrayLike | None = None, exposure: ArrayLike | None = None,
        right_turn: NDArray[np.float64] | None = None,
    ) -> None:  # fmt: skip
        """Makes the sensors of an environment differ from the configuration, from the next picture on.

        laser_power [S] and exposure [S] are factors on the configured values. right_turn: rotation matrices [S, 3, 3]
        of the right cameras in their own axes; the matcher still assumes unrotated ones. environment: its number; None:
        all, and the arrays begin with the batch's shape, [E] or [E, S], in place of [S]. Any other argument that is
        None leaves its values unchanged. Raises ValueError, which lists the environments, for a wrong number of
        sensors, negative or non-finite numbers, and matrices that are no rotation. Nothing has changed then."""
        self._engine.rig.require_open()
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
            raise_faults(name, each, [FACTOR.fault(value) for value in shares[name].ravel().tolist()])
        if right_turn is not None:
            if np.shape(right_turn) != (*shape, 3, 3):
                raise ValueError(f"right_turn of {where}: {[*shape, 3, 3]}, not {np.shape(right_turn)}")
            turned = np.broadcast_to(np.eye(4), (len(each), 4, 4)).copy()
            turned[:, :3, :3] = np.reshape(right_turn, (-1, 3, 3))
            raise_faults("right_turn", each, ["is no rotation" if bad else None for bad in pose_fault(turned)])
            self._engine.rig.right_turn[own] = turned
        if "laser_power" in shares:
            self._engine.rig.in_scene.laser_power[own] = shares["laser_power"].ravel()
        if "exposure" in shares:
            self._engine.light_share[own] = shares["exposure"].ravel()

    def restart(self, seed: int | Sequence[int]) -> None:
        """Drops the current pictures, numbers the next picture 0, and seeds render and noise. The same seed repeats
        pictures exactly.

        seed: a number, or one for each environment, [E]. With one for each, an environment's noise does not depend on
        its number. Its light samples do, and depend on the configuration's render_seed. Raises ValueError, which lists
        the environments, for an invalid seed; nothing has changed then."""
        if np.ndim(seed) == 0:
            one = int(RENDER_SEED.check("the seed", seed))
            self._engine.restart(one)
            self._config.render_seed = self._config.noise_seed = one
            return
        if np.shape(seed) != self.shape[:1]:
            raise ValueError(f"seeds are {list(np.shape(seed))}, expected a number or [{self.shape[0]}]")
        seeds = np.asarray(seed).tolist()
        raise_faults("the seed", np.arange(len(seeds)), [RENDER_SEED.fault(one) for one in seeds])
        sensors = range(prod(self.shape[1:]))
        own = [one + (sensor << 32) for one in seeds for sensor in sensors]  # sensors of an environment differ
        self._engine.restart(self._config.render_seed, own)

    # ---- inside ----

    def _poses(self) -> NDArray[np.float64]:
        self._places.read()
        return self._places.rigs().reshape(*self.shape, 4, 4)
