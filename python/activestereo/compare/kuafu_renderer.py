# SPDX-License-Identifier: Apache-2.0
"""kuafu as the lab's renderer: the known scene under the projector at power 1 and under ambient radiance 1, infrared
band."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.compare import matt_world
from activestereo.compare.cache import scene_digest
from activestereo.compare.layers import Layers, RenderRequest, ViewCamera
from activestereo.effects.core.room_light import BOUNCED_VERSION
from activestereo.effects.engines.scene_renderer import GEOMETRY, LIGHT, SceneRenderer, engine_version
from activestereo.effects.engines.smooth import SMOOTH_VERSION

# Light without the pattern varies at edges alone: it needs fewer samples.
_FLAT_SHARE = 0.5


class _World(NamedTuple):
    """A loaded scene. is_matt: see matt_world.py."""

    digest: str
    renderer: SceneRenderer
    is_matt: bool


class KuafuRenderer:
    """Renders RenderRequests. A scene is loaded once and kept; an edited file is another scene.

    device: 'auto', 'cpu', an index or a kuafu.Device. smooth: filter bounced and ambient light on diffuse surfaces, see
    smooth.py. traced: matt worlds are path-traced, too, with the noise that the engines' own images have. Raises
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
        """One Layers per camera. progress: called as progress(fraction). One thread at a time; after an error the scene
        is loaded again."""
        with self._one_at_a_time:
            world = self._load(request)
            with world.renderer.alone():
                if world.is_matt:
                    return _matt_layers(world.renderer, request, progress)
                return _traced_layers(world.renderer, request, progress)

    def _load(self, request: RenderRequest) -> _World:
        digest = scene_digest(request.scene_path)
        if self._world is None or digest != self._world.digest:
            renderer = SceneRenderer(request.scene_path, self._device, self._smooth)
            may_be_matt = self._smooth and not self._traced
            is_matt = may_be_matt and matt_world.is_matt_world(renderer.scene, renderer.has_room_light)
            self._world = _World(digest, renderer, is_matt)
        return self._world


def _traced_layers(
    world: SceneRenderer, request: RenderRequest, progress: Callable[[float], object] | None
) -> tuple[Layers, ...]:
    """The layers of any world. Light straight off the first surface is rendered again under a pattern that is 1
    everywhere."""
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
    world: SceneRenderer, request: RenderRequest, progress: Callable[[float], object] | None
) -> tuple[Layers, ...]:
    """The layers of a world as matt_world.py makes them."""
    finer, wide = ([_resized(c, size) for c in request.cameras] for size in (matt_world.FINER, 1.0 / matt_world.FINER))
    bounces = matt_world.bounced_share(request.cameras[0])
    few, of_sky, fewer = (
        _share(request, matt_world.FINER**2 * share)
        for share in (bounces, matt_world.SKY_SHARE * bounces, matt_world.FIRST_SHARE)
    )

    def render(
        cameras: Sequence[ViewCamera], outputs: tuple[str, ...], spp: int, max_bounces: int = 0,
        progress: Callable[[float], object] | None = None,
    ) -> dict[str, NDArray]:  # fmt: skip
        return world.images(list(map(_camera, cameras)), outputs, spp, max_bounces, progress, seed=request.seed)

    spp, seed = request.samples_per_pixel, request.seed
    room = world.room_light(list(map(_camera, request.cameras)), spp, seed=seed) if world.has_room_light else None
    even = LIGHT[2:] if room is None else ()
    with world.lit([(_projector(request), request.pattern)]):
        bounced = render(wide, matt_world.SURFACE + LIGHT[1:2] + even, few, request.max_bounces, progress)
        sky = render(wide, even, of_sky)["ambient"] if room is None else room
        first = render(finer, matt_world.FIRST, fewer)
        seen = render(request.cameras, matt_world.SURFACE, fewer)
    light = [bounced["projector_indirect"], *([bounced["ambient"], sky] if room is None else [])]

    def layers(i: int) -> Layers:
        albedo = first["albedo"][i, ..., 0]
        own = matt_world.surfaces_of(seen, i, request.cameras[i], albedo)
        spread = matt_world.bounced_light(
            np.stack([image[i, ..., 0] for image in light]), matt_world.surfaces_of(bounced, i, wide[i], albedo), own,
            wide[i].K[0, 0],
        )  # fmt: skip
        if room is None:
            indirect, ambient, direct_sky = spread
        else:
            [indirect], ambient, direct_sky = spread, sky[i, ..., 0], sky[i, ..., 0]
        direct, flat = matt_world.first_light(first, i, request.pattern)
        depth_m, normal, material = (seen[name][i].copy() for name in matt_world.SURFACE)
        return Layers(direct, indirect, ambient, flat, depth_m[..., 0], normal, material[..., 0], direct_sky)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return tuple(pool.map(layers, range(len(request.cameras))))


def _camera(camera: ViewCamera) -> kuafu.Camera:
    return kuafu.Camera(camera.width, camera.height, camera.K, camera.camera_to_world)


def _resized(camera: ViewCamera, size: float) -> ViewCamera:
    """The camera with so many times as many pixels along each side."""
    K = camera.K.copy()
    K[:2] *= size
    K[:2, 2] += 0.5 * (size - 1.0)  # pixel centres are whole numbers
    width, height = (int(np.ceil(size * side)) for side in (camera.width, camera.height))
    return replace(camera, width=width, height=height, K=K)


def _share(request: RenderRequest, share: float) -> int:
    """So much of a request's samples per pixel."""
    return max(1, round(share * request.samples_per_pixel))


def _projector(request: RenderRequest) -> kuafu.Light:
    return kuafu.Light(
        kind="projector",
        name="projector",
        k=request.projector_K,
        ir_intensity=1.0,
        light_to_world=request.projector_to_world,
    )
