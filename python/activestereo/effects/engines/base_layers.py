# SPDX-License-Identifier: Apache-2.0
"""Renders the layers of a loaded scene's base model: under the projector at power 1, and under ambient radiance 1.

In a matt world (each surface has one albedo, or `calibrate world` measured the room) the first reflection follows from
geometry (Lambert): albedo / pi x cos / distance^2 x visibility x pattern. It is computed at the centres of squares of
each pixel, by one sample without noise. Bounced light shows no dots, so it is rendered under a pattern without dots,
with few samples in wider pixels. It is divided by the albedo, smoothed along surfaces, and interpolated to the smaller
pixels of the same surface."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates

import kuafu
from activestereo.common.lens import to_tangents, with_finer_pixels
from activestereo.common.progress_bar import Progress
from activestereo.effects.core.resample import means_of_squares
from activestereo.effects.core.view import Layers
from activestereo.effects.engines.capture_inputs import copy_record
from activestereo.effects.engines.layers import RenderRequest, request_key
from activestereo.effects.engines.loaded_scene import GEOMETRY, LIGHT, LoadedScene
from activestereo.effects.engines.smooth import Surfaces, alike, smooth_bounced

# A pixel of bounced light is WIDE pixels wide, and a pixel has SQUARES squares along each side. Dots have a fixed
# angular size, so in images of more than LARGE_PIXELS a pixel is one square.
WIDE, SQUARES, LARGE_PIXELS = 4, 2, 2 * 848 * 480
# Deviation of the blur that takes the dots off a pattern, about their distance. Paths then agree on the light that
# bounces: its variance is a third to a quarter of that under dots.
_DOTS_RAD = 0.0135
FIRST = ("albedo", "depth", "projector_geometry", "projector_visibility", "projector_uv")
SURFACE = "depth", "normal", "material_id"
# Share of a view's samples that bounced light gets.
BOUNCED_SHARE = 0.125
# Smaller images get as many samples in all as an image of SHARED_PIXELS, up to MOST_TIMES as many per pixel. Larger
# ones get no more in all than an image of MOST_PIXELS.
SHARED_PIXELS, MOST_TIMES, MOST_PIXELS = 424 * 240, 4.0, 884 * 516
# Least weight of a neighbour: a pixel without a neighbour on the same surface averages all neighbours.
_LEAST_ALIKE = 1e-4
# Increase this number whenever the computed light changes.
MATT_VERSION = 8


class MattSurfaces(NamedTuple):
    """The geometry of the surfaces that a camera sees, [height][width]. surfaces: `material` is 0 in the sky and 1
    elsewhere. covered: the share of each pixel that is not sky. albedo: each pixel's mean infrared albedo, sky 0."""

    surfaces: Surfaces
    covered: NDArray[np.float32]
    albedo: NDArray[np.float32]


def surfaces_of(
    images: Mapping[str, NDArray], i: int, camera: kuafu.Camera, finer: Mapping[str, NDArray]
) -> MattSurfaces:
    """Returns the surfaces that camera number i sees, from images with the outputs SURFACE. finer: albedo and depth of
    finer squares than the camera's pixels."""
    depth_m, K = images["depth"][i, ..., 0], camera.k
    row, column = np.indices(depth_m.shape, dtype=np.float32)
    lens = camera.distortion[: 4 if camera.lens_model == "kannala_brandt" else None]
    x, y = to_tangents(column, row, K, lens)
    normal = images["normal"][i] @ camera.camera_to_world[:3, :3]
    points = np.stack([x * depth_m, y * depth_m, depth_m], axis=-1)
    albedo, is_surface = finer["albedo"][i, ..., 0], (finer["depth"][i, ..., 0] > 0).astype(np.float32)
    squares = -(-albedo.shape[1] // depth_m.shape[1])
    surfaces = Surfaces.of(depth_m, normal, points, depth_m > 0)
    return MattSurfaces(surfaces, _means(is_surface, squares), _means(albedo, squares))


def is_matt_world(scene: kuafu.Scene, is_painted: bool = False) -> bool:
    """Returns whether all materials of a scene reflect by Lambert's law alone, and the scene has no light of its own.
    is_painted: allows albedo textures, for a scene whose only light to trace is the projector's."""
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


def _means(image: NDArray[np.float32], squares: int) -> NDArray[np.float32]:
    """Returns the means over squares x squares pixels; the border's value goes on beyond it."""
    rows, columns = (-n % squares for n in image.shape)
    return means_of_squares(np.pad(image, ((0, rows), (0, columns)), mode="edge"), squares, np.float32)


class Spread(NamedTuple):
    """Smooths images of bounced light in wide pixels and interpolates them to fine pixels, along surfaces.

    wide: the surfaces in wide pixels; `material` is 1 where a pixel sees surface alone, which is not black. nearest:
    for each wide pixel, the index of the nearest such one. focal_px: focal length in wide pixels. weights: for each of
    the four wide pixels around a fine one, (its index, its share of the fine pixel's light [height][width]). sky: the
    share of sky in each fine pixel."""

    wide: MattSurfaces
    nearest: tuple[NDArray, ...]
    focal_px: float
    weights: list[tuple[tuple[NDArray, ...], NDArray[np.float32]]]
    sky: NDArray[np.float32]

    @classmethod
    def of(cls, wide: MattSurfaces, fine: MattSurfaces, focal_px: float) -> Spread:
        is_whole = (wide.covered == 1.0) & (wide.albedo > 0)
        if not is_whole.any():
            is_whole = wide.albedo > 0
        wide = wide._replace(surfaces=wide.surfaces._replace(material=is_whole))
        nearest = distance_transform_edt(~is_whole, return_distances=False, return_indices=True)
        times = round(fine.albedo.shape[0] / wide.albedo.shape[0])  # wide images end after the last fine pixel
        sides = []  # for each axis: (index, linear weight) of the wide pixels before and after each fine one
        for count, most in zip(fine.albedo.shape, wide.albedo.shape, strict=True):
            place = (np.arange(count) + 0.5) / times - 0.5
            before = np.floor(place).astype(int)
            low, high = (np.clip(before + k, 0, most - 1) for k in (0, 1))
            sides.append(((low, 1.0 - (place - before)), (high, place - before)))
        weights = []
        for (rows, of_rows), (columns, of_columns) in product(*sides):
            at = np.ix_(rows, columns)
            weight = np.outer(of_rows, of_columns).astype(np.float32)
            there = wide.surfaces.at(at)
            weight *= np.where(there.material, _LEAST_ALIKE + alike(fine.surfaces, there), _LEAST_ALIKE**2)
            weights.append((at, weight))
        scale = fine.albedo / sum(weight for _, weight in weights)
        scaled = [(at, (weight * scale).astype(np.float32)) for at, weight in weights]
        return cls(wide, tuple(nearest), focal_px, scaled, 1.0 - fine.covered)

    def __call__(self, light: NDArray[np.float32], sky: Sequence[float]) -> NDArray[np.float32]:
        """Spreads images [n][height][width] in wide pixels. sky: the sky's radiance in each of them."""
        wide, of_sky = self.wide, np.array(sky, np.float32)[:, None, None]
        arriving = (light - (1.0 - wide.covered) * of_sky) / np.where(wide.albedo > 0, wide.albedo, 1.0)
        arriving = np.where(wide.surfaces.material, arriving, np.float32(0.0))
        row, column = self.nearest
        smooth = smooth_bounced(arriving, wide.surfaces, self.focal_px)[:, row, column]
        spread = np.sum([smooth[:, at[0], at[1]] * weight for at, weight in self.weights], axis=0, dtype=np.float32)
        return spread + of_sky * self.sky


# Light without the pattern varies only at edges, so it needs fewer samples.
FLAT_SHARE = 0.5


class FirstSurfaces(NamedTuple):
    """Caches the parts of a matt world's images without noise. light: for each camera, (the projector's light after one
    reflection, the same under a pattern that is 1 everywhere). spreads: each camera's interpolation of bounced light.
    seen: images of these surfaces, by the names in SURFACE. pattern: the projector's without dots [height][width]."""

    light: list[tuple[NDArray[np.float32], NDArray[np.float32]]]
    spreads: list[Spread]
    seen: dict[str, NDArray]
    pattern: NDArray[np.float32]


def traced_layers(world: LoadedScene, request: RenderRequest, progress: Progress | None) -> tuple[Layers, ...]:
    """Renders the layers of any world by path tracing. `flat` and `ambient_direct`, light reflected once, are rendered
    again under a pattern that is 1 everywhere."""
    cameras, spp = request.cameras, request.samples_per_pixel
    with world.lit([(copy_record(request.projector), request.pattern)]):
        images = world.images(cameras, LIGHT + GEOMETRY, spp, request.max_bounces, progress, seed=request.seed)
    with world.lit([(copy_record(request.projector), np.ones_like(request.pattern))]):
        few = _share(request, FLAT_SHARE)
        single = world.images(cameras, ("projector_direct", "ambient"), few, 0, seed=request.seed)
    images |= {"flat": single["projector_direct"], "ambient_direct": single["ambient"]}
    out = []
    for view in world.views(images, cameras):
        names = *LIGHT, "flat", "depth"
        direct, indirect, ambient, flat, depth_m = (view[name][..., 0].astype(np.float32) for name in names)
        material, above = view["material_id"][..., 0].copy(), view["ambient_direct"][..., 0].astype(np.float32)
        out.append(Layers(direct, indirect, ambient, flat, depth_m, view["normal"].copy(), material, above))
    return tuple(out)


def matt_layers(
    world: LoadedScene, request: RenderRequest, kept: dict[str, FirstSurfaces],
    progress: Progress | None,
) -> tuple[Layers, ...]:  # fmt: skip
    """Renders the layers of a matt world by geometry and a few samples. kept: a cache of the latest request's first
    surfaces. Its key leaves out the seed, because they have no noise."""
    images, spp, seed = world.images, request.samples_per_pixel, request.seed
    pixels = _pixels(request)
    wide = [_resized(camera, 1.0 / WIDE) for camera in request.cameras]
    bounces = WIDE**2 * BOUNCED_SHARE * float(np.clip(SHARED_PIXELS / pixels, 1.0, MOST_TIMES))
    bounces *= min(1.0, MOST_PIXELS / pixels)
    few = _share(request, bounces)
    room = None if world.room is None else world.room.images(world.renderer, request.cameras, spp, seed=seed)
    sky = ("ambient", "ambient_direct") if room is None else ()
    first = _first_surfaces(world, request, wide, kept)
    with world.lit([(copy_record(request.projector), first.pattern)]):
        bounced = images(wide, ("projector_indirect", *sky), few, request.max_bounces, progress, seed=seed)
    light = [bounced[name] for name in ("projector_indirect", *sky)]

    def layers(i: int) -> Layers:
        spread = first.spreads[i](np.stack([image[i, ..., 0] for image in light]), (0.0, 1.0, 1.0)[: len(light)])
        indirect, ambient, direct_sky = tuple(spread) if room is None else (spread[0], room[i, ..., 0], room[i, ..., 0])
        direct, flat = first.light[i]
        depth_m, normal, material = (first.seen[name][i].copy() for name in SURFACE)
        return Layers(direct, indirect, ambient, flat, depth_m[..., 0], normal, material[..., 0], direct_sky)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return tuple(pool.map(layers, range(len(request.cameras))))


def _first_surfaces(
    world: LoadedScene, request: RenderRequest, wide: list[kuafu.Camera], kept: dict[str, FirstSurfaces]
) -> FirstSurfaces:
    """Returns the first surfaces of a request, from memory or rendered. wide: the cameras of bounced light."""
    key = request_key(replace(request, seed=0), "first surfaces")
    if key not in kept:
        kept.clear()  # both halves of a pose are rendered one after the other
        squares = SQUARES if _pixels(request) <= LARGE_PIXELS else 1
        finer = [_resized(camera, squares) for camera in request.cameras]
        seen, far = world.images(request.cameras, SURFACE, 1, 0), world.images(wide, SURFACE, 1, 0)
        pattern = np.asarray(request.pattern, np.float32)
        with world.lit([(copy_record(request.projector), pattern)]):
            first = world.images(finer, FIRST, 1, 0)
        sigma_px = _DOTS_RAD * request.projector.k[0, 0]
        even = gaussian_filter(pattern, sigma_px, mode="nearest", truncate=2.0)

        def reflected(i: int) -> tuple[NDArray, NDArray]:
            """Returns the projector's light off the first surface for camera i: with the pattern, and with 1."""
            flat, uv = first["albedo"][i, ..., 0] / np.float32(np.pi), first["projector_uv"][i]
            flat = flat * first["projector_geometry"][i, ..., 0] * first["projector_visibility"][i, ..., 0]
            lit, direct = flat > 0, np.zeros_like(flat)
            u, v = uv[lit].T
            direct[lit] = flat[lit] * map_coordinates(pattern, [v, u], np.float32, order=1, mode="grid-constant")
            return _means(direct, squares), _means(flat, squares)

        def spread(i: int) -> Spread:
            at, to = surfaces_of(far, i, wide[i], first), surfaces_of(seen, i, request.cameras[i], first)
            return Spread.of(at, to, wide[i].k[0, 0])

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            light, spreads = pool.map(reflected, range(len(finer))), pool.map(spread, range(len(finer)))
            kept[key] = FirstSurfaces(list(light), list(spreads), seen, even)
    return kept[key]


def _resized(camera: kuafu.Camera, size: float) -> kuafu.Camera:
    """Returns the camera with `size` times as many pixels along each side."""
    width, height = (int(np.ceil(size * side)) for side in (camera.width, camera.height))
    return copy_record(camera, width=width, height=height, k=with_finer_pixels(camera.k, size))


def _pixels(request: RenderRequest) -> int:
    """Returns the number of pixels of the first camera."""
    return request.cameras[0].width * request.cameras[0].height


def _share(request: RenderRequest, share: float) -> int:
    """Returns this share of a request's samples per pixel, at least 1."""
    return max(1, round(share * request.samples_per_pixel))
