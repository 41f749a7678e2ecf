# SPDX-License-Identifier: Apache-2.0
"""kuafu as the lab's renderer: the known scene under the projector at power 1 and under ambient radiance 1, infrared
band."""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import kuafu
from activestereo.compare import matt_world
from activestereo.compare.cache import scene_digest
from activestereo.compare.layers import Layers, RenderRequest, ViewCamera
from activestereo.effects.core.room_light import BOUNCED_SHARE, BOUNCED_VERSION, RoomLight, light_by_room, spread
from activestereo.effects.core.scene_surfaces import split_surfaces
from activestereo.effects.engines.smooth import SMOOTH_VERSION
from activestereo.effects.engines.smoothing import is_matt_surface, seen_surfaces, smooth_light
from activestereo.scene_io.scene_files import load_scene_file

# Light without the pattern varies at edges alone: it needs fewer samples.
_FLAT_SHARE = 0.5
_BOUNCED = ("projector_indirect", "ambient")
_FIRST_HIT = ("projector_direct", "depth", "normal", "material_id")


@dataclass
class _World:
    """A loaded scene. texture, white: its nominal pattern and one that is 1 everywhere; light: the projector's number,
    None before it is placed; room: the room's light where it was measured; is_matt: see matt_world.py."""

    digest: str
    pattern: np.ndarray
    scene: kuafu.Scene
    texture: int
    white: int
    light: int | None = None
    room: RoomLight | None = None
    is_matt: bool = False


class KuafuRenderer:
    """Renders RenderRequests. A scene is loaded once and kept; the projector moves from request to request.

    device: 'auto', 'cpu', an index or a kuafu.Device. smooth: filter bounced and ambient light on diffuse surfaces, see
    smooth.py. traced: matt worlds are path-traced, too, with the noise that the engines' own images have. Raises
    kuafu.NoDeviceError or kuafu.FileError.
    """

    def __init__(self, device: str | int | kuafu.Device = "auto", smooth: bool = True, traced: bool = False) -> None:
        self._smooth, self._traced = smooth, traced
        self._device = device if isinstance(device, kuafu.Device) else kuafu.Device(device)
        self._renderer = kuafu.Renderer(self._device)
        self._world: _World | None = None
        self._one_at_a_time = threading.Lock()
        smoothed = f", smoothed {SMOOTH_VERSION}" if smooth else ""
        # Changes with the library's code and the device: pixels are the same bits on one device only.
        wide = f"bounced {BOUNCED_VERSION} wide, {'traced' if traced else f'matt {matt_world.VERSION}'}"
        self.version = f"{engine_version(self._device)}{smoothed}, flat {_FLAT_SHARE}, {wide}"

    def __call__(self, request: RenderRequest, progress: Callable[[float], object] | None = None) -> tuple[Layers, ...]:
        """One Layers per camera. progress: called as progress(fraction). One thread at a time; after an error the scene
        is loaded again."""
        with self._one_at_a_time:
            try:
                return self._rendered(request, progress)
            except BaseException:
                self._world = None
                raise

    def _rendered(self, request: RenderRequest, progress: Callable[[float], object] | None) -> tuple[Layers, ...]:
        world = self._load(request)
        if world.is_matt and not self._traced:
            return self._of_matt_world(world, request, progress)
        cameras = list(map(_camera, request.cameras))
        _place_projector(world, request, world.white)
        fewer = _with_share_of_samples(request, _FLAT_SHARE)
        single = self._render(world, fewer, cameras, ("projector_direct", "ambient"), 0, None)
        _place_projector(world, request, world.texture)
        if world.room is None:
            images = self._render(world, request, cameras, _FIRST_HIT + _BOUNCED, request.max_bounces, progress)
        else:
            few = _with_share_of_samples(request, 4.0 * BOUNCED_SHARE)  # a pixel of twice the width is four
            images = dict(self._render(world, request, cameras, _FIRST_HIT, 0, None))
            images["projector_indirect"] = self._bounced(world, few, progress)
            room = world.room.images(self._renderer, cameras, few.samples_per_pixel, seed=request.seed)
            images["ambient"], single = room, {**single, "ambient": room}
        surfaces = seen_surfaces(world.scene, images["material_id"]) if self._smooth else {}
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            layers = lambda i: self._layers(surfaces, images, single, i, request.cameras[i])  # noqa: E731
            return tuple(pool.map(layers, range(len(cameras))))

    def _of_matt_world(
        self, world: _World, request: RenderRequest, progress: Callable[[float], object] | None
    ) -> tuple[Layers, ...]:
        """The layers of a world as matt_world.py makes them."""
        finer, wide = (
            [_resized(c, size) for c in request.cameras] for size in (matt_world.FINER, 1.0 / matt_world.FINER)
        )
        few, fewer = (
            _with_share_of_samples(request, matt_world.FINER**2 * share)
            for share in (matt_world.bounced_share(request.cameras[0]), matt_world.FIRST_SHARE)
        )
        _place_projector(world, request, world.texture)
        bounced = self._render(
            world, few, list(map(_camera, wide)), matt_world.SURFACE + _BOUNCED, request.max_bounces, progress
        )
        sky = self._render(world, few, list(map(_camera, wide)), _BOUNCED[1:], 0, None)
        first = self._render(world, fewer, list(map(_camera, finer)), matt_world.FIRST, 0, None)
        seen = self._render(world, fewer, list(map(_camera, request.cameras)), matt_world.SURFACE, 0, None)
        light = np.stack([bounced["projector_indirect"], bounced["ambient"], sky["ambient"]])[..., 0]

        def layers(i: int) -> Layers:
            albedo = first["albedo"][i, ..., 0]
            own = matt_world.surfaces_of(seen, i, request.cameras[i], albedo)
            indirect, ambient, direct_sky = matt_world.bounced_light(
                light[:, i], matt_world.surfaces_of(bounced, i, wide[i], albedo), own, wide[i].K[0, 0]
            )
            direct, flat = matt_world.first_light(first, i, request.pattern)
            depth_m, normal, material = (seen[name][i].copy() for name in matt_world.SURFACE)
            return Layers(direct, indirect, ambient, flat, depth_m[..., 0], normal, material[..., 0], direct_sky)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return tuple(pool.map(layers, range(len(request.cameras))))

    def _bounced(self, world: _World, request: RenderRequest, progress: Callable[[float], object] | None) -> np.ndarray:
        """The projector's light by way of matt surfaces, [camera][height][width][1]: faint and without dots, so that
        pixels of twice the width do, and their neighbours' mean."""
        wide = [_camera(_resized(camera, 0.5)) for camera in request.cameras]
        light = self._render(world, request, wide, _BOUNCED[:1], request.max_bounces, progress)["projector_indirect"]
        height, width = request.cameras[0].height, request.cameras[0].width
        return spread(light, 2.0).repeat(2, axis=1).repeat(2, axis=2)[:, :height, :width]

    def _layers(
        self,
        surfaces: Mapping[int, kuafu.Material],
        images: Mapping[str, np.ndarray],
        single: Mapping[str, np.ndarray],
        i: int,
        camera: Any,
    ) -> Layers:
        """The rendered layers of one camera. single: light straight off the first surface, under a pattern that is 1
        everywhere."""
        depth_m, normal, material = (
            images["depth"][i, ..., 0].copy(),
            images["normal"][i].copy(),
            images["material_id"][i, ..., 0].copy(),
        )
        bounced = {name: images[name][i, ..., 0] for name in ("projector_indirect", "ambient")}
        bounced |= {"ambient_direct": single["ambient"][i, ..., 0]}
        if any(map(is_matt_surface, surfaces.values())):
            bounced |= _smoothed(surfaces, bounced, depth_m, normal, material, camera)
        direct = images["projector_direct"][i, ..., 0].copy()
        indirect, ambient, ambient_direct = (image.astype(np.float32) for image in bounced.values())
        flat = single["projector_direct"][i, ..., 0].copy()
        return Layers(direct, indirect, ambient, flat, depth_m, normal, material, ambient_direct)

    def _render(
        self,
        world: _World,
        request: RenderRequest,
        cameras: Sequence[kuafu.Camera],
        outputs: Sequence[str],
        max_bounces: int,
        progress: Callable[[float], object] | None,
    ) -> Mapping[str, np.ndarray]:
        return self._renderer.render(
            world.scene,
            cameras,
            outputs,
            band="infrared",
            spp=request.samples_per_pixel,
            max_bounces=max_bounces,
            seed=request.seed,
            progress=progress,
        )

    def _load(self, request: RenderRequest) -> _World:
        """The scene and its two patterns. An edited file is another scene."""
        digest, world = scene_digest(request.scene_path), self._world
        if world is not None and digest == world.digest and np.array_equal(request.pattern, world.pattern):
            return world
        scene = kuafu.Scene(self._device)
        load_scene_file(scene, request.scene_path)
        split_surfaces(scene, request.scene_path)
        room = light_by_room(scene, self._device, request.scene_path)
        texture = scene.add_texture(request.pattern, name="pattern")
        white = scene.add_texture(np.ones_like(request.pattern), name="white pattern")
        is_matt = self._smooth and room is None and matt_world.is_matt_world(scene)
        self._world = _World(digest, request.pattern, scene, texture, white, room=room, is_matt=is_matt)
        return self._world


def _camera(camera: ViewCamera) -> kuafu.Camera:
    return kuafu.Camera(camera.width, camera.height, camera.K, camera.camera_to_world)


def _resized(camera: ViewCamera, size: float) -> ViewCamera:
    """The camera with so many times as many pixels along each side."""
    K = camera.K.copy()
    K[:2] *= size
    K[:2, 2] += 0.5 * (size - 1.0)  # pixel centres are whole numbers
    width, height = (int(np.ceil(size * side)) for side in (camera.width, camera.height))
    return ViewCamera(width, height, K, camera.camera_to_world)


def _with_share_of_samples(request: RenderRequest, share: float) -> RenderRequest:
    return replace(request, samples_per_pixel=max(1, round(share * request.samples_per_pixel)))


def _place_projector(world: _World, request: RenderRequest, texture: int) -> None:
    light = kuafu.Light(
        kind="projector",
        name="projector",
        texture=texture,
        k=request.projector_K,
        ir_intensity=1.0,
        light_to_world=request.projector_to_world,
    )
    if world.light is None:
        world.light = world.scene.add_light(light)
    else:
        world.scene.set_light(world.light, light)


def _smoothed(
    surfaces: Mapping[int, kuafu.Material],
    bounced: dict[str, np.ndarray],
    depth_m: np.ndarray,
    normal: np.ndarray,
    material: np.ndarray,
    camera: Any,
) -> dict[str, np.ndarray]:
    column, row = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    y = (row - camera.K[1, 2]) / camera.K[1, 1]
    x = (column - camera.K[0, 2] - camera.K[0, 1] * y) / camera.K[0, 0]
    points = np.stack([x * depth_m, y * depth_m, depth_m], axis=-1)
    in_camera = normal @ camera.camera_to_world[:3, :3]
    return smooth_light(bounced, depth_m, in_camera, points, material, camera.K[0, 0], surfaces)


def engine_version(device: kuafu.Device) -> str:
    """Changes with the library's code and the device: pixels are the same bits on one device only."""
    return f"kuafu {kuafu.__version__} {_library_digest()} on {device.info.name}"


@cache
def _library_digest() -> str:
    """Short content hash of the loaded libkuafu, so that no cached picture outlives the code that made it."""
    maps = Path("/proc/self/maps").read_text(encoding="utf-8").split("\n")
    paths = sorted({line.split(maxsplit=5)[5] for line in maps if "/libkuafu.so" in line})
    return hashlib.sha256(b"".join(Path(path).read_bytes() for path in paths)).hexdigest()[:12]
