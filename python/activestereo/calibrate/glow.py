# SPDX-License-Identifier: Apache-2.0
"""Light that the projector sends between its dots, from walls at two distances.

Between the dots a camera counts its black level and the room's light, which a wall at either distance has alike, and
the projector's light, which falls with the distance's square:

    counts = constant of the camera + background * (pattern pixels per camera pixel) / (flux to power, power_factor)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.wall import wall_points

# Every so many pixels; so many pixels beside the image's and the pattern's borders have less background than their
# place says, because it was found by a filter.
_STRIDE_PX, _BORDER_PX = 4, 24
_OUTLIER = 4.0  # in median absolute deviations


@dataclass(frozen=True)
class SeenWall:
    """One wall by one camera. background [height][width], DN: the image without its dots. plane: [n, d] with n . X = d
    in the left camera's frame, metres. camera_m: the camera's origin there. K: the camera's. to_common: what brings
    this wall's powers to the first wall's."""

    background: NDArray[np.float64]
    plane: NDArray[np.float64]
    camera_m: NDArray[np.float64]
    K: NDArray[np.float64]
    to_common: float


@dataclass(frozen=True)
class ProjectorView:
    """Where the projector stands: its origin in the left camera's frame, the rotation into its own, its K, and the
    pattern's width and height in pixels."""

    position_m: NDArray[np.float64]
    rotation: NDArray[np.float64]
    K: NDArray[np.float64]
    size: tuple[int, int]

    def pixels(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return projected(points, self.position_m, self.rotation, self.K)


def projected(
    points: NDArray[np.float64], position_m: NDArray[np.float64], rotation: NDArray[np.float64], K: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(u, v [n][2] in the pattern, the beams [n][3] in the projector's axes) of points [n][3] in the left camera's
    frame."""
    beam = (points - position_m) @ rotation.T
    u = K[0, 0] * beam[:, 0] / beam[:, 2] + K[0, 2]
    v = K[1, 1] * beam[:, 1] / beam[:, 2] + K[1, 2]
    return np.column_stack([u, v]), beam


def power_factor(
    points: NDArray[np.float64], normal: NDArray[np.float64], beam: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The factor by which a flux in the camera is multiplied for its integral over the pattern's pixels, up to a
    constant. points [n][3]: from the camera.

    A matt wall turns a beam's power, watts, into the same radiance times area whatever the beam's angle. The camera
    integrates it over du dv = f^2 dOmega / cos^3 a with dOmega = dA cos(c) / r^2, a its angle off the axis and c off
    the wall's normal; the pattern holds power per solid angle, over du dv = f^2 dOmega / cos^3 b.
    """
    distance = np.linalg.norm(points, axis=1)
    off_axis, off_normal = points[:, 2] / distance, np.abs(points @ normal) / distance
    off_beam = beam[:, 2] / np.linalg.norm(beam, axis=1)
    return np.asarray(distance**2 * off_axis**3 / (off_normal * off_beam**3))


def light_between_dots(
    walls_by_side: Sequence[Sequence[SeenWall]], projector: ProjectorView
) -> tuple[float, float]:
    """(the pattern's value between its dots, in the unit of their powers per square pixel; half of what the cameras
    differ by)."""
    found = [_fit_side(walls, projector) for walls in walls_by_side]
    return max(float(np.mean(found)), 0.0), float(0.5 * np.ptp(found))


def _fit_side(walls: Sequence[SeenWall], projector: ProjectorView) -> float:
    parts = [_samples(wall, projector) for wall in walls]
    counts, shares = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    columns = np.column_stack([np.ones(len(shares)), shares])
    use = np.ones(len(shares), dtype=bool)
    for _ in range(3):
        solution = np.linalg.lstsq(columns[use], counts[use], rcond=None)[0]
        off = np.abs(counts - columns @ solution)
        use = off <= _OUTLIER * 1.4826 * np.median(off[use])
    return float(solution[1])


def _samples(wall: SeenWall, projector: ProjectorView) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(counts, what a background of 1 adds to them) of pixels of a wall within the pattern."""
    height, width = wall.background.shape
    rows, columns = (np.arange(_BORDER_PX, size - _BORDER_PX, _STRIDE_PX) for size in (height, width))
    v, u = (part.ravel() for part in np.meshgrid(rows, columns, indexing="ij"))
    points = wall_points(wall.plane, wall.K, wall.camera_m, u, v)
    place, beam = projector.pixels(points)
    nexts = (wall_points(wall.plane, wall.K, wall.camera_m, *shifted) for shifted in ((u + 1, v), (u, v + 1)))
    along_u, along_v = (projector.pixels(shifted)[0] - place for shifted in nexts)
    pattern_pixels = np.abs(along_u[:, 0] * along_v[:, 1] - along_u[:, 1] * along_v[:, 0])
    margin = _BORDER_PX * np.sqrt(pattern_pixels)[:, None]
    inside = np.all((place > margin) & (place < np.array(projector.size) - margin), axis=1)
    shares = pattern_pixels / (power_factor(points - wall.camera_m, wall.plane[:3], beam) * wall.to_common)
    return wall.background[v, u][inside], shares[inside]
