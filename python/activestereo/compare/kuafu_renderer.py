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
    None before it is placed; room: the room's light where it was measured."""

    digest: str
    pattern: np.ndarray
    scene: kuafu.Scene
    texture: int
    white: int
    light: int | None = None
    room: RoomLight | None = None


class KuafuRenderer:
    """Renders RenderRequests. A scene is loaded once and kept; the projector moves from request to request.

    device: 'auto', 'cpu', an index or a kuafu.Device. smooth: filter bounced and ambient light on diffuse surfaces, see
    smooth.py. Raises kuafu.NoDeviceError or kuafu.FileError.
    """

    def __init__(self, device: str | int | kuafu.Device = "auto", smooth: bool = True) -> None:
        self._smooth = smooth
        self._device = device if isinstance(device, kuafu.Device) else kuafu.Device(device)
        self._renderer = kuafu.Renderer(self._device)
        self._world: _World | None = None
        self._one_at_a_time = threading.Lock()
        smoothed = f", smoothed {SMOOTH_VERSION}" if smooth else ""
        # Changes with the library's code and the device: pixels are the same bits on one device only.
        self.version = f"{engine_version(self._device)}{smoothed}, flat {_FLAT_SHARE}, bounced {BOUNCED_VERSION} wide"

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
        cameras = [kuafu.Camera(c.width, c.height, c.K, c.camera_to_world) for c in request.cameras]
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

    def _bounced(
        self, world: _World, request: RenderRequest, progress: Callable[[float], object] | None
    ) -> np.ndarray:
        """The projector's light by way of matt surfaces, [camera][height][width][1]: faint and without dots, so that
        pixels of twice the width do, and their neighbours' mean."""
        wide = [_of_wide_pixels(camera) for camera in request.cameras]
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
        self._world = _World(digest, request.pattern, scene, texture, white, room=room)
        return self._world


def _of_wide_pixels(camera: ViewCamera) -> kuafu.Camera:
    """The camera with pixels that each cover two by two of its own."""
    K = camera.K.copy()
    K[:2] /= 2.0
    K[:2, 2] -= 0.25  # pixel centres are whole numbers
    return kuafu.Camera((camera.width + 1) // 2, (camera.height + 1) // 2, K, camera.camera_to_world)


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
