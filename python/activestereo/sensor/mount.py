# SPDX-License-Identifier: Apache-2.0
"""Where a sensor stands: a scene, and a pose in it."""

from __future__ import annotations

from os import PathLike
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.pose import Pose, PoseLike, as_matrix
from activestereo.scene_io.scene_files import load_scene_file


class HasPose(Protocol):
    """Where a sensor stands, as a Mount or activestereo.integrations.mujoco's mount()."""

    @property
    def scene(self) -> kuafu.Scene: ...

    @property
    def pose(self) -> PoseLike: ...


class Mount:
    """A scene and a pose in it that sensors move along with, as an entity does in SAPIEN."""

    def __init__(self, scene: kuafu.Scene, pose: PoseLike | None = None) -> None:
        self.scene = scene
        self.pose: PoseLike = Pose() if pose is None else pose


class RigPlace:
    """Where a sensor is that stands at the pose `local` of its mount."""

    def __init__(self, mount: HasPose, local: Pose) -> None:
        self._mount, self.local = mount, local
        self._parts, self._matrix = b"", np.eye(4)

    def pose(self) -> Pose:
        """In the scene. ValueError where the mount has none."""
        return Pose(as_matrix(self._mount.pose) @ as_matrix(self.local))

    def matrix(self) -> NDArray[np.float64]:
        """4x4 of pose(), read-only; kept until one of the two moves, for the checks take longer than the rest."""
        mount, local = as_matrix(self._mount.pose), as_matrix(self.local)
        parts = mount.tobytes() + local.tobytes()
        if parts != self._parts:
            matrix = as_matrix(Pose(mount @ local))
            matrix.flags.writeable = False
            self._parts, self._matrix = parts, matrix
        return self._matrix


def as_mount(
    scene_or_mount: kuafu.Scene | HasPose | str | PathLike[str], device: str | int | kuafu.Device
) -> HasPose:
    """A Mount, or another object with a scene and a pose, of that, of a scene, or of a scene file on a device (any that
    load_scene_file knows; a USD stage's dome light is the environment)."""
    if isinstance(scene_or_mount, kuafu.Scene):
        return Mount(scene_or_mount)
    if isinstance(scene_or_mount, (str, PathLike)):
        scene = kuafu.Scene(device if isinstance(device, kuafu.Device) else kuafu.Device(device))
        ambient = load_scene_file(scene, scene_or_mount)
        if ambient is not None:
            scene.set_environment(ambient)
        return Mount(scene)
    if isinstance(getattr(scene_or_mount, "scene", None), kuafu.Scene):
        return scene_or_mount
    kind = type(scene_or_mount).__name__
    raise TypeError(f"a sensor needs a kuafu.Scene, a Mount or the path of a scene file, not {kind}")
