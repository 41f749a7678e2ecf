# SPDX-License-Identifier: Apache-2.0
"""The infrared pair's way from kuafu to simsense: one memory that both libraries address, so that no frame is copied.

kuafu exports the buffer once, as an opaque file descriptor where both devices can (GPUs, lavapipe), else as a host
pointer; simsense imports it. With copy=True each library has its own buffer and every frame is copied, which is slower
and shows what the sharing saves.
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import Literal

import numpy as np

import kuafu
import simsense


def shared_memory_kind(renderer_device: kuafu.Device, engine_device: simsense.Device) -> Literal["host", "opaque_fd"]:
    """'opaque_fd' where both devices share file descriptors and are the same physical device, else 'host'."""
    a, b = renderer_device.info, engine_device.info
    fd = "export_opaque_fd" in a.capabilities and "import_opaque_fd" in b.capabilities
    same = (a.device_uuid, a.driver_uuid) == (b.device_uuid, b.driver_uuid)
    return "opaque_fd" if fd and same else "host"


class IrLink:
    """Two float32 images [height, width], left then right: kuafu renders into `target`, simsense reads `left` and
    `right`. With a count above 1 each of the two is [count, height, width]."""

    def __init__(
        self,
        renderer_device: kuafu.Device,
        engine_device: simsense.Device,
        width: int,
        height: int,
        copy: bool = False,
        count: int = 1,
    ) -> None:
        self._beside = partial(IrLink, renderer_device, engine_device, width, height, copy, count)
        shape = (2 * count, height, width, 1)
        size_bytes = 4 * int(np.prod(shape))
        shared = shared_memory_kind(renderer_device, engine_device)
        self.memory = "copy" if copy else shared
        self._source = kuafu.Buffer(renderer_device, size_bytes, exportable=self.memory == "opaque_fd")
        self.target = self._source.image(np.float32, shape)
        if copy:
            self._sink = simsense.Buffer(engine_device, size_bytes)
        else:
            with self._source.export(shared) as desc:
                self._sink = simsense.Buffer.import_(engine_device, desc)
        eye_shape = (height, width) if count == 1 else (count, height, width)
        self.left, self.right = (self._sink.image(np.float32, eye_shape, eye * size_bytes // 2) for eye in (0, 1))

    @cached_property
    def laser(self) -> IrLink:
        """A second pair of memory beside this one, for the part of the light that is the laser's; made when it is first
        asked for."""
        return self._beside()

    def targets(self, is_laser_apart: bool) -> dict[str, kuafu.Image]:
        """What a render fills, by kuafu's name of the output."""
        return {"radiance": self.target} | ({"projector": self.laser.target} if is_laser_apart else {})

    def lasers(self, is_laser_apart: bool) -> dict[str, simsense.Image]:
        """The depth engine's keyword arguments for the laser's part; none where all light has speckle."""
        return {"left_laser": self.laser.left, "right_laser": self.laser.right} if is_laser_apart else {}

    @property
    def images(self) -> np.ndarray:
        """The pairs as kuafu wrote them, float32 [2 * count, height, width], left ones first; a view."""
        return self.target.array()[..., 0]

    def deliver(self) -> None:
        """After a render: makes `left` and `right` current. Costs nothing unless the link copies."""
        if self.memory == "copy":
            self._sink.write(self._source.read())
            if "laser" in self.__dict__:
                self.laser.deliver()
