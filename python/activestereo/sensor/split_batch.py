# SPDX-License-Identifier: Apache-2.0
"""SplitStereoDepthSensorBatch: a StereoDepthSensorBatch over several devices, with its results in one array.

    scenes = [kuafu.Scene(kuafu.Device(index)) for index in (0, 1)]
    for scene in scenes:
        fill(scene)  # the same calls
    batch = SplitStereoDepthSensorBatch(config, [Mounts(scene, poses) for scene in scenes])
    batch.take_picture(infrared_only=True)
    batch.compute_depth()
    batch.get_depth()  # [E, height, width], in host memory

Device k of D has the environments from k E / D to (k + 1) E / D. On devices of one kind all has the bits that one of
them gives; but where config.rgb_exposure is None, each device exposes its own RGB pictures alike. A picture that fails
on one device alone counts there, too, so that all devices' next pictures are of one number.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from types import TracebackType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose_arrays import host_array
from activestereo.sensor.batch import StereoDepthSensorBatch
from activestereo.sensor.mounts import HasPoses, SensorPoseError
from activestereo.sensor.result_memory import JoinedResults, joined

_Result = TypeVar("_Result")


class SplitStereoDepthSensorBatch:
    """Methods do what StereoDepthSensorBatch's of the same names do, with a thread for each device.

    mounts: one for each device, with a scene on that device and the poses of all environments. The scenes are kept the
    same by the same calls; one may lack what belongs to environments of other devices, and then numbers of instances
    and materials are those of each scene. options: further arguments of StereoDepthSensorBatch. ValueError for fewer
    environments than devices, and for mounts that are not of as many.
    """

    def __init__(self, config: StereoDepthSensorConfig, mounts: Sequence[HasPoses], **options: Any) -> None:
        counts = {len(host_array(one.poses)) for one in mounts}
        if len(counts) != 1 or len(mounts) > min(counts):
            raise ValueError(f"{len(mounts)} devices take as many environments or more, not {sorted(counts)}")
        bounds = [k * min(counts) // len(mounts) for k in range(len(mounts) + 1)]
        self._numbers = [range(first, end) for first, end in zip(bounds[:-1], bounds[1:], strict=True)]
        self._results = JoinedResults([len(own) for own in self._numbers])
        self._parts = [
            StereoDepthSensorBatch(config, one, environments=own, results=self._results.part(k), **options)
            for k, (one, own) in enumerate(zip(mounts, self._numbers, strict=True))
        ]
        self._threads: ThreadPoolExecutor | None = ThreadPoolExecutor(len(self._parts), "device")

    @property
    def parts(self) -> list[StereoDepthSensorBatch]:
        """The batch of each device: get_cuda() has its environments' results in that device's memory, vary() knows its
        environments by their numbers."""
        return list(self._parts)

    @property
    def shape(self) -> tuple[int, ...]:
        """(E,) or (E, S)."""
        return (sum(part.shape[0] for part in self._parts), *self._parts[0].shape[1:])

    @property
    def frame_index(self) -> int:
        return self._parts[0].frame_index

    def take_picture(self, infrared_only: bool = False) -> None:
        try:
            self._each(lambda part: part.take_picture(infrared_only))
        finally:
            last = max(part.frame_index for part in self._parts)
            for part in self._parts:
                part.count_to(last)

    def compute_depth(self) -> None:
        self._results.begin()
        self._each(lambda part: part.compute_depth())

    def render_true_depth(self) -> NDArray[np.float32]:
        return self._joined(lambda part: part.render_true_depth())

    def get_depth(self) -> NDArray[np.float32]:
        return self._joined(lambda part: part.get_depth())

    def get_depth_mm(self) -> NDArray[np.int16]:
        return self._joined(lambda part: part.get_depth_mm())

    def get_disparity(self) -> NDArray[np.float32]:
        return self._joined(lambda part: part.get_disparity())

    def get_ir_measured(self) -> list[NDArray[Any]]:
        pairs = self._each(lambda part: part.get_ir_measured())
        return [self._join(images) for images in zip(*pairs, strict=True)]

    def get_ir_radiance(self) -> NDArray[np.float32]:
        return np.concatenate(self._each(lambda part: part.get_ir_radiance()), axis=1)

    def get_depth_map(self, name: str) -> NDArray[Any]:
        return self._joined(lambda part: part.get_depth_map(name))

    def get_rgba8(self) -> NDArray[np.uint8]:
        return self._joined(lambda part: part.get_rgba8())

    def get_rgb(self) -> NDArray[np.float32]:
        return self._joined(lambda part: part.get_rgb())

    def get_true_depth(self) -> NDArray[np.float32]:
        return self._joined(lambda part: part.get_true_depth())

    def get_instance_ids(self) -> NDArray[np.uint32]:
        return self._joined(lambda part: part.get_instance_ids())

    def get_material_ids(self) -> NDArray[np.uint32]:
        return self._joined(lambda part: part.get_material_ids())

    def restart(self, seed: int) -> None:
        self._each(lambda part: part.restart(seed))

    def close(self) -> None:
        """As StereoDepthSensorBatch.close(), and ends the devices' threads."""
        try:
            self._each(lambda part: part.close())
        finally:
            self._threads, threads = None, self._threads
            if threads is not None:
                threads.shutdown()

    def __enter__(self) -> SplitStereoDepthSensorBatch:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _each(self, call: Callable[[StereoDepthSensorBatch], _Result]) -> list[_Result]:
        """On all devices at once, after close() on one after another. An error is raised after all have ended, with the
        environments of its device in a note: the first one that is more than a pose, which costs the other environments
        nothing, else the first."""
        if self._threads is None:
            return [call(part) for part in self._parts]
        running = [self._threads.submit(call, part) for part in self._parts]
        try:
            wait(running)
        finally:
            wait(running)  # an interrupt leaves no call under way
        errors: list[BaseException] = []
        for one, own in zip(running, self._numbers, strict=True):
            if (error := one.exception()) is not None:
                if sys.version_info >= (3, 11):
                    error.add_note(f"on the device of environments {own[0]} to {own[-1]}")
                errors.append(error)
        if errors:
            raise min(errors, key=lambda error: isinstance(error, SensorPoseError))
        return [one.result() for one in running]

    def _joined(self, get: Callable[[StereoDepthSensorBatch], NDArray[Any]]) -> NDArray[Any]:
        return self._join(self._each(get))

    def _join(self, images: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """One array: the one that the devices' threads have computed into, or one that they copy into."""
        whole = joined(images)
        if whole is None:
            whole = np.empty((self.shape[0], *images[0].shape[1:]), images[0].dtype)
            targets = np.split(whole, np.cumsum([len(image) for image in images])[:-1])
            pairs = zip(targets, images, strict=True)
            if self._threads is None:
                for target, image in pairs:
                    np.copyto(target, image)
            else:
                list(self._threads.map(lambda pair: np.copyto(*pair), pairs))
        return whole
