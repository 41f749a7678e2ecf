# SPDX-License-Identifier: Apache-2.0
"""Renders the layers of a loaded scene's base model: under the projector at power 1, and under ambient radiance 1."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.lens import with_finer_pixels
from activestereo.effects.core.layers import Layers
from activestereo.effects.engines import matt_world
from activestereo.effects.engines.layers import RenderRequest, ViewCamera, request_key
from activestereo.effects.engines.loaded_scene import GEOMETRY, LIGHT, LoadedScene

# Light without the pattern varies only at edges, so it needs fewer samples.
FLAT_SHARE = 0.5
# First surfaces are kept for poses with at most this many pixel squares in all: about 6 poses of 424 x 240.
_KEPT_SQUARES = 25_000_000


class FirstSurfaces(NamedTuple):
    """Caches the surfaces that a matt world's cameras see first. light: for each camera, (the pattern's light reflected
    there, the same under a pattern that is 1 everywhere). albedo: [camera][height][width][1] at FINER times the
    resolution. seen: images of these surfaces, named in matt_world.SURFACE."""

    light: list[tuple[NDArray[np.float32], NDArray[np.float32]]]
    albedo: NDArray[np.float32]
    seen: dict[str, NDArray]


def traced_layers(
    world: LoadedScene, request: RenderRequest, progress: Callable[[float], object] | None
) -> tuple[Layers, ...]:
    """Renders the layers of any world by path tracing. `flat` and `ambient_direct`, light reflected once, are rendered
    again under a pattern that is 1 everywhere."""
    cameras, spp = list(map(_camera, request.cameras)), request.samples_per_pixel
    with world.lit([(_projector(request), request.pattern)]):
        images = world.images(cameras, LIGHT + GEOMETRY, spp, request.max_bounces, progress, seed=request.seed)
    with world.lit([(_projector(request), np.ones_like(request.pattern))]):
        few = _share(request, FLAT_SHARE)
        single = world.images(cameras, ("projector_direct", "ambient"), few, 0, seed=request.seed)
    images |= {"flat": single["projector_direct"], "ambient_direct": single["ambient"]}
    light = *LIGHT, "flat"

    def layers(view: dict[str, NDArray]) -> Layers:
        direct, indirect, ambient, flat, depth_m = (view[n][..., 0].astype(np.float32) for n in (*light, "depth"))
        material, above = view["material_id"][..., 0].copy(), view["ambient_direct"][..., 0].astype(np.float32)
        return Layers(direct, indirect, ambient, flat, depth_m, view["normal"].copy(), material, above)

    return tuple(map(layers, world.views(images, cameras)))


def matt_layers(
    world: LoadedScene, request: RenderRequest, kept: dict[str, FirstSurfaces],
    progress: Callable[[float], object] | None,
) -> tuple[Layers, ...]:  # fmt: skip
    """Renders the layers of a matt world by the method of matt_world.py. kept: the first surfaces of the latest
    requests, by a key without the seed, because they have no noise."""
    images, spp, seed = world.images, request.samples_per_pixel, request.seed
    wide = [_resized(camera, 1.0 / matt_world.FINER) for camera in request.cameras]
    # Small images get a larger share of samples for bounced light.
    camera = request.cameras[0]
    bounces = matt_world.FINER**2 * matt_world.BOUNCED_SHARE
    bounces *= float(np.clip(matt_world.SHARED_PIXELS / (camera.width * camera.height), 1.0, matt_world.MOST_TIMES))
    few, of_sky = _share(request, bounces), _share(request, matt_world.SKY_SHARE * bounces)
    room = None
    if world.has_room_light:
        room = world.room_light(list(map(_camera, request.cameras)), spp, seed=seed)
    even, wider = LIGHT[2:] if room is None else (), list(map(_camera, wide))
    with world.lit([(_projector(request), request.pattern)]):
        surfaces = matt_world.SURFACE + LIGHT[1:2] + even
        bounced = images(wider, surfaces, few, request.max_bounces, progress, seed=seed)
        sky = images(wider, even, of_sky, 0, seed=seed)["ambient"] if room is None else room
        first = _first_surfaces(world, request, kept)
    light = [bounced["projector_indirect"], *([bounced["ambient"], sky] if room is None else [])]

    def layers(i: int) -> Layers:
        albedo = first.albedo[i, ..., 0]
        own = matt_world.surfaces_of(first.seen, i, request.cameras[i], albedo)
        spread = matt_world.bounced_light(
            np.stack([image[i, ..., 0] for image in light]), matt_world.surfaces_of(bounced, i, wide[i], albedo), own,
            wide[i].K[0, 0],
        )  # fmt: skip
        if room is None:
            indirect, ambient, direct_sky = spread
        else:
            [indirect], ambient, direct_sky = spread, sky[i, ..., 0], sky[i, ..., 0]
        direct, flat = first.light[i]
        depth_m, normal, material = (first.seen[name][i].copy() for name in matt_world.SURFACE)
        return Layers(direct, indirect, ambient, flat, depth_m[..., 0], normal, material[..., 0], direct_sky)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return tuple(pool.map(layers, range(len(request.cameras))))


def _first_surfaces(world: LoadedScene, request: RenderRequest, kept: dict[str, FirstSurfaces]) -> FirstSurfaces:
    """Returns the first surfaces of a request, from memory or rendered. The world must be lit by the request's
    projector."""
    key = request_key(replace(request, seed=0), "first surfaces")
    if key not in kept:
        finer = [_camera(_resized(camera, matt_world.FINER)) for camera in request.cameras]
        seen = world.images(list(map(_camera, request.cameras)), matt_world.SURFACE, 1, 0)
        first = world.images(finer, matt_world.FIRST, 1, 0)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            light = pool.map(lambda i: matt_world.first_light(first, i, request.pattern), range(len(finer)))
            kept[key] = FirstSurfaces(list(light), first["albedo"].copy(), seen)
        while len(kept) > 1 and sum(known.albedo.size for known in kept.values()) > _KEPT_SQUARES:
            kept.pop(next(iter(kept)))
    return kept[key]


def _camera(camera: ViewCamera) -> kuafu.Camera:
    return kuafu.Camera(camera.width, camera.height, camera.K, camera.camera_to_world)


def _resized(camera: ViewCamera, size: float) -> ViewCamera:
    """Returns the camera with `size` times as many pixels along each side."""
    width, height = (int(np.ceil(size * side)) for side in (camera.width, camera.height))
    return replace(camera, width=width, height=height, K=with_finer_pixels(camera.K, size))


def _share(request: RenderRequest, share: float) -> int:
    """Returns this share of a request's samples per pixel, at least 1."""
    return max(1, round(share * request.samples_per_pixel))


def _projector(request: RenderRequest) -> kuafu.Light:
    return kuafu.Light(
        kind="projector",
        name="projector",
        k=request.projector_K,
        ir_intensity=1.0,
        light_to_world=request.projector_to_world,
    )
