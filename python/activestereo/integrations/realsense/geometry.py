# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's intrinsics, extrinsics and functions on points; metres, x right, y down, z forward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from activestereo.common.lens import distort, undistort
from activestereo.integrations.realsense.enums import distortion


@dataclass
class intrinsics:
    width: int = 0
    height: int = 0
    ppx: float = 0.0
    ppy: float = 0.0
    fx: float = 0.0
    fy: float = 0.0
    model: distortion = distortion.none
    coeffs: list[float] = field(default_factory=lambda: [0.0] * 5)

    @classmethod
    def from_matrix(cls, size: tuple[int, int], K: NDArray[np.float64], lens: Sequence[float]) -> intrinsics:
        """From an image's (width, height), its 3x3 K and Brown and Conrady's five numbers."""
        model = distortion.brown_conrady
        return cls(*size, K[0, 2], K[1, 2], K[0, 0], K[1, 1], model, [float(c) for c in lens[:5]])

    def divided(self, factor: int) -> intrinsics:
        """The intrinsics of an image reduced by this factor."""
        return intrinsics(
            self.width // factor, self.height // factor, self.ppx / factor, self.ppy / factor,
            self.fx / factor, self.fy / factor, self.model, list(self.coeffs),
        )  # fmt: skip


@dataclass
class extrinsics:
    """rotation: 9 numbers, column after column; translation: metres."""

    rotation: list[float] = field(default_factory=lambda: np.eye(3).ravel().tolist())
    translation: list[float] = field(default_factory=lambda: [0.0] * 3)

    @classmethod
    def from_transform(cls, a_to_b: NDArray[np.float64]) -> extrinsics:
        return cls(a_to_b[:3, :3].T.ravel().tolist(), a_to_b[:3, 3].tolist())

    def matrix(self) -> NDArray[np.float64]:
        """4x4."""
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = np.reshape(self.rotation, (3, 3)).T, self.translation
        return out


def deprojected(camera: intrinsics, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (x, y) at depth 1 through pixels [2, ...]."""
    x, y = (u - camera.ppx) / camera.fx, (v - camera.ppy) / camera.fy
    if any(camera.coeffs):
        x, y = undistort(x, y, camera.coeffs)
    return np.stack([x, y])


def projected(camera: intrinsics, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels [2, ...] of points [3, ...] with z > 0."""
    x, y = points[0] / points[2], points[1] / points[2]
    if any(camera.coeffs):
        x, y = distort(x, y, camera.coeffs)
    return np.stack([camera.fx * x + camera.ppx, camera.fy * y + camera.ppy])


def rs2_deproject_pixel_to_point(intrin: intrinsics, pixel: Sequence[float], depth: float) -> list[float]:
    x, y = deprojected(intrin, *(np.array(float(c)) for c in pixel))
    return [float(depth * x), float(depth * y), float(depth)]


def rs2_project_point_to_pixel(intrin: intrinsics, point: Sequence[float]) -> list[float]:
    return [float(c) for c in projected(intrin, np.asarray(point, np.float64))]


def rs2_transform_point_to_point(extrin: extrinsics, from_point: Sequence[float]) -> list[float]:
    matrix = extrin.matrix()
    return [float(c) for c in matrix[:3, :3] @ np.asarray(from_point, np.float64) + matrix[:3, 3]]


def rs2_fov(intrin: intrinsics) -> list[float]:
    """Horizontal and vertical field of view, degrees."""
    sides = ((intrin.ppx, intrin.width, intrin.fx), (intrin.ppy, intrin.height, intrin.fy))
    return [float(np.degrees(np.arctan2(c + 0.5, f) + np.arctan2(n - c - 0.5, f))) for c, n, f in sides]
