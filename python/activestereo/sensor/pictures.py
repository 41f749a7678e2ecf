# SPDX-License-Identifier: Apache-2.0
"""Pictures in their own memory, renders that were submitted and have not been waited for, and the pipelined sensors
that a scene's changes wait for."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.auto_exposure import Setting
from activestereo.sensor.ir_link import IrLink
from activestereo.sensor.picture_memory import PictureMemory


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


class BeginsPictures(Protocol):
    """A pipelined sensor."""

    def wait(self) -> None: ...


class PipelinedSensors:
    """The pipelined sensors of one scene. Their pictures end before it changes."""

    def __init__(self) -> None:
        self._sensors: weakref.WeakSet[BeginsPictures] = weakref.WeakSet()

    def add(self, sensor: BeginsPictures) -> None:
        self._sensors.add(sensor)

    def wait(self) -> None:
        """Waits for all pictures. Raises a failed picture's error after the others have ended; the next wait() goes
        on."""
        errors: list[Exception] = []
        for sensor in self._sensors:
            try:
                sensor.wait()
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]
