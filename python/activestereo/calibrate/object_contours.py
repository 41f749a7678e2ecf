# SPDX-License-Identifier: Apache-2.0
"""Contours of a CAD part as kuafu sees it from a camera: silhouettes, edges of depth and creases, each a point on the
part with its direction in the image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

import kuafu
from activestereo.calibrate.object_views import View
from activestereo.scene_io.meshes import Mesh

# Rendered so much finer than the image: a contour is then known to a quarter of a pixel.
_FINER = 2
_MARGIN_PX = 24
_MOST_POINTS = 220
_CREASE = 0.82  # cosine of 35 degrees
_EDGE_OF_DEPTH = 0.02  # share of the distance
_OUTWARD_PX = 0.5 / _FINER


@dataclass(frozen=True)
class Contours:
    """points: [n][3] in the part's frame; places: [n][2] u, v where the contour is in the image; normals: [n][2],
    outward; weights: [n], 1 for the silhouette."""

    points: NDArray[np.float64]
    places: NDArray[np.float64]
    normals: NDArray[np.float64]
    weights: NDArray[np.float64]


class PartRenderer:
    """A part alone in a scene. The cameras move about it, so that nothing is built again."""

    def __init__(self, mesh: Mesh, device: kuafu.Device | None = None) -> None:
        self._device = kuafu.Device() if device is None else device
        self._scene, self._renderer = kuafu.Scene(self._device), kuafu.Renderer(self._device)
        number = self._scene.add_mesh(mesh.positions, mesh.indices.reshape(-1, 3), normals=mesh.normals)
        self._scene.add_instance(number, [self._scene.add_material(kuafu.Material(specular=0.0))])
        self._corners = _corners(mesh)

    def contours(self, views: Sequence[View], part_to_world: NDArray[np.float64]) -> list[Contours | None]:
        """The contours of every view; None where the part is out of it."""
        found = [self._box(view, part_to_world) for view in views]
        boxes = {k: box for k, box in enumerate(found) if box is not None}
        seen = list(boxes)
        if not seen:
            return [None] * len(views)
        size = [_FINER * (max(boxes[k][axis + 2] - boxes[k][axis] for k in seen) + 1) for axis in (0, 1)]
        cameras, corners = [], []
        for k in seen:
            u, v = boxes[k][:2]
            K = np.diag([_FINER, _FINER, 1.0]) @ views[k].K
            # Pixel centres at integers: column c of the crop is u + (c + 0.5) / _FINER - 0.5.
            K[:2, 2] = _FINER * (views[k].K[:2, 2] - (u, v) + 0.5) - 0.5
            cameras.append(kuafu.Camera(size[0], size[1], K, np.linalg.inv(part_to_world) @ views[k].camera_to_world))
            corners.append((u, v))
        images = self._renderer.render(self._scene, cameras, ("depth", "normal", "position"), spp=1)
        out: list[Contours | None] = [None] * len(views)
        for place, k in enumerate(seen):
            maps = (images["depth"][place, ..., 0], images["normal"][place], images["position"][place])
            out[k] = _contours(*maps, corners[place], views[k].size)
        return out

    def _box(self, view: View, part_to_world: NDArray[np.float64]) -> tuple[int, int, int, int] | None:
        """The box of the image that the part may cover, with a margin."""
        there = np.linalg.inv(view.camera_to_world) @ part_to_world
        points = self._corners @ there[:3, :3].T + there[:3, 3]
        if (points[:, 2] <= 0.01).any():
            return None
        uv = points @ view.K.T
        uv = uv[:, :2] / uv[:, 2:]
        low = np.floor(uv.min(axis=0)).astype(int) - _MARGIN_PX
        high = np.ceil(uv.max(axis=0)).astype(int) + _MARGIN_PX
        width, height = view.size
        if (high < _MARGIN_PX).any() or (low > np.array([width, height]) - _MARGIN_PX).any():
            return None
        low, high = np.maximum(low, 0), np.minimum(high, [width - 1, height - 1])
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _corners(mesh: Mesh) -> NDArray[np.float64]:
    low, high = mesh.positions.min(axis=0).astype(float), mesh.positions.max(axis=0).astype(float)
    return np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )


def _contours(
    depth: NDArray, normal: NDArray, position: NDArray, corner: tuple[int, int], size: tuple[int, int]
) -> Contours | None:
    mask = depth > 0
    if mask.sum() < 50:
        return None
    cross = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)
    far = np.where(mask, depth, 1e3)
    behind = maximum_filter(far, footprint=cross)
    silhouette = mask & (behind > far * (1.0 + _EDGE_OF_DEPTH))
    crease = np.zeros(mask.shape, bool)
    for axis in (0, 1):
        other = np.roll(normal, -1, axis=axis)
        crease |= (np.einsum("ijk,ijk->ij", normal, other) < _CREASE) & mask & np.roll(mask, -1, axis=axis)
    crease &= ~maximum_filter(silhouette, 5) & minimum_filter(mask, 3)
    points, places, normals, weights = [], [], [], []
    # Where the surface is near; creases point across the change of their normal.
    inverse = np.where(mask, 1.0 / np.maximum(far, 1e-3), 0.0)
    outward = -np.stack(
        [gaussian_filter(inverse, 2.0, order=(0, 1)), gaussian_filter(inverse, 2.0, order=(1, 0))], axis=-1
    )
    across = _crease_direction(normal)
    for chosen, field, weight in ((silhouette, outward, 1.0), (crease, across, 0.5)):
        v, u = np.nonzero(chosen)
        if not len(v):
            continue
        length = np.linalg.norm(field[v, u], axis=1)
        kept = np.flatnonzero(length > 1e-9)
        kept = kept[:: max(1, len(kept) // _MOST_POINTS)]
        v, u, direction = v[kept], u[kept], field[v[kept], u[kept]] / length[kept, None]
        outside = _OUTWARD_PX if weight == 1.0 else 0.0
        place = np.stack([corner[0] + (u + 0.5) / _FINER - 0.5, corner[1] + (v + 0.5) / _FINER - 0.5], axis=1)
        points.append(position[v, u])
        places.append(place + outside * direction)
        normals.append(direction)
        weights.append(np.full(len(v), weight))
    stacked = [np.concatenate(part).astype(np.float64) for part in (points, places, normals, weights)]
    # The crop's own border is no contour.
    inside = np.all((stacked[1] > 3) & (stacked[1] < np.array(size) - 4), axis=1)
    if inside.sum() < 12:
        return None
    return Contours(*(part[inside] for part in stacked))


def _crease_direction(normal: NDArray) -> NDArray:
    """The direction of the strongest change of the normal."""
    parts = np.array([[gaussian_filter(normal[..., c], 1.5, order=o) for o in ((0, 1), (1, 0))] for c in range(3)])
    xx, xy, yy = ((parts[:, a] * parts[:, b]).sum(axis=0) for a, b in ((0, 0), (0, 1), (1, 1)))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
