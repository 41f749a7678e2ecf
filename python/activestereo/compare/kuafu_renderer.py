# SPDX-License-Identifier: Apache-2.0
"""Renders the known scene with kuafu for comparisons, in the infrared band: under the projector at power 1, and under
ambient radiance 1."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.compare import matt_world
from activestereo.compare.cache import request_key, scene_digest
from activestereo.compare.layers import Layers, RenderRequest, ViewCamera
from activestereo.effects.core.room_light import BOUNCED_VERSION
from activestereo.effects.engines.scene_renderer import GEOMETRY, LIGHT, SceneRenderer, engine_version
from activestereo.effects.engines.smooth import SMOOTH_VERSION

# Light without the pattern varies only at edges, so it needs fewer samples.
_FLAT_SHARE = 0.5
# First surfaces are kept for poses with at most this many pixel squares in all: about 6 poses of 424 x 240.
_KEPT_SQUARES = 25_000_000


class _FirstSurfaces(NamedTuple):
    """Caches the surfaces that a matt world's cameras see first. light: for each camera, (the pattern's light reflected
    there, the same under a pattern that is 1 everywhere). albedo: [camera][height][width][1] at FINER times the
    resolution. seen: images of these surfaces, named in matt_world.SURFACE."""

    light: list[tuple[NDArray[np.float32], NDArray[np.float32]]]
    albedo: NDArray[np.float32]
    seen: dict[str, NDArray]


class _World(NamedTuple):
    """A loaded scene. digest: hash of its files. is_matt: whether all its surfaces are matt (matt_world.py). first: the
    first surfaces of the latest requests, by a key without the seed, because they have no noise."""

    digest: str
    renderer: SceneRenderer
    is_matt: bool
    first: dict[str, _FirstSurfaces]


class KuafuRenderer:
    """Renders RenderRequests. A scene is loaded once and kept; an edited file is loaded again.

    device: 'auto', 'cpu', an index or a kuafu.Device. smooth: filters bounced and ambient light on diffuse surfaces,
    see smooth.py. traced: path-traces matt worlds, too, with the same noise as the engines' own images. Raises
    kuafu.NoDeviceError or kuafu.FileError.
    """

    def __init__(self, device: str | int | kuafu.Device = "auto", smooth: bool = True, traced: bool = False) -> None:
        self._smooth, self._traced = smooth, traced
        self._device = device if isinstance(device, kuafu.Device) else kuafu.Device(device)
        self._world: _World | None = None
        self._one_at_a_time = threading.Lock()
        smoothed = f", smoothed {SMOOTH_VERSION}" if smooth else ""
        way = f"bounced {BOUNCED_VERSION}, {'traced' if traced else f'matt {matt_world.VERSION}'}"
        self.version = f"{engine_version(self._device)}{smoothed}, flat {_FLAT_SHARE}, {way}"

    def __call__(self, request: RenderRequest, progress: Callable[[float], object] | None = None) -> tuple[Layers, ...]:
        """Renders a request; returns one Layers per camera. progress: called as progress(fraction done). Only one
        thread renders at a time; after an error the scene is loaded again."""
        with self._one_at_a_time:
            world = self._load(request)
            with world.renderer.alone():
                if world.is_matt:
                    return _matt_layers(world, request, progress)
                return _traced_layers(world.renderer, request, progress)

    def _load(self, request: RenderRequest) -> _World:
        digest = scene_digest(request.scene_path)
        if self._world is None or digest != self._world.digest:
            renderer = SceneRenderer(request.scene_path, self._device, self._smooth)
            may_be_matt = self._smooth and not self._traced
            is_matt = may_be_matt and matt_world.is_matt_world(renderer.scene, renderer.has_room_light)
            self._world = _World(digest, renderer, is_matt, {})
        return self._world


def _traced_layers(
    world: SceneRenderer, request: RenderRequest, progress: Callable[[float], object] | None
) -> tuple[Layers, ...]:
    """Renders the layers of any world by path tracing. `flat` and `ambient_direct`, light reflected once, are rendered
    again under a pattern that is 1 everywhere."""
    cameras, spp = list(map(_camera, request.cameras)), request.samples_per_pixel
    with world.lit([(_projector(request), request.pattern)]):
        images = world.images(cameras, LIGHT + GEOMETRY, spp, request.max_bounces, progress, seed=request.seed)
    with world.lit([(_projector(request), np.ones_like(request.pattern))]):
        few = _share(request, _FLAT_SHARE)
        single = world.images(cameras, ("projector_direct", "ambient"), few, 0, seed=request.seed)
    images |= {"flat": single["projector_direct"], "ambient_direct": single["ambient"]}
    light = *LIGHT, "flat"

    def layers(view: dict[str, NDArray]) -> Layers:
        direct, indirect, ambient, flat, depth_m = (view[n][..., 0].astype(np.float32) for n in (*light, "depth"))
        material, above = view["material_id"][..., 0].copy(), view["ambient_direct"][..., 0].astype(np.float32)
        return Layers(direct, indirect, ambient, flat, depth_m, view["normal"].copy(), material, above)

    return tuple(map(layers, world.views(images, cameras)))


def _matt_layers(
    world: _World, request: RenderRequest, progress: Callable[[float], object] | None
) -> tuple[Layers, ...]:
    """Renders the layers of a matt world by the method of matt_world.py."""
    images, spp, seed = world.renderer.images, request.samples_per_pixel, request.seed
    wide = [_resized(camera, 1.0 / matt_world.FINER) for camera in request.cameras]
    # Small images get a larger share of samples for bounced light.
    camera = request.cameras[0]
    bounces = matt_world.FINER**2 * matt_world.BOUNCED_SHARE
    bounces *= float(np.clip(matt_world.SHARED_PIXELS / (camera.width * camera.height), 1.0, matt_world.MOST_TIMES))
    few, of_sky = _share(request, bounces), _share(request, matt_world.SKY_SHARE * bounces)
    room = None
    if world.renderer.has_room_light:
        room = world.renderer.room_light(list(map(_camera, request.cameras)), spp, seed=seed)
    even, wider = LIGHT[2:] if room is None else (), list(map(_camera, wide))
    with world.renderer.lit([(_projector(request), request.pattern)]):
        surfaces = matt_world.SURFACE + LIGHT[1:2] + even
        bounced = images(wider, surfaces, few, request.max_bounces, progress, seed=seed)
        sky = images(wider, even, of_sky, 0, seed=seed)["ambient"] if room is None else room
        first = _first_surfaces(world, request)
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


def _first_surfaces(world: _World, request: RenderRequest) -> _FirstSurfaces:
    """Returns the first surfaces of a request, from memory or rendered. The world must be lit by the request's
    projector."""
    key = request_key(replace(request, seed=0), "first surfaces")
    if key not in world.first:
        images, fewer = world.renderer.images, _share(request, matt_world.FINER**2 * matt_world.FIRST_SHARE)
        finer = [_camera(_resized(camera, matt_world.FINER)) for camera in request.cameras]
        seen = images(list(map(_camera, request.cameras)), matt_world.SURFACE, fewer, 0)
        first = images(finer, matt_world.FIRST, fewer, 0)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            light = pool.map(lambda i: matt_world.first_light(first, i, request.pattern), range(len(finer)))
            world.first[key] = _FirstSurfaces(list(light), first["albedo"].copy(), seen)
        while len(world.first) > 1 and sum(known.albedo.size for known in world.first.values()) > _KEPT_SQUARES:
            world.first.pop(next(iter(world.first)))
    return world.first[key]


def _camera(camera: ViewCamera) -> kuafu.Camera:
    return kuafu.Camera(camera.width, camera.height, camera.K, camera.camera_to_world)


def _resized(camera: ViewCamera, size: float) -> ViewCamera:
    """Returns the camera with `size` times as many pixels along each side."""
    K = camera.K.copy()
    K[:2] *= size
    K[:2, 2] += 0.5 * (size - 1.0)  # pixel centres are whole numbers
    width, height = (int(np.ceil(size * side)) for side in (camera.width, camera.height))
    return replace(camera, width=width, height=height, K=K)


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
