# SPDX-License-Identifier: Apache-2.0
"""A StereoDepthSensor with a latency of one picture: the next one is rendered while this one is matched and read.

    sensor = PipelinedStereoDepthSensor(config, scene)
    for _ in range(steps):
        simulate()
        sensor.wait()          # the scene may not change while a picture is rendered
        move_things(scene)
        sensor.take_picture()  # begins the picture of what there is now
        if sensor.has_picture:
            sensor.compute_depth()  # of the picture before, as are all results
            act_on(sensor.get_depth())

Pictures and depth have the bits that StereoDepthSensor gives, one take_picture() later.
"""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import kuafu
from activestereo.camera.auto_exposure import Setting
from activestereo.camera.matching import Taken
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.progress_bar import Progress
from activestereo.sensor.ir_link import IrLink
from activestereo.sensor.pipelined_pictures import UnderWay
from activestereo.sensor.sensor import StereoDepthSensor


class PipelinedStereoDepthSensor(StereoDepthSensor):
    """Arguments as StereoDepthSensor's. kuafu.Error, that work is under way, where the scene is changed between
    take_picture() and wait(). ValueError for a model whose effects act outside of the engines: those take each picture
    through the host, which leaves nothing to overlap."""

    def __init__(self, config: StereoDepthSensorConfig, *args: Any, **options: Any) -> None:
        self._under_way = UnderWay()
        super().__init__(config, *args, **options)
        if self._image_effects:
            names = ", ".join(self._image_effects.names)
            self.close()
            raise ValueError(f"no engine field expresses {names}: such a model needs StereoDepthSensor")
        width, height = self._config.ir_resolution
        self._next_link = IrLink(
            self._device, self._engine.device, width, height, copy=bool(options.get("copy_ir", False))
        )
        self._next_rgb = self._results.rgb_memory()
        self._next: Taken | None = None
        self._taken_signals = self._next_signals = super()._signals()
        self._taken_exposure = self._present_exposure()
        weakref.finalize(self, self._under_way.let_end).atexit = False  # before the projector leaves the scene

    @property
    def has_picture(self) -> bool:
        """Whether results are there: from the second take_picture() on."""
        return self._results.has_picture

    def take_picture(self, infrared_only: bool = False, progress: Progress | None = None) -> None:
        """Begins a picture of the scene as it is now, and makes the one before it the one that results are of. Takes no
        progress. A picture that failed raises here or in wait(), and is none."""
        if progress is not None:
            raise ValueError("a picture that is rendered in the background has no progress")
        self.wait()
        self._turn()
        taken = self._prepare(self._frame + 1)
        self._place_projector()
        begin = self._renderer.submit
        try:
            if not infrared_only:
                self._next_rgb.forget()
                rgb = self._render([self.rgb_camera()], self._next_rgb.targets, "visible", taken.frame, None, run=begin)
                self._under_way.add("rgb", rgb)
            self._under_way.add("ir", self._render_infrared(taken, self._next_link, None, begin))
        except BaseException:
            self._under_way.let_end()
            self._darken()
            raise
        self._next, self._next_has_rgb = taken, not infrared_only

    def wait(self) -> None:
        """Until the picture that was begun is rendered: then the scene may change. Results stay those of the picture
        before."""
        if not self._under_way:
            return
        try:
            try:
                self._under_way.wait(lambda group: self._keep_times(group, self._renderer))
            finally:
                if not self._under_way:
                    self._darken()
            self._next_link.deliver()
            self._expose(self._next_link)
        except kuafu.Error:
            self._next = None
            raise
        self._next_signals = super()._signals()

    # ---- what would change the scene or the engines ----

    def get_picture(self, name: str, camera: str = "rgb") -> np.ndarray:
        self.wait()
        return super().get_picture(name, camera)

    def set_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        self.wait()
        super().set_velocity(linear, angular)

    def close(self) -> None:
        self._under_way.let_end()
        super().close()

    # ---- inside ----

    def _turn(self) -> None:
        """What was rendered is the picture now; the one before gives its memory to the next."""
        if self._next is None:
            return
        results = self._results
        results.maps.clear()
        self._link, self._next_link = self._next_link, self._link
        if self._next_has_rgb:
            results.rgb, self._next_rgb = self._next_rgb, results.rgb
            results.has_rgb = True
        self._taken, self._taken_signals, self._next = self._next, self._next_signals, None
        self._taken_exposure = self._present_exposure()
        self._frame, results.has_picture = self._taken.frame, True

    def _present_exposure(self) -> Setting:
        """Between wait() and the next picture's _prepare(): that of the picture that was rendered last."""
        return Setting(self._config.ir_camera_exposure, self._config.ir_camera_gain)

    def _changed(self, **changes: Any) -> StereoDepthSensorConfig:
        self.wait()  # which may bring another exposure
        return super()._changed(**changes)

    def _apply(self, config: StereoDepthSensorConfig, parameters: dict[str, Any]) -> None:
        """What has changed, noise too, holds for both pictures that there are, each under its own exposure."""
        super()._apply(config, parameters)
        present, following = self._present_exposure(), self._next_setting
        self._set_exposure(self._taken_exposure)
        self._taken_signals = super()._signals()
        self._set_exposure(present)
        self._next_signals = super()._signals()
        self._next_setting = following

    def _darken(self) -> None:
        if not self._config.projector_always_on:
            self._world.darken()

    def _signals(self) -> list[dict[str, float]]:
        return self._taken_signals

    def _match(self, names: Any) -> dict[str, np.ndarray]:
        self._engine.set_signal(*self._taken_signals)  # the next picture's exposure may be another
        return super()._match(names)

    def _match_rest(self) -> None:
        self.wait()
        super()._match_rest()
