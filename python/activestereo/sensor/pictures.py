# SPDX-License-Identifier: Apache-2.0
"""Holds the images of sensors' pictures. kuafu passes the infrared pair to simsense in shared memory, without a copy.

kuafu exports the buffer once: as an opaque file descriptor if both devices can (GPUs, lavapipe), else as a host
pointer. simsense imports it. A discrete GPU keeps the pair in its own memory and copies it for the host on request;
host-visible memory would move every pixel over the bus twice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

import kuafu
import simsense
from activestereo.camera.auto_exposure import AutoExposure, Setting
from activestereo.common.computed_once import computed_once
from activestereo.effects.core.engine import EngineInputs
from activestereo.sensor.cuda_memory import CudaArray, CudaMemory

_CACHED_BYTES = 1 << 22


def shared_memory_kind(renderer_device: kuafu.Device, engine_device: simsense.Device) -> Literal["host", "opaque_fd"]:
    """Returns 'opaque_fd' if both devices are one physical device and can share file descriptors, else 'host'."""
    a, b = renderer_device.info, engine_device.info
    fd = "export_opaque_fd" in a.capabilities and "import_opaque_fd" in b.capabilities
    same = (a.device_uuid, a.driver_uuid) == (b.device_uuid, b.driver_uuid)
    return "opaque_fd" if fd and same else "host"


def has_own_memory(device: kuafu.Device) -> bool:
    """Returns whether the device is a discrete GPU, whose memory the host reaches over a bus."""
    return device.info.kind == "discrete gpu"


class IrLink:
    """Holds the infrared radiance images that kuafu renders into `target` and simsense reads as `left` and `right`.
    Each side is float32 [height, width]; for a count of sensors above 1 it is [count, height, width]."""

    def __init__(
        self, renderer_device: kuafu.Device, engine_device: simsense.Device, width: int, height: int,
        count: int = 1,
    ) -> None:  # fmt: skip
        self._beside = partial(IrLink, renderer_device, engine_device, width, height, count)
        self._size, self._image_bytes, self.count = (height, width), 4 * height * width, count
        shape = (2 * count, height, width, 1)
        size_bytes = 4 * int(np.prod(shape))
        self.memory = shared_memory_kind(renderer_device, engine_device)
        is_shared_fd = self.memory == "opaque_fd"
        self._is_on_gpu = is_shared_fd and has_own_memory(renderer_device)
        self._source = kuafu.Buffer(
            renderer_device, size_bytes, exportable=is_shared_fd, host_visible=not self._is_on_gpu
        )
        self.target = self._source.image(np.float32, shape)
        with self._source.export(self.memory) as desc:
            self._sink = simsense.Buffer.import_(engine_device, desc)
        side_shape = (height, width) if count == 1 else (count, height, width)
        self.left, self.right = (self._sink.image(np.float32, side_shape, side * size_bytes // 2) for side in (0, 1))

    @computed_once
    def laser(self) -> IrLink:
        """Returns a second link for images of the projector's light alone; it is made on first use."""
        return self._beside()

    def lasers(self, is_laser_apart: bool) -> dict[str, simsense.Image]:
        """Returns simsense.Engine.compute()'s arguments for the projector's light, which has speckle. Without
        is_laser_apart it is {}: then all light has speckle."""
        return {"left_laser": self.laser().left, "right_laser": self.laser().right} if is_laser_apart else {}

    def images(self, count: int | None = None, first: int = 0) -> np.ndarray:
        """Returns `count` images from number `first` on (None: all) as kuafu wrote them, float32 [count, height,
        width], all left ones first. They are a view, or a copy of a GPU's own memory, which put() writes back."""
        count = 2 * self.count if count is None else count
        if self._is_on_gpu:
            read = self._source.read(count * self._image_bytes, first * self._image_bytes)
            return read.view(np.float32).reshape(count, *self._size)
        return self.target.array()[first : first + count, ..., 0]

    def put(self, images: np.ndarray) -> None:
        """Writes images from images() back to a GPU's own memory; does nothing where images() is a view."""
        if self._is_on_gpu:
            self._source.write(images)

    def brighten(self, factors: np.ndarray) -> None:
        """Multiplies both images of each pair by the pair's factor, float32 [count]. Images in a GPU's own memory are
        changed in pieces that fit into the processor's cache."""
        for_views = np.tile(factors, 2)[:, None, None]
        at_once = max(1, _CACHED_BYTES // self._image_bytes) if self._is_on_gpu else len(for_views)
        for first in range(0, len(for_views), at_once):
            part = for_views[first : first + at_once]
            images = self.images(len(part), first)
            images *= part
            if self._is_on_gpu:
                self._source.write(images, first * self._image_bytes)


Pair = tuple[NDArray[np.float32], NDArray[np.float32]]


def checked_radiance(
    left: ArrayLike, right: ArrayLike, left_laser: ArrayLike | None, right_laser: ArrayLike | None,
    shape: tuple[int, ...],
) -> tuple[Pair, dict[str, NDArray[np.float32]]]:  # fmt: skip
    """Returns ((left, right), keyword arguments of simsense.Engine.compute for the laser's part), float32 arrays of
    this shape. Raises ValueError, with the image, the pixel and the value, for negative or non-finite radiance."""
    if (left_laser is None) != (right_laser is None):
        raise ValueError("left_laser and right_laser come together, or not at all: then all light has speckle")
    pair = _checked("left", left, shape), _checked("right", right, shape)
    if left_laser is None or right_laser is None:
        return pair, {}
    lasers = ("left_laser", left_laser), ("right_laser", right_laser)
    return pair, {name: _checked(name, image, shape) for name, image in lasers}


def _checked(name: str, image: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float32]:
    values = np.ascontiguousarray(image, np.float32)
    if values.shape != shape:
        raise ValueError(f"{name} is {list(values.shape)}, expected {list(shape)} of W/(sr m^2)")
    is_light = np.isfinite(values) & (values >= 0.0)
    if not is_light.all():
        place = np.unravel_index(int(np.argmin(is_light)), shape)
        where = ", ".join(str(int(i)) for i in place)
        raise ValueError(f"{name}[{where}] is {values[place]}, expected a radiance of 0 or more")
    return values


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
    output is read once, a GPU writes it directly to host memory, which saves a copy. `radiance` stays on the GPU,
    because the GPU itself reads it.

    outputs: {kuafu's name: (dtype, channels)}. host_visible: None = only on a CPU device. on_cuda: CUDA can access the
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

    taken: None if there is no picture. has_rgb: the memory holds its RGB images. setting:
    exposure and gain. signals: the imagers' parameters, left and right, with exposure and gain."""

    link: IrLink
    rgb: PictureMemory
    taken: Taken | None = None
    has_rgb: bool = False
    setting: Setting | None = None
    signals: list[dict[str, float]] = field(default_factory=list)


def expose_each(
    link: IrLink, shares: NDArray[np.float64], is_laser_apart: bool, auto: AutoExposure, inputs: EngineInputs
) -> None:
    """Multiplies each sensor's infrared pair, in place, by its share and, unless exposure is fixed, by the factor of
    its automatic exposure. shares: [sensors]. inputs: the engines' inputs, equal for all sensors."""
    if auto.mode == "fixed" and bool((shares == 1.0).all()):
        return
    light = shares.astype(np.float32)
    if auto.mode != "fixed":
        light *= auto.settled_light(inputs.left.signal, link.images(link.count), inputs.max_dn)
    link.brighten(light)
    if is_laser_apart:
        link.laser().brighten(light)


def dn_per_radiance(signal: Mapping[str, float]) -> float:
    """Returns the counts that a linear imager without noise gives for a radiance of 1 W/(sr m^2), above black."""
    return signal["responsivity_e"] * signal["exposure_s"] * signal["conversion_gain_dn_per_e"] * signal["gain"]
