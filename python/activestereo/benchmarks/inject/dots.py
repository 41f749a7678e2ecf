# SPDX-License-Identifier: Apache-2.0
"""Dead dots: directions without light from the projector, the same in every frame and both cameras."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import grey_closing

from activestereo.benchmarks.inject.light import Light, View

# A direction without light is as wide as this share of the pattern's width: a dot and its surroundings.
_DISC = 1.0 / 150.0
_WINDOW_PX = 4  # to each side, in which the light between dots is looked for
_BETWEEN = 0.2  # quantile of that light


def dead_dots(light: Light, view: View, share: float) -> Light:
    """In a share of the projector's directions only the light between the dots is left."""
    if view.depth is None:
        raise ValueError("has no depth, which dead_dots needs to follow a dot from one image to the next")
    rows, columns = np.nonzero(_is_dead(view, share) & (view.depth > 0.0))
    offsets = np.mgrid[-_WINDOW_PX : _WINDOW_PX + 1, -_WINDOW_PX : _WINDOW_PX + 1].reshape(2, -1, 1)
    height, width = light.value.shape
    near = light.value[np.clip(rows + offsets[0], 0, height - 1), np.clip(columns + offsets[1], 0, width - 1)]
    value, variance = light.value.copy(), light.variance.copy()
    between = np.minimum(np.quantile(near, _BETWEEN, axis=0), value[rows, columns]) if len(rows) else near[:0].sum(0)
    value[rows, columns], variance[rows, columns] = between, 0.0
    return Light(value, variance)


def dead_directions(view: View, share: float) -> np.ndarray:
    """Pixels of the pattern without light, bool [height][width]: discs at random places until they fill `share`."""
    width, height = view.projector_size
    dead, count = np.zeros((height, width), bool), 0
    radius = max(1.0, _DISC * width / 2)
    while count < share * dead.size:
        centre_u, centre_v = view.static.uniform(0.0, (width, height))
        rows, columns = (slice(max(0, int(c - radius)), int(c + radius) + 2) for c in (centre_v, centre_u))
        part = dead[rows, columns]
        v, u = np.indices(part.shape)
        disc = np.hypot(u + columns.start - centre_u, v + rows.start - centre_v) <= radius
        count += int(np.count_nonzero(disc & ~part))
        part |= disc
    return dead


def _is_dead(view: View, share: float) -> np.ndarray:
    """Mask of the pixels with surface points in a dead direction."""
    assert view.depth is not None
    x, y = view.rays(view.depth.shape)
    point = np.stack([x, y, np.ones_like(x)]) * view.depth
    point = np.einsum("ij,jhw->ihw", view.camera_to_projector[:3, :3], point)
    point += view.camera_to_projector[:3, 3, None, None]
    place = np.einsum("ij,jhw->ihw", view.projector_K, point)
    in_front = point[2] > 0.0
    u, v = np.rint(place[:2] / np.where(in_front, place[2], 1.0))
    width, height = view.projector_size
    inside = in_front & (u >= 0) & (u < width) & (v >= 0) & (v < height)
    dead = dead_directions(view, share)
    return inside & dead[np.where(inside, v, 0).astype(int), np.where(inside, u, 0).astype(int)]


def moved_depth(depth: np.ndarray, K: np.ndarray, to_other: np.ndarray, other_K: np.ndarray) -> np.ndarray:
    """A depth image as another camera of the same size sees it: the nearest surface wins, gaps of one pixel close."""
    v, u = np.nonzero(depth > 0.0)
    z = depth[v, u]
    point = np.linalg.inv(K) @ np.stack([u * z, v * z, z])
    point = to_other[:3, :3] @ point + to_other[:3, 3:]
    point = point[:, point[2] > 0.0]
    u, v = np.rint((other_K @ point)[:2] / point[2]).astype(int)
    inside = (u >= 0) & (u < depth.shape[1]) & (v >= 0) & (v < depth.shape[0])
    out = np.full(depth.shape, np.inf)
    np.minimum.at(out, (v[inside], u[inside]), point[2, inside])
    out = np.where(np.isfinite(out), out, 0.0)
    closed: np.ndarray = grey_closing(out, size=(3, 3))
    return np.where(out > 0.0, out, closed)
