# SPDX-License-Identifier: Apache-2.0
"""Rigid poses as in SAPIEN, and their conversion to camera axes. SAPIEN's body axes: x forward, y left, z up. Camera
axes (kuafu, simsense, OpenCV): x right, y down, z forward. Only this file converts between them. Arrays of poses have a
simulator's format: [..., 4, 4], or [..., 7] with x, y, z and the unit quaternion w, x, y, z (the order of SAPIEN and
MuJoCo)."""

from __future__ import annotations

from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

CAMERA_TO_BODY = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
CAMERA_TO_BODY.setflags(write=False)

# Poses are printed with about nine digits; a rotation further off than this is a mistake, not rounding.
_ROTATION_TOLERANCE = 1e-4
# Other programs print as few as four digits.
_PRINTED_TOLERANCE = 1e-3


class HasMatrix(Protocol):
    """Type of another library's pose with to_transformation_matrix(), such as sapien.Pose."""

    def to_transformation_matrix(self) -> NDArray[Any]: ...


class Pose:
    """A rigid motion as sapien.Pose: position p in metres and unit quaternion q = (w, x, y, z). p may also be a rigid
    4x4 matrix. a * b applies b first."""

    def __init__(self, p: ArrayLike = (0.0, 0.0, 0.0), q: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> None:
        matrix = np.asarray(p, dtype=np.float64)
        if matrix.shape == (4, 4):
            if (fault := rigid_fault(matrix)) is not None:
                raise ValueError(f"the matrix {fault}")
            p, q = matrix[:3, 3], _quaternion(matrix[:3, :3])
        self.p = np.array(p, dtype=np.float64)
        self.q = np.array(q, dtype=np.float64)
        norm, has_shapes = np.linalg.norm(self.q), (self.p.shape, self.q.shape) == ((3,), (4,))
        if not (has_shapes and np.isfinite(self.p).all() and 0.0 < norm < np.inf):
            needed = "a pose needs a position of 3 and a quaternion of 4 finite numbers, or a rigid 4x4 matrix"
            raise ValueError(f"{needed}; got {np.asarray(p)} and {np.asarray(q)}")
        self.q /= norm

    def to_transformation_matrix(self) -> NDArray[Any]:
        """Returns the 4x4 matrix from the body's to the parent's frame."""
        return rigid_motion(self.p, _rotation(self.q))

    def inv(self) -> Pose:
        return Pose(np.linalg.inv(self.to_transformation_matrix()))

    def __mul__(self, other: PoseLike) -> Pose:
        return Pose(self.to_transformation_matrix() @ as_matrix(other))

    def __repr__(self) -> str:
        return f"Pose({np.round(self.p, 6).tolist()}, {np.round(self.q, 6).tolist()})"


def rigid_motion(place: ArrayLike, rotation: ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1))) -> NDArray[Any]:
    """Returns the 4x4 matrix of a rigid motion. rotation: 3x3. place: the translation (3)."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation, place
    return out


# A Pose, another library's pose, or a 4x4 array.
PoseLike: TypeAlias = HasMatrix | ArrayLike


def as_matrix(pose: PoseLike) -> NDArray[Any]:
    """Returns the 4x4 matrix of a Pose, of another library's pose such as sapien.Pose, or of a rigid 4x4 array."""
    if hasattr(pose, "to_transformation_matrix"):
        return np.asarray(pose.to_transformation_matrix(), dtype=np.float64)
    return Pose(pose).to_transformation_matrix()


def camera_to_world(pose: PoseLike) -> NDArray[Any]:
    """Converts a camera's pose (body axes) to its 4x4 camera_to_world (camera axes)."""
    return as_matrix(pose) @ CAMERA_TO_BODY


def body_pose(camera_to_world: ArrayLike) -> Pose:
    """Converts a camera's 4x4 camera_to_world (camera axes) to its Pose (body axes)."""
    return Pose(np.asarray(camera_to_world, dtype=np.float64) @ CAMERA_TO_BODY.T)


def camera_to_camera(pose_a: PoseLike, pose_b: PoseLike) -> NDArray[Any]:
    """Returns the 4x4 a_to_b in camera axes of two cameras whose poses (body axes) are in one common frame."""
    return np.linalg.inv(camera_to_world(pose_b)) @ camera_to_world(pose_a)


def carried_twist(a_to_b: NDArray[Any], twist: ArrayLike) -> NDArray[Any]:
    """Converts the twist [v, w] (6, m/s and rad/s) of frame a to the twist of frame b, which is rigidly attached to a.
    Each twist is in its own frame's axes. This is the adjoint of a_to_b (Lynch and Park, Modern Robotics, 3.3.2). It is
    exact at any time, as pose(t) = pose(0) exp(t [v, w]) for both."""
    twist = np.asarray(twist, dtype=np.float64)
    rotation, offset = a_to_b[:3, :3], a_to_b[:3, 3]
    angular = rotation @ twist[3:]
    return np.concatenate([rotation @ twist[:3] + np.cross(offset, angular), angular])


def motion_of_twist(twist: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the rigid motion exp([v, w]), 4x4, of a twist (6: metres, radians)."""
    from scipy.linalg import expm  # which takes longer to import than most commands take

    v, w = twist[:3], twist[3:]
    return np.asarray(expm(np.array(
        [[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]]
    )))  # fmt: skip


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike) -> NDArray[Any]:
    """Returns the 4x4 camera_to_world (camera axes) of a camera at `eye` that looks at `target`, with `up` upwards in
    the image. The three vectors are in the world's axes. Raises ValueError if they span no plane."""
    eye, target, up = (np.asarray(v, dtype=np.float64) for v in (eye, target, up))
    least = 1e-12 * np.linalg.norm(target - eye) * np.linalg.norm(up)
    if not np.linalg.norm(np.cross(target - eye, up)) > least:
        raise ValueError(f"no view from {eye} at {target} has {up} upwards: move the target, or give another up")
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return rigid_motion(eye, np.stack([right, np.cross(forward, right), forward], axis=1))


def rigid_fault(pose: NDArray[Any], tolerance: float = _ROTATION_TOLERANCE) -> str | None:
    """Returns None if the 4x4 is a rigid motion. Otherwise returns the fault as text that follows its name."""
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        return "is not a 4x4 of finite numbers"
    if np.abs(pose[3] - [0.0, 0.0, 0.0, 1.0]).max() > 1e-9:
        last = ", ".join(f"{value:g}" for value in pose[3])
        return f"is not a rigid motion: the last row of the row-major 4x4 is {last}, expected 0, 0, 0, 1"
    rotation = pose[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if not error <= tolerance:
        return f"is not a rigid motion: its 3x3 part is off a rotation by {error:.2g}"
    return "is not a rigid motion: its 3x3 part mirrors" if np.linalg.det(rotation) < 0 else None


def printed_motion(
    rotation: ArrayLike, translation: ArrayLike, name: str, last_row: ArrayLike = (0.0, 0.0, 0.0, 1.0)
) -> NDArray[Any]:
    """Returns the rigid [4, 4] nearest to a rotation (9 numbers, row by row) and a translation (3) that were rounded to
    few digits. last_row: of a 4x4, which must be 0, 0, 0, 1. Raises ValueError, which begins with `name`, if the
    numbers are no rigid motion."""
    pose = np.eye(4)
    try:
        pose[:3, :3] = np.asarray(rotation, dtype=np.float64).reshape(3, 3)
        pose[:3, 3] = np.asarray(translation, dtype=np.float64).reshape(3)
        pose[3] = np.asarray(last_row, dtype=np.float64).reshape(4)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: is not 9 numbers of a rotation and 3 of a translation") from None
    if (fault := rigid_fault(pose, _PRINTED_TOLERANCE)) is not None:
        raise ValueError(f"{name}: {fault}")
    left, _, right = np.linalg.svd(pose[:3, :3])
    return rigid_motion(pose[:3, 3], left @ right)


def _rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Computes rotation matrices [..., 3, 3] from unit quaternions [..., 4]."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _quaternion(rotation: NDArray[Any]) -> NDArray[Any]:
    """Computes the unit quaternion (w, x, y, z) of a 3x3 rotation: an eigenvector of Bar-Itzhack's symmetric matrix,
    accurate at every angle (J. Guidance 23(6), 2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    k = [
        [xx + yy + zz, zy - yz, xz - zx, yx - xy], [zy - yz, xx - yy - zz, yx + xy, xz + zx],
        [xz - zx, yx + xy, yy - xx - zz, zy + yz], [yx - xy, xz + zx, zy + yz, zz - xx - yy],
    ]  # fmt: skip
    q = np.linalg.eigh(k)[1][:, 3]
    return q if q[0] >= 0 else -q


class HasDlpack(Protocol):
    """Type of another library's array with __dlpack__(), such as torch's."""

    def __dlpack__(self, *args: Any, **kwargs: Any) -> Any: ...


PosesLike: TypeAlias = ArrayLike | HasDlpack

_RIGID = 1e-3  # float32 physics keeps its rotations to 1e-6; a scale or a shear is far beyond this


def host_array(values: Any, dtype: Any = np.float64) -> NDArray[Any]:
    """Converts NumPy arrays, torch tensors on any device, DLPack arrays or nested lists to a NumPy array in host
    memory. dtype: of the result; None keeps the input's."""
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    elif hasattr(values, "__dlpack__") and not isinstance(values, np.ndarray):
        values = np.from_dlpack(values)
    return np.asarray(values, dtype)


def pose_matrices(poses: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    """Converts poses [..., 7] or [..., 4, 4] to a new array [..., 4, 4]. Quaternions may have any length. Raises
    ValueError, which begins with `what`, for another shape."""
    if poses.shape[-2:] == (4, 4):
        return poses.copy()
    if poses.shape[-1:] != (7,):
        raise ValueError(f"{what}: a pose has 7 numbers (x, y, z, w, x, y, z) or 4x4, not the shape {poses.shape}")
    out = np.zeros((*poses.shape[:-1], 4, 4))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        out[..., :3, :3] = _rotation(poses[..., 3:] / np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True))
    out[..., :3, 3] = poses[..., :3]
    out[..., 3, 3] = 1.0
    return out


def pose_fault(matrices: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Returns a mask [...] of the matrices [..., 4, 4] that are not finite or no rigid motions."""
    rotation = matrices[..., :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        product = rotation @ np.swapaxes(rotation, -1, -2)
        is_turned = np.abs(product - np.eye(3)).max(axis=(-1, -2)) < _RIGID
        is_right_handed = (np.cross(rotation[..., 0], rotation[..., 1]) * rotation[..., 2]).sum(axis=-1) > 0.0
        has_last_row = (matrices[..., 3, :] == [0.0, 0.0, 0.0, 1.0]).all(axis=-1)
    return np.asarray(~(is_turned & is_right_handed & has_last_row & np.isfinite(matrices).all(axis=(-1, -2))))
