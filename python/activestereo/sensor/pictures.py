# SPDX-License-Identifier: Apache-2.0
"""Memory of rendered pictures and their settings, renders under way, and the scaling of pictures to each sensor's
exposure."""

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
    """Memory for images [count, height, width, channels] of several outputs; each picture overwrites the last. After an
    output is read once, a GPU writes it directly to host memory, which saves a copy. `radiance` stays on the GPU, which
    itself reads it.

    outputs: {kuafu's name: (dtype, channels)}. host_visible: None = only on a CPU device. on_cuda: CUDA sees the
    memory, too; raises CudaError without CUDA on this GPU.
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
        """Drops the host copies of the last picture, so that read() copies the next one. Call it before a render into
        `targets`."""
        for name in self._on_device & self._read.keys():
            image = self.targets[name]
            self.targets[name] = kuafu.Buffer(self._device, image.buffer.size_bytes).image(image.dtype, image.shape)
            self._on_device.remove(name)
        self._read = {}

    def read(self, name: str) -> NDArray[Any]:
        """Returns a host copy of one output of the last picture, the same array until forget()."""
        if name not in self._read:
            image = self.targets[name]
            self._read[name] = image.buffer.read().view(image.dtype).reshape(image.shape)
        return self._read[name]

    def cuda(self, name: str, shape: tuple[int, ...]) -> CudaArray:
        """Returns one output of the last picture in CUDA memory with this shape, without a copy; the next picture
        overwrites it."""
        return self._cuda[name].array(self.targets[name].dtype, shape)


class Taken(NamedTuple):
    """Identifies a picture for matching. frame: its number, which seeds the noise. speckle_draw: number of the static
    speckle pattern. is_laser_apart: the projector's light was also rendered alone."""

    frame: int = -1
    speckle_draw: int = -1
    is_laser_apart: bool = False


@dataclass
class Picture:
    """Memory for one picture of each sensor, and the settings of the last one rendered there.

    taken: None if there is no picture. has_rgb: the memory holds RGB images, perhaps of an earlier picture. setting:
    exposure and gain. signals: the imagers' parameters, left and right, with exposure and gain. light_share: [sensors],
    factors on each sensor's exposure."""

    link: IrLink
    rgb: PictureMemory
    taken: Taken | None = None
    has_rgb: bool = False
    setting: Setting | None = None
    signals: list[dict[str, float]] = field(default_factory=list)
    light_share: NDArray[np.float64] = field(default_factory=lambda: np.ones(1))


class UnderWay:
    """A queue of submitted renders that may still run, oldest first. It is false if it is empty."""

    def __init__(self) -> None:
        self._submissions: list[tuple[str, kuafu.Submission]] = []

    def __bool__(self) -> bool:
        return bool(self._submissions)

    def add(self, name: str, submission: kuafu.Submission) -> None:
        self._submissions.append((name, submission))

    def wait(self, ended: Callable[[str], object]) -> None:
        """Waits for all renders and calls ended(name) after each. Raises the first error after the others have ended;
        an interrupt leaves them running."""
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
        """Waits for all renders and ignores their failures."""
        while self._submissions:
            _, submission = self._submissions.pop(0)
            try:
                submission.wait()
            except kuafu.Error:
                continue


class PipelinedSensors(weakref.WeakSet[Any]):
    """The pipelined sensors of one scene, whose renders must end before the scene changes."""

    def wait(self) -> None:
        """Waits for all sensors' pictures. Raises the first error after the others have ended; then wait() may be
        called again."""
        errors: list[Exception] = []
        for sensor in self:
            try:
                sensor.wait()
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]


def expose_each(picture: Picture, auto: AutoExposure, inputs: EngineInputs) -> None:
    """Multiplies each sensor's infrared pair, in place, by its light_share and, unless exposure is fixed, to the
    exposure that it chooses. inputs: the engines' inputs, equal for all sensors."""
    link, shares = picture.link, picture.light_share
    if auto.mode == "fixed" and bool((shares == 1.0).all()):
        return
    light = shares.astype(np.float32)
    if auto.mode != "fixed":
        light *= auto.settled_light(inputs.left.signal, link.images(link.count), inputs.max_dn)
    link.brighten(light)
    if picture.taken is not None and picture.taken.is_laser_apart:
        link.laser().brighten(light)
