# SPDX-License-Identifier: Apache-2.0
"""Fast point feature histograms (Rusu, Blodow and Beetz, ICRA 2009): descriptors of the surface around a point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_BINS, _MOST = 11, 32


def histograms(
    points: NDArray[np.float64], normals: NDArray[np.float64], radius_m: float
) -> NDArray[np.float64]:
    """[n, 33], three histograms with a sum of 1 each, of the points within radius_m (the 32 nearest of them)."""
    count = len(points)
    distance, near = cKDTree(points).query(points, min(_MOST + 1, count))
    distance, near = distance[:, 1:], near[:, 1:]
    is_near = (distance < radius_m) & (distance > 1e-9)
    safe = np.where(is_near, distance, 1.0)
    way = (points[near] - points[:, None]) / safe[..., None]
    u = np.broadcast_to(normals[:, None], way.shape)
    v = np.cross(way, u)
    v /= np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)
    w = np.cross(u, v)
    other = normals[near]
    alpha = np.einsum("nki,nki->nk", v, other)
    phi = np.einsum("nki,nki->nk", u, way)
    theta = np.arctan2(np.einsum("nki,nki->nk", w, other), np.einsum("nki,nki->nk", u, other)) / np.pi
    simple = np.concatenate([_histogram(value, is_near) for value in (alpha, phi, theta)], axis=1)
    weight = np.where(is_near, 1.0 / safe, 0.0)
    weight /= np.maximum(weight.sum(axis=1, keepdims=True), 1e-9)
    whole = simple + np.einsum("nk,nkb->nb", weight, simple[near])
    sums = whole.reshape(count, 3, _BINS).sum(axis=2, keepdims=True)
    return np.asarray((whole.reshape(count, 3, _BINS) / np.maximum(sums, 1e-9)).reshape(count, -1))


def _histogram(value: NDArray[np.float64], is_near: NDArray[np.bool_]) -> NDArray[np.float64]:
    """[n, 11] of values [n, k] in -1..1."""
    bins = np.clip(((value + 1.0) * 0.5 * _BINS).astype(int), 0, _BINS - 1)
    out = np.zeros((len(value), _BINS))
    rows = np.broadcast_to(np.arange(len(value))[:, None], bins.shape)
    np.add.at(out, (rows[is_near], bins[is_near]), 1.0)
    return out / np.maximum(out.sum(axis=1, keepdims=True), 1.0)
