# SPDX-License-Identifier: Apache-2.0
"""Filters the renderer's noise out of bounced and ambient light by an edge-avoiding a-trous wavelet filter (Dammertz et
al. 2010, HPG). Renders in two independent halves of the samples measure the noise.

Such light is smooth along a diffuse surface, so a pixel is averaged with neighbours of the same material in its tangent
plane. The weights depend on geometry alone, never on the noisy light, so the filter is linear in the light. The mean
stays within a per cent (measured). Direct light is never filtered, because it has edges of its own: shadows of lamps
and dots of further projectors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import kuafu

# Part of cache keys: increase it whenever the filter changes.
SMOOTH_VERSION = 7

# Cubic B-spline, 5 taps.
_TAPS = np.array([1, 4, 6, 4, 1]) / 16.0
# The filter reaches about this angle at any resolution; each level doubles its reach.
_REACH_RAD = 0.02
# A neighbour's weight falls with its distance from the tangent plane, in units of this share of depth, and with its
# normal's angle: cosine^24.
_PLANE_SHARE = 0.006


class Surfaces(NamedTuple):
    """Geometry of the surfaces that an image's samples see, [height][width]. Vectors are [3][height][width] in one
    frame."""

    depth_m: np.ndarray
    normal: np.ndarray
    points: np.ndarray
    material: np.ndarray

    @classmethod
    def of(cls, depth_m: np.ndarray, normal: np.ndarray, points: np.ndarray, material: np.ndarray) -> Surfaces:
        """Returns Surfaces of vectors [height][width][3]."""
        normals, places = (
            np.ascontiguousarray(np.moveaxis(vectors, -1, 0), dtype=np.float32) for vectors in (normal, points)
        )
        return cls(np.asarray(depth_m, dtype=np.float32), normals, places, np.asarray(material))

    def at(self, place: Any) -> Surfaces:
        """Returns the surfaces at an index of rows and columns."""
        index = (..., *place)
        return Surfaces(self.depth_m[index], self.normal[index], self.points[index], self.material[index])


def smooth_bounced(image: np.ndarray, surfaces: Surfaces, focal_px: float) -> np.ndarray:
    """Filters noise out of an image [..., height, width]; pixels without a surface stay. focal_px: the focal length in
    samples of the image."""
    levels = max(1, round(np.log2(focal_px * _REACH_RAD)))
    out = np.asarray(image, dtype=np.float32)
    for level in range(levels):
        out = _filter(out, surfaces, 1 << level)
    return np.where(surfaces.depth_m > 0, out, image)


def _filter(image: np.ndarray, surfaces: Surfaces, step: int) -> np.ndarray:
    shape = surfaces.depth_m.shape
    total, weight_sum = np.zeros_like(image), np.zeros(shape, np.float32)
    for j, row_tap in enumerate(_TAPS):
        for i, column_tap in enumerate(_TAPS):
            here, there = _overlap(shape, (j - 2) * step, (i - 2) * step)
            weight: Any = np.float32(row_tap * column_tap)
            if here != there:
                weight = weight * alike(surfaces.at(here), surfaces.at(there))
            total[(..., *here)] += weight * image[(..., *there)]
            weight_sum[here] += weight
    return total / weight_sum


def alike(here: Surfaces, there: Surfaces) -> np.ndarray:
    """Returns weights 0..1 of pairs of samples: 1 if both lie on one plane of one material, less if their planes
    differ, 0 if their materials differ."""
    cosine = np.maximum(_dot(here.normal, there.normal), np.float32(1e-6))
    eighth = cosine * cosine
    eighth *= eighth
    eighth *= eighth
    off_plane = _dot(here.normal, there.points - here.points) / np.maximum(_PLANE_SHARE * here.depth_m, 1e-6)
    return (here.material == there.material) * (eighth * eighth * eighth) * np.exp(-off_plane * off_plane)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _overlap(shape: tuple[int, ...], down: int, right: int) -> tuple[Any, Any]:
    """Returns indices (rows, columns) of an image's samples that have a neighbour at (down, right), and of those."""
    axes = tuple(zip(shape, (down, right), strict=True))
    here = tuple(slice(max(0, -shift), size - max(0, shift)) for size, shift in axes)
    return here, tuple(slice(max(0, shift), size - max(0, -shift)) for size, shift in axes)


# Rougher surfaces have no highlight that would move through bounced light.
_MATT_ROUGHNESS = 0.2
_EVEN = ("ambient", "ambient_direct")
# Under subsurface scattering these images hold the dots.
_BOUNCED = ("projector_indirect", "added_indirect")


def smooth_view(
    view: dict[str, NDArray], camera: kuafu.Camera, surfaces: Mapping[int, kuafu.Material]
) -> dict[str, NDArray]:
    """Returns a view's images [height][width][channels], with bounced and ambient light filtered on matt surfaces.
    surfaces: {id: material}, at least of those that are seen."""
    depth_m, material = view["depth"][..., 0], view["material_id"][..., 0]
    light = {name: view[name][..., 0] for name in (*_EVEN, *_BOUNCED) if name in view and view[name].any()}
    is_matt = np.isin(material, [number for number, m in surfaces.items() if is_matt_surface(m)])
    if not light or not is_matt.any():
        return view
    points = np.where(depth_m[..., None] > 0, view["position"], 0.0)
    geometry = Surfaces.of(depth_m, view["normal"], points, material)
    smooth = smooth_bounced(np.stack(list(light.values())), geometry, camera.k[0, 0])
    is_opaque = np.isin(material, [number for number, m in surfaces.items() if is_filtered(m)])
    return view | {
        name: np.where(is_matt if name in _EVEN else is_opaque, filtered, raw)[..., None]
        for (name, raw), filtered in zip(light.items(), smooth, strict=True)
    }


def is_filtered(m: kuafu.Material) -> bool:
    """Returns whether all bounced and ambient light of a surface is filtered."""
    return is_matt_surface(m) and m.subsurface == 0


def is_matt_surface(m: kuafu.Material) -> bool:
    """Returns whether bounced and ambient light follow the surface alone: no mirror, no glass, no albedo texture."""
    roughness = m.roughness if m.ir_roughness is None else m.ir_roughness
    transmission = m.transmission if m.ir_transmission is None else m.ir_transmission
    plain = m.base_color_texture is None or m.ir_albedo is not None
    lobes = ((m.specular, roughness), (m.clearcoat, m.clearcoat_roughness))
    is_rough = all(weight == 0 or alpha > _MATT_ROUGHNESS for weight, alpha in lobes)
    return transmission == 0 and m.metallic == 0 and is_rough and plain


HALVES = (0, 1)
# Seeds this far apart give independent random numbers.
_SEEDS_APART = 1 << 32


def halves(samples_per_pixel: int, seed: int) -> tuple[int, tuple[int, int]]:
    """Returns the samples per pixel of each of two halves, and the seeds of both."""
    return max(1, (samples_per_pixel + 1) // 2), (seed, seed + _SEEDS_APART)
