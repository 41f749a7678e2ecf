# SPDX-License-Identifier: Apache-2.0
"""Computes the light of a world whose surfaces are all matt: each with one albedo, or a room that `calibrate world`
measured.

Light off the first surface follows from geometry (Lambert): albedo / pi x cos / distance^2 x visibility x pattern, at
the centres of FINER x FINER squares of each pixel. One sample shows it, without noise. Bounced light shows no dots, so
it is rendered with few samples in wider pixels. Divided by the albedo it is smoothed along surfaces, whatever is
painted on them, and interpolated to the finer pixels of the same surface.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

import kuafu
from activestereo.common.lens import to_tangents
from activestereo.effects.engines.layers import ViewCamera
from activestereo.effects.engines.smooth import Surfaces, alike, smooth_bounced

# Squares along each side of a pixel; a pixel of bounced light is as many pixels wide.
FINER = 2
FIRST = ("albedo", "projector_geometry", "projector_visibility", "projector_uv")
SURFACE = "depth", "normal", "material_id"
# Shares of samples: bounced light's of a view's samples; direct sky light's of these (effects use it separately).
BOUNCED_SHARE, SKY_SHARE = 0.25, 0.25
# Smaller images than this get as many samples in all as this many pixels would, up to MOST_TIMES their own.
SHARED_PIXELS, MOST_TIMES = 424 * 240, 4.0
# Least weight of a neighbour, so that a pixel without a neighbour on its own surface takes all of them.
_LEAST_ALIKE = 1e-4
# Mark of pixels that see both sky and surface; 1 marks surface, 0 sky.
_MIXED = 2
# Increase this number whenever the computed light changes.
VERSION = 4


class MattSurfaces(NamedTuple):
    """Holds the surfaces that a camera sees, regardless of their paint, and their infrared albedo [height][width]."""

    surfaces: Surfaces
    albedo: NDArray[np.float32]


def surfaces_of(images: Mapping[str, NDArray], i: int, camera: ViewCamera, albedo: NDArray[np.float32]) -> MattSurfaces:
    """Returns the surfaces that camera number i sees, from images with the outputs SURFACE. albedo: at finer squares
    than the camera's pixels."""
    depth_m, K = images["depth"][i, ..., 0], camera.K
    row, column = np.indices(depth_m.shape, dtype=np.float32)
    x, y = to_tangents(column, row, K)
    normal = images["normal"][i] @ camera.camera_to_world[:3, :3]
    points = np.stack([x * depth_m, y * depth_m, depth_m], axis=-1)
    squares = -(-albedo.shape[1] // depth_m.shape[1])
    mean, covered = _means(albedo, squares), _means((albedo > 0).astype(np.float32), squares)
    whole = np.where((covered == 0.0) | (covered == 1.0), depth_m > 0, _MIXED)
    return MattSurfaces(Surfaces.of(depth_m, normal, points, whole), mean)


def is_matt_world(scene: kuafu.Scene, is_painted: bool = False) -> bool:
    """Returns whether every material of a scene reflects by Lambert's law alone, and the scene has no light of its own.
    is_painted: allows albedo textures, for a scene that only the projector lights."""
    seen = scene.summary
    for m in (scene.get_material(number) for number in range(0 if seen.light_count else seen.material_count)):
        paint = () if is_painted else (m.base_color_texture, m.ir_albedo_texture)
        textures = *paint, m.metallic_roughness_texture, m.normal_texture
        other = (
            m.metallic, m.specular, m.transmission, m.ir_transmission or 0.0, m.diffuse_transmission, m.subsurface,
            m.clearcoat, m.diffuse_roughness, m.ir_sheen_color or 0.0, *m.sheen_color, m.ir_emission, *m.emission,
        )  # fmt: skip
        has_texture = any(texture is not None for texture in textures)
        if m.bsdf != "gltf" or m.alpha_mode != "opaque" or any(other) or has_texture:
            return False
    return seen.light_count == 0


def first_light(images: Mapping[str, NDArray], i: int, pattern: NDArray) -> tuple[NDArray, NDArray]:
    """Returns the projector's light off the first surface for camera i: (with the pattern, with a pattern that is 1
    everywhere), float32 [height][width]. images: the outputs FIRST at FINER times the size."""
    flat, uv = (images["albedo"][i, ..., 0] / np.float32(np.pi)), images["projector_uv"][i]
    flat = flat * images["projector_geometry"][i, ..., 0] * images["projector_visibility"][i, ..., 0]
    lit = flat > 0
    direct = np.zeros_like(flat)
    u, v = uv[lit].T
    direct[lit] = flat[lit] * map_coordinates(
        np.asarray(pattern, np.float32), [v, u], np.float32, order=1, mode="grid-constant"
    )
    return _means(direct, FINER), _means(flat, FINER)


def _means(image: NDArray[np.float32], squares: int) -> NDArray[np.float32]:
    """Returns the means over squares x squares pixels."""
    rows, columns = (-n % squares for n in image.shape)
    image = np.pad(image, ((0, rows), (0, columns)), mode="edge")
    down = np.add.reduce([image[k::squares] for k in range(squares)])
    return np.add.reduce([down[:, k::squares] for k in range(squares)]) / np.float32(squares**2)


def bounced_light(
    light: NDArray[np.float32], wide: MattSurfaces, fine: MattSurfaces, focal_px: float
) -> NDArray[np.float32]:
    """Smooths images of bounced light [n][height][width] in wide pixels and interpolates them to the fine pixels along
    surfaces. focal_px: focal length in wide pixels."""
    hit, shape = wide.albedo > 0, fine.albedo.shape
    per_albedo = np.where(hit, light / np.where(hit, wide.albedo, 1.0), light)
    smooth = smooth_bounced(per_albedo, wide.surfaces, focal_px)
    total, weights = np.zeros((len(light), *shape), np.float32), np.zeros(shape, np.float32)
    (above, below), (left, right) = (_neighbours(n, m) for n, m in zip(shape, wide.albedo.shape, strict=True))
    for rows, of_rows in (above, below):
        for columns, of_columns in (left, right):
            at = np.ix_(rows, columns)
            weight = np.outer(of_rows, of_columns).astype(np.float32)
            there = wide.surfaces.at(at)
            weight *= _LEAST_ALIKE + alike(fine.surfaces, there)
            weight *= np.where(there.material == _MIXED, _LEAST_ALIKE**2, 1.0)
            total += weight * smooth[:, at[0], at[1]]
            weights += weight
    return total / weights * np.where(fine.albedo > 0, fine.albedo, 1.0)


def _neighbours(count: int, wide: int) -> tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]:
    """Returns, for each fine pixel along an axis, the two wide pixels between which it lies with their linear
    interpolation weights: ((index before, weight), (index after, weight))."""
    at = (np.arange(count) + 0.5) / FINER - 0.5
    before = np.floor(at).astype(int)
    share = at - before
    low, high = (np.clip(before + k, 0, wide - 1) for k in (0, 1))
    return (low, 1.0 - share), (high, share)
