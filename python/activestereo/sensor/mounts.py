# SPDX-License-Identifier: Apache-2.0
"""Where the sensors of a batch stand: a scene, and poses in it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.pose_arrays import PosesLike

# Of a batch's broken poses, so many are named in the error's text; the error has all their environments.
_MOST_NAMED = 8


class SensorPoseError(ValueError):
    """A sensor's pose is none. The pictures of the other environments are taken; this one's are from its last place."""

    def __init__(self, text: str, environments: list[int]) -> None:
        super().__init__(text)
        self.environments = environments  # all whose mounts have no pose
        self.environment = environments[0]


class HasPoses(Protocol):
    """Where a batch stands, as Mounts or activestereo.integrations.mujoco's mount()."""

    @property
    def scene(self) -> kuafu.Scene: ...

    @property
    def poses(self) -> PosesLike: ...


class Mounts:
    """A scene and the poses in it that a batch of sensors moves along with: [E, 7] or [E, 4, 4], one sensor for each
    environment, or [E, S, 7] or [E, S, 4, 4]; of NumPy, torch or DLPack. Assign `poses` to move them."""

    def __init__(self, scene: kuafu.Scene, poses: PosesLike) -> None:
        self.scene = scene
        self.poses = poses


def raise_broken(broken: NDArray[np.intp], shape: tuple[int, ...], first: int) -> None:
    """SensorPoseError where sensors, by their numbers in a batch of this shape whose environments begin with `first`,
    have no pose."""
    if broken.size:
        places = np.stack(np.unravel_index(broken, shape), axis=1)
        places[:, 0] += first
        named = "; environment ".join(", sensor ".join(map(str, place)) for place in places[:_MOST_NAMED].tolist())
        named += f" and {broken.size - _MOST_NAMED} more" if broken.size > _MOST_NAMED else ""
        text = f"environment {named}: the mount's pose is not a finite rigid one; {broken.size} of {np.prod(shape)}"
        bad = np.unique(places[:, 0]).tolist()
        raise SensorPoseError(f"{text} sensors took their picture from their last place", bad)


def own_numbers(environments: range | None, count: int) -> range:
    """Of the environments of a batch, among `count` that there are."""
    numbers = range(count) if environments is None else environments
    if not (numbers.step == 1 and 0 <= numbers.start < numbers.stop <= count):
        raise ValueError(f"environments of a batch are a range inside of 0 to {count - 1}, not {numbers}")
    return numbers
