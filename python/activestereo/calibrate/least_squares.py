# SPDX-License-Identifier: Apache-2.0
"""Converts rigid motions to vectors and back for least squares, and computes standard deviations of the results."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult
from scipy.spatial.transform import Rotation

from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.common.pose import rigid_motion

# Half of a 90 % interval, in standard deviations.
INTERVAL_90 = 1.6449


def motion(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the 4x4 of a vector [6]: rotation vector (3, radians), then translation (3, metres)."""
    return rigid_motion(np.ravel(vector[3:]), Rotation.from_rotvec(np.ravel(vector[:3])).as_matrix())


def vector(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the vector [6] of a 4x4: rotation vector (3, radians), then translation (3, metres)."""
    return np.concatenate([Rotation.from_matrix(pose[:3, :3]).as_rotvec(), pose[:3, 3]])


def difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[float, float]:
    """Returns the distance (metres) and the angle (degrees) between two 4x4 poses."""
    turn = np.linalg.norm(Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).as_rotvec())
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3])), float(np.rad2deg(turn))


def deviations(solution: OptimizeResult, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Computes the standard deviations of a solution's unknowns from the inverse of J^T J times the residuals'
    variance. residuals: at the solution."""
    J = solution.jac.toarray() if hasattr(solution.jac, "toarray") else solution.jac
    variance = float(residuals @ residuals) / max(len(residuals) - len(solution.x), 1)
    return np.asarray(np.sqrt(variance * np.diag(inverse_normal_matrix(J.T @ J))))
