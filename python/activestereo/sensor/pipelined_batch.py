# SPDX-License-Identifier: Apache-2.0
"""A StereoDepthSensorBatch with a latency of one picture: the next pictures are rendered while these are matched.

Used as PipelinedStereoDepthSensor is: wait() before the scene changes, take_picture() begins, results are of the
picture before. Pictures and depth have the bits that StereoDepthSensorBatch gives, one take_picture() later.
"""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.matching import Taken
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.sensor.batch import HasPoses, StereoDepthSensorBatch
from activestereo.sensor.ir_link import IrLink
from activestereo.sensor.picture_memory import RGB_OUTPUTS, PictureMemory
from activestereo.sensor.pipelined_pictures import UnderWay


class PipelinedStereoDepthSensorBatch(StereoDepthSensorBatch):
    """Arguments as StereoDepthSensorBatch's. kuafu.Error, that work is under way, where the scene is changed between
    take_picture() and wait()."""

    def __init__(self, config: StereoDepthSensorConfig, mounts: HasPoses, *args: Any, **options: Any) -> None:
        super().__init__(config, mounts, *args, **options)
        device = self._scene.device
        width, height = self._config.ir_resolution
        self._next_link = IrLink(device, self._engine.device, width, height, count=self._count)
        rgb_width, rgb_height = self._config.rgb_resolution
        shape = (self._count, rgb_height, rgb_width)
        self._next_rgb = PictureMemory(device, shape, RGB_OUTPUTS, on_cuda=self._on_cuda)
        self._under_way = UnderWay()
        self._next: Taken | None = None
        weakref.finalize(self, self._under_way.let_end).atexit = False

    @property
    def has_picture(self) -> bool:
        """Whether results are there: from the second take_picture() on."""
        return self._has_picture

    @property
    def has_next(self) -> bool:
        """Whether pictures were begun, and have not failed, that the next take_picture() makes the present ones."""
        return self._next is not None

    def take_picture(self, infrared_only: bool = False) -> None:
        """Begins pictures of the scene as it is now, and makes those before them the ones that results are of. Raises
        SensorPoseError, after the others' are begun, where a mount's pose is none. Pictures that failed raise here or
        in wait(), and are none."""
        self.wait()
        self._turn()
        broken = self._place()
        taken = self._prepare()
        begin = self._renderer.submit
        try:
            if not infrared_only:
                self._under_way.add("rgb", self._render_rgb(taken, self._next_rgb, begin))
            self._under_way.add("ir", self._render_infrared(taken, self._next_link, begin))
        except BaseException:
            self._under_way.let_end()
            self._darken()
            raise
        self._next, self._next_has_rgb, self._next_light_share = taken, not infrared_only, self._light_share.copy()
        self._tell(broken)

    def wait(self) -> None:
        """Until the pictures that were begun are rendered: then the scene may change. Results stay those of the ones
        before."""
        if not self._under_way:
            return
        try:
            try:
                self._under_way.wait()
            finally:
                if not self._under_way:
                    self._darken()
            assert self._next is not None
            self._expose(self._next, self._next_link, self._next_light_share)
        except kuafu.Error:
            self._next = None
            raise

    def render_true_depth(self) -> NDArray[np.float32]:
        self.wait()
        return super().render_true_depth()

    def restart(self, seed: int) -> None:
        self.wait()
        self._next = None
        super().restart(seed)

    def close(self) -> None:
        self._under_way.let_end()
        super().close()

    def _turn(self) -> None:
        """What was rendered are the pictures now; those before give their memory to the next."""
        if self._next is None:
            return
        self._forget_maps()
        self._link, self._next_link = self._next_link, self._link
        self._rgb, self._next_rgb = self._next_rgb, self._rgb
        self._taken, self._next = self._next, None
        self._frame, self._has_picture, self._has_rgb = self._taken.frame, True, self._next_has_rgb
