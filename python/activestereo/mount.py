# SPDX-License-Identifier: Apache-2.0
"""Where a sensor stands: a scene, and a pose in it."""

from __future__ import annotations

from os import PathLike
from typing import Protocol

import kuafu
from activestereo.pose import Pose, PoseLike


class HasPose(Protocol):
    """Where a sensor stands, as a Mount or activestereo.mujoco's mount()."""

    @property
    def scene(self) -> kuafu.Scene: ...

    @property
    def pose(self) -> PoseLike: ...


class Mount:
    """A scene and a pose in it that sensors move along with, as an entity does in SAPIEN."""

    def __init__(self, scene: kuafu.Scene, pose: PoseLike | None = None) -> None:
        self.scene = scene
        self.pose: PoseLike = Pose() if pose is None else pose


def as_mount(
    scene_or_mount: kuafu.Scene | HasPose | str | PathLike[str], device: str | int | kuafu.Device
) -> HasPose:
    """A Mount, or another object with a scene and a pose, of that, of a scene, or of a scene file on a device."""
    if isinstance(scene_or_mount, kuafu.Scene):
        return Mount(scene_or_mount)
    if isinstance(scene_or_mount, (str, PathLike)):
        scene = kuafu.Scene(device if isinstance(device, kuafu.Device) else kuafu.Device(device))
        scene.load(scene_or_mount)
        return Mount(scene)
    if isinstance(getattr(scene_or_mount, "scene", None), kuafu.Scene):
        return scene_or_mount
    kind = type(scene_or_mount).__name__
    raise TypeError(f"a sensor needs a kuafu.Scene, a Mount or the path of a scene file, not {kind}")
