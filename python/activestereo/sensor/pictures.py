# SPDX-License-Identifier: Apache-2.0
"""Pictures in their own memory, which stay there until somebody reads one; how each is exposed for its own view; and
renders that were submitted, with the sensors that a scene's changes wait for."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

import kuafu
from activestereo.camera.auto_exposure import AutoExposure, Setting
from activestereo.effects.core.engine import EngineInputs
from activestereo.sensor.cuda_memory import CudaArray, CudaMemory
from activestereo.sensor.ir_link import IrLink

# dtype and channels of an RGB picture's outputs
RGB_OUTPUTS = {
    "radiance": (np.float32, 3),
    "srgb": (np.uint8, 4),
    "depth": (np.float32, 1),
    "material_id": (np.uint32, 1),
    "instance_id": (np.uint32, 1),
}


class PictureMemory:
    """Images [count, height, width, channels] of several outputs; each picture overwrites the last. After an output is
    read once, a GPU writes it directly to host memory, which saves a copy. `radiance` stays on the GPU, which reads it
    itself.

    outputs: {kuafu's name: (dtype, channels)}. host_visible: None = no on a GPU. on_cuda: CUDA sees the memory, too;
    raises CudaError without CUDA on this GPU.
    """

    def __init__(
        self, device: kuafu.Device, shape: tuple[int, int, int], outputs: Mapping[str, tuple[DTypeLike, int]],
        host_visible: bool | None = None, on_cuda: bool = False,
    ) -> None:  # fmt: skip
        is_host = device.info.kind in ("cpu", "host") if host_visible is None else host_visible
        self._device = device
        self.targets: dict[str, kuafu.Image] = {}
        for name, (dtype, channels) in outputs.items():
            full = (*shape, channels)
            size_bytes = int(np.prod(full)) * np.dtype(dtype).itemsize
            self.targets[name] = kuafu.Buffer(device, size_bytes, host_visible=is_host, exportable=on_cuda).image(
                dtype, full
            )
        shared = self.targets if on_cuda else {}
        self._cuda = {name: CudaMemory(image.buffer) for name, image in shared.items()}
        self._on_device = set() if is_host or on_cuda else set(outputs) - {"radiance"}
        self._read: dict[str, NDArray[Any]] = {}

    def forget(self) -> None:
        """Forgets the last picture's outputs, before a render into `targets`."""
        for name in self._on_device & self._read.keys():
            image = self.targets[name]
            self.targets[name] = kuafu.Buffer(self._device, image.buffer.size_bytes).image(image.dtype, image.shape)
            self._on_device.remove(name)
        self._read = {}

    def read(self, name: str) -> NDArray[Any]:
        """One output of the last picture; a copy, the same one until forget()."""
        if name not in self._read:
            image = self.targets[name]
            self._read[name] = image.buffer.read().view(image.dtype).reshape(image.shape)
        return self._read[name]

    def cuda(self, name: str, shape: tuple[int, ...]) -> CudaArray:
        """One output of the last picture in this shape, in the memory that it was rendered into. No copy; the next
        picture overwrites it."""
        return self._cuda[name].array(self.targets[name].dtype, shape)


class Taken(NamedTuple):
    """Facts of a picture, beside its images, that matching depends on."""

    frame: int = -1
    speckle_draw: int = -1
    is_laser_apart: bool = False


@dataclass
class Picture:
    """Memory of one picture, and the settings of the last one in it. taken: None if there is none. has_rgb: the memory
    holds RGB images, perhaps of an earlier picture. signals: the imagers' settings, left and right, with exposure and
    gain. light_share: for each sensor, its light over that of its exposure."""

    link: IrLink
    rgb: PictureMemory
    taken: Taken | None = None
    has_rgb: bool = False
    setting: Setting | None = None
    signals: list[dict[str, float]] = field(default_factory=list)
    light_share: NDArray[np.float64] = field(default_factory=lambda: np.ones(1))


class UnderWay:
    """Renders in order of submission. False if none is under way."""

    def __init__(self) -> None:
        self._submissions: list[tuple[str, kuafu.Submission]] = []

    def __bool__(self) -> bool:
        return bool(self._submissions)

    def add(self, name: str, submission: kuafu.Submission) -> None:
        self._submissions.append((name, submission))

    def wait(self, ended: Callable[[str], object]) -> None:
        """Waits until all have ended and calls ended(name) after each. Raises the first error after the others have
        ended; an interrupt leaves them running."""
        while self._submissions:
            name, submission = self._submissions[0]
            try:
                submission.wait()
            except kuafu.Error:
                self.let_end()
                raise
            self._submissions.pop(0)
            ended(name)

    def let_end(self) -> None:
        """wait() that ignores failures."""
        while self._submissions:
            _, submission = self._submissions.pop(0)
            try:
                submission.wait()
            except kuafu.Error:
                continue


class PipelinedSensors(weakref.WeakSet[Any]):
    """The pipelined sensors of one scene. Their pictures end before it changes."""

    def wait(self) -> None:
        """Waits for all pictures. Raises a failed picture's error after the others have ended; the next wait() goes
        on."""
        errors: list[Exception] = []
        for sensor in self:
            try:
                sensor.wait()
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]


def expose_each(picture: Picture, auto: AutoExposure, inputs: EngineInputs) -> None:
    """Brings rendered pairs to their sensors' exposures. inputs: of each sensor."""
    link, shares = picture.link, picture.light_share
    if auto.mode == "fixed" and bool((shares == 1.0).all()):
        return
    light = shares.astype(np.float32)
    if auto.mode != "fixed":
        light *= auto.settled_light(inputs.left.signal, link.images(link.count), inputs.max_dn)
    link.brighten(light)
    if picture.taken is not None and picture.taken.is_laser_apart:
        link.laser().brighten(light)
