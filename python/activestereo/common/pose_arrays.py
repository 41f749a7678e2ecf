# SPDX-License-Identifier: Apache-2.0
"""Arrays of poses, as simulators hold them: [..., 7] (x, y, z, then the unit quaternion w, x, y, z, the order of SAPIEN
and MuJoCo) or [..., 4, 4]."""

from __future__ import annotations

from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray


class HasDlpack(Protocol):
    """An array of another library, such as torch."""

    def __dlpack__(self, *args: Any, **kwargs: Any) -> Any: ...


PosesLike: TypeAlias = ArrayLike | HasDlpack

_RIGID = 1e-3  # float32 physics keeps its rotations to 1e-6; a scale or a shear is far beyond this


def host_array(values: PosesLike) -> NDArray[np.float64]:
    """float64 array in host memory, from NumPy, torch on any device, DLPack, or nested lists."""
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    elif hasattr(values, "__dlpack__") and not isinstance(values, np.ndarray):
        values = np.from_dlpack(values)  # type: ignore[arg-type]  # NumPy knows no stream that is not None
    return np.asarray(values, dtype=np.float64)


def pose_matrices(poses: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    """[..., 4, 4] from [..., 7] or [..., 4, 4]; a new array. Quaternions may have any length. Raises ValueError for
    another shape; `what` names the array."""
    if poses.shape[-2:] == (4, 4):
        return poses.copy()
    if poses.shape[-1:] != (7,):
        raise ValueError(f"{what}: a pose has 7 numbers (x, y, z, w, x, y, z) or 4x4, not the shape {poses.shape}")
    out = np.zeros((*poses.shape[:-1], 4, 4))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        w, x, y, z = np.moveaxis(poses[..., 3:] / np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True), -1, 0)
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        out[..., :3, :3] = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    out[..., :3, 3] = poses[..., :3]
    out[..., 3, 3] = 1.0
    return out


def pose_fault(matrices: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask [...] of matrices [..., 4, 4] that are not finite or no rigid motion."""
    rotation = matrices[..., :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        product = rotation @ np.swapaxes(rotation, -1, -2)
        is_turned = np.abs(product - np.eye(3)).max(axis=(-1, -2)) < _RIGID
        is_right_handed = (np.cross(rotation[..., 0], rotation[..., 1]) * rotation[..., 2]).sum(axis=-1) > 0.0
        has_last_row = (matrices[..., 3, :] == [0.0, 0.0, 0.0, 1.0]).all(axis=-1)
    return np.asarray(~(is_turned & is_right_handed & has_last_row & np.isfinite(matrices).all(axis=(-1, -2))))
