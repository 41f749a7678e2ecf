# SPDX-License-Identifier: Apache-2.0
"""The light of a world whose surfaces are all matt, of one albedo each.

Light off the first surface follows from geometry (Lambert): albedo / pi x cos / distance^2 x visibility x pattern,
at the centres of FINER x FINER squares of each pixel. It has no noise. Bounced light has no dots: it is rendered with
few samples in wider pixels, smoothed along surfaces, and brought to the finer pixels of the same surface.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

import kuafu
from activestereo.compare.layers import ViewCamera
from activestereo.effects.engines.smooth import Surfaces, alike, smooth_bounced

# Squares along each side of a pixel; bounced light's pixels are as many pixels wide.
FINER = 2
FIRST = ("albedo", "projector_geometry", "projector_visibility", "projector_uv")
SURFACE = ("depth", "normal", "material_id")
# Part of a view's samples that light by way of surfaces and from the sky takes, and the first surface's geometry.
BOUNCED_SHARE, FIRST_SHARE = 0.25, 1.0 / 16.0
# Light that would come to a pixel from no neighbour of its surface comes from all of them.
_LEAST_ALIKE = 1e-4
# Changes whenever the light does.
VERSION = 2


def surfaces_of(images: Mapping[str, NDArray], i: int, camera: ViewCamera) -> Surfaces:
    """The Surfaces of camera i, whose images hold SURFACE."""
    depth_m, K = images["depth"][i, ..., 0], camera.K
    row, column = np.indices(depth_m.shape, dtype=np.float32)
    y = (row - K[1, 2]) / K[1, 1]
    x = (column - K[0, 2] - K[0, 1] * y) / K[0, 0]
    normal = images["normal"][i] @ camera.camera_to_world[:3, :3]
    points = np.stack([x * depth_m, y * depth_m, depth_m], axis=-1)
    return Surfaces.of(depth_m, normal, points, images["material_id"][i, ..., 0])


def is_matt_world(scene: kuafu.Scene) -> bool:
    """Whether every material of a scene reflects by Lambert's law alone, with one albedo, and no light is its own."""
    seen = scene.summary
    return seen.light_count == 0 and all(_is_matt(scene.get_material(number)) for number in range(seen.material_count))


def _is_matt(m: kuafu.Material) -> bool:
    textures = m.base_color_texture, m.ir_albedo_texture, m.metallic_roughness_texture, m.normal_texture
    other = (
        m.metallic, m.specular, m.transmission, m.ir_transmission or 0.0, m.diffuse_transmission, m.subsurface,
        m.clearcoat, m.diffuse_roughness, m.ir_sheen_color or 0.0, *m.sheen_color, m.ir_emission, *m.emission,
    )  # fmt: skip
    return m.bsdf == "gltf" and m.alpha_mode == "opaque" and not any(other) and all(t is None for t in textures)


def first_light(images: Mapping[str, NDArray], i: int, pattern: NDArray) -> tuple[NDArray, NDArray]:
    """(light off the first surface, the same under a pattern that is 1 everywhere), float32 [height][width], of camera
    i, whose images hold FIRST at FINER times the size."""
    flat, uv = (images["albedo"][i, ..., 0] / np.float32(np.pi)), images["projector_uv"][i]
    flat = flat * images["projector_geometry"][i, ..., 0] * images["projector_visibility"][i, ..., 0]
    lit = flat > 0
    direct = np.zeros_like(flat)
    u, v = uv[lit].T
    direct[lit] = flat[lit] * map_coordinates(
        np.asarray(pattern, np.float32), [v, u], np.float32, order=1, mode="grid-constant"
    )
    return _means(direct), _means(flat)


def _means(image: NDArray[np.float32]) -> NDArray[np.float32]:
    rows = np.add.reduce([image[k::FINER] for k in range(FINER)])
    return np.add.reduce([rows[:, k::FINER] for k in range(FINER)]) / np.float32(FINER**2)


def bounced_light(light: NDArray[np.float32], wide: Surfaces, fine: Surfaces, focal_px: float) -> NDArray[np.float32]:
    """Images [n][height][width] in wide pixels as the fine ones have them. focal_px: of the wide ones."""
    smooth = smooth_bounced(light, wide, focal_px)
    total, weights = np.zeros((len(light), *fine.depth_m.shape), np.float32), np.zeros(fine.depth_m.shape, np.float32)
    (above, below), (left, right) = (
        _neighbours(n, m) for n, m in zip(fine.depth_m.shape, wide.depth_m.shape, strict=True)
    )
    for rows, of_rows in (above, below):
        for columns, of_columns in (left, right):
            at = np.ix_(rows, columns)
            weight = np.outer(of_rows, of_columns).astype(np.float32) * (_LEAST_ALIKE + alike(fine, wide.at(at)))
            total += weight * smooth[:, at[0], at[1]]
            weights += weight
    return total / weights


def _neighbours(count: int, wide: int) -> tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]:
    """Along an axis, of each fine pixel: (the wide pixels before it, their weights), and those after it."""
    at = (np.arange(count) + 0.5) / FINER - 0.5
    before = np.floor(at).astype(int)
    share = at - before
    low, high = (np.clip(before + k, 0, wide - 1) for k in (0, 1))
    return (low, 1.0 - share), (high, share)
