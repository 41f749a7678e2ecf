# SPDX-License-Identifier: Apache-2.0
"""Mounts of sensors: a scene with one pose for a sensor, or many for a batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.pose import Pose, PoseLike, PosesLike, as_matrix, host_array, pose_fault, pose_matrices
from activestereo.scene_io.scene_files import load_scene_file

# The error's text names at most this many broken poses; the error object lists all environments.
_MOST_NAMED = 8


class HasPose(Protocol):
    """An object with a scene and a pose in it, which one sensor follows: a Mount, or the result of MujocoScene.mount()
    of activestereo.integrations.mujoco."""

    @property
    def scene(self) -> kuafu.Scene: ...

    @property
    def pose(self) -> PoseLike: ...


@dataclass(eq=False)
class Mount:
    """A scene and a pose in it that a sensor follows, as it follows an entity in SAPIEN."""

    scene: kuafu.Scene
    pose: PoseLike = field(default_factory=Pose)

    def __post_init__(self) -> None:
        """Raises TypeError unless there are a scene and a pose."""
        if not isinstance(self.scene, kuafu.Scene):
            raise TypeError(f"a Mount's scene must be a kuafu.Scene, not {type(self.scene).__name__}")
        if self.pose is None:
            raise TypeError("a Mount's pose is None: leave it out for the origin, or give a Pose or a 4x4 matrix")


class RigPlace:
    """Computes a sensor's pose in the scene from its mount's pose and `local`, the sensor's pose relative to the
    mount."""

    def __init__(self, mount: HasPose, local: Pose) -> None:
        self._mount, self.local = mount, local
        self._parts, self._matrix = b"", np.eye(4)

    def pose(self) -> Pose:
        """Returns the sensor's pose in the scene. Raises ValueError if the mount has no valid pose."""
        return Pose(as_matrix(self._mount.pose) @ as_matrix(self.local))

    def matrix(self) -> NDArray[np.float64]:
        """Returns pose() as a read-only 4x4. It is cached until the mount or the local pose moves, because its checks
        are slow."""
        mount, local = as_matrix(self._mount.pose), as_matrix(self.local)
        parts = mount.tobytes() + local.tobytes()
        if parts != self._parts:
            matrix = as_matrix(Pose(mount @ local))
            matrix.flags.writeable = False
            self._parts, self._matrix = parts, matrix
        return self._matrix


def as_mount(scene_or_mount: kuafu.Scene | HasPose | str | PathLike[str], device: str | int | kuafu.Device) -> HasPose:
    """Returns a mount: a new one for a scene or for a scene file, which it loads on `device`, or the given object if it
    has a scene. Takes every file that load_scene_file knows; a USD stage's dome light becomes the environment."""
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


class SensorPoseError(ValueError):
    """A mount of a batch has no valid pose. All pictures are taken; sensors on this mount take theirs from their last
    valid pose."""

    def __init__(self, text: str, environments: list[int]) -> None:
        super().__init__(text)
        self.environments = environments  # all environments whose mounts have no pose
        self.environment = environments[0]


class HasPoses(Protocol):
    """Mounts of a batch: Mounts, or the result of activestereo.integrations.mujoco's mount()."""

    @property
    def scene(self) -> kuafu.Scene: ...

    @property
    def poses(self) -> PosesLike: ...


@dataclass(eq=False)
class Mounts:
    """A scene and the poses in it that a batch of sensors follows: [E, 7] or [E, 4, 4], one sensor for each
    environment, or [E, S, 7] or [E, S, 4, 4]; NumPy, torch or DLPack. Assign `poses` to move the sensors."""

    scene: kuafu.Scene
    poses: PosesLike


class Places:
    """Keeps the last valid poses of a batch's mounts, and computes the RGB cameras' poses from them. pose: 4x4, the RGB
    camera relative to its mount."""

    def __init__(self, mounts: HasPoses, pose: NDArray[np.float64]) -> None:
        if not isinstance(getattr(mounts, "scene", None), kuafu.Scene):
            raise TypeError(f"a batch needs Mounts, or others with a scene and poses, not {type(mounts).__name__}")
        self._mounts, self._pose = mounts, pose
        poses = pose_matrices(host_array(mounts.poses), "poses of sensors")
        self.shape = poses.shape[:-2]
        if len(self.shape) not in (1, 2) or not poses.size:
            raise ValueError(f"poses of sensors are [E] or [E, S] times 7 or 4x4, given {list(poses.shape)}")
        self.matrices = np.broadcast_to(np.eye(4), (int(np.prod(self.shape)), 4, 4)).copy()

    def read(self) -> NDArray[np.bool_]:
        """Reads the mounts' poses. Returns a mask [sensors], true where a mount has no valid pose; such a sensor keeps
        its last valid pose."""
        poses = pose_matrices(host_array(self._mounts.poses), "poses of sensors")
        if poses.shape[:-2] != self.shape:
            raise ValueError(f"this batch is of {self.shape} sensors; the poses are of {poses.shape[:-2]}")
        poses = poses.reshape(-1, 4, 4)
        broken = pose_fault(poses)
        self.matrices[~broken] = poses[~broken]
        return broken

    def rigs(self) -> NDArray[np.float64]:
        """Returns the last valid poses of the RGB cameras, [sensors, 4, 4], body axes (x forward, y left, z up)."""
        return self.matrices @ self._pose


def raise_broken(broken: NDArray[np.bool_], shape: tuple[int, ...]) -> None:
    """Raises SensorPoseError if any sensor of a batch has no pose. broken: mask [sensors]; shape: the batch's, (E,) or
    (E, S)."""
    if broken.any():
        places = np.argwhere(broken.reshape(shape))
        named = "; environment ".join(", sensor ".join(map(str, place)) for place in places[:_MOST_NAMED].tolist())
        named += f" and {len(places) - _MOST_NAMED} more" if len(places) > _MOST_NAMED else ""
        text = f"environment {named}: the mount's pose is not a finite rigid one; {len(places)} of {broken.size}"
        bad = np.unique(places[:, 0]).tolist()
        raise SensorPoseError(f"{text} sensors took their picture from their last place", bad)


def raise_faults(name: str, environments: NDArray[np.intp], faults: Sequence[str | None]) -> None:
    """Raises ValueError with all faults, if there are any. faults: a text for each sensor, None: no fault.
    environments: each sensor's environment. name: the faulty quantity."""
    bad = [f"environment {at} {fault}" for at, fault in zip(environments, faults, strict=True) if fault is not None]
    if bad:
        more = f" and {len(bad) - _MOST_NAMED} more" if len(bad) > _MOST_NAMED else ""
        raise ValueError(f"{name} of {'; '.join(bad[:_MOST_NAMED])}{more}")
