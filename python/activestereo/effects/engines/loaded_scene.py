# SPDX-License-Identifier: Apache-2.0
"""Loads a scene file into kuafu, and renders images of its light in the infrared band for capture_renderer.py."""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.progress_bar import part_of
from activestereo.effects.core.room_light import BOUNCED_SHARE, light_by_room, spread
from activestereo.effects.core.scene_surfaces import split_surfaces
from activestereo.effects.engines.smooth import smooth_view
from activestereo.scene_io.scene_files import load_scene_file

LIGHT = ("projector_direct", "projector_indirect", "ambient")
GEOMETRY = ("depth", "normal", "position", "material_id")
_NOTHING_HIT = 0xFFFFFFFF


class LoadedScene:
    """A scene file whose ambient light is 1 from all sides, or the room's measured light; it has no other
    light.

    smooth: filters bounced and ambient light on matt surfaces, see smooth.py. Raises kuafu.FileError.
    """

    def __init__(self, scene_path: Path, device: kuafu.Device, smooth: bool) -> None:
        self.device = device
        self._renderer = kuafu.Renderer(self.device)
        self._path, self._smooth = scene_path, smooth
        self._one_at_a_time, self._is_changed = threading.Lock(), False
        self._load()

    def _load(self) -> None:
        self.scene = kuafu.Scene(self.device)
        load_scene_file(self.scene, self._path)
        split_surfaces(self.scene, self._path)
        self._room = light_by_room(self.scene, self.device, self._path)

    @property
    def has_room_light(self) -> bool:
        """Returns whether the file's ambient light was measured on each surface (room_light.py)."""
        return self._room is not None

    def room_light(self, cameras: Sequence[kuafu.Camera], samples_per_pixel: int, **options: Any) -> NDArray:
        """Returns the measured ambient light of a scene with has_room_light, [camera][height][width][1]."""
        assert self._room is not None
        return self._room.images(self._renderer, cameras, samples_per_pixel, **options)

    @contextmanager
    def alone(self) -> Iterator[kuafu.Scene]:
        """Gives the scene to one thread at a time. After an error the next call loads a new scene, since changes may be
        left in the old one."""
        with self._one_at_a_time:
            if self._is_changed:
                self._load()
            self._is_changed = True
            yield self.scene
            self._is_changed = False

    @contextmanager
    def lit(self, lights: Iterable[tuple[kuafu.Light, NDArray | None]]) -> Iterator[None]:
        """Adds lights to the scene while the context lasts; each comes with its projector's pattern or None."""
        numbers: list[int] = []
        textures: dict[bytes, int] = {}
        try:
            for light, pattern in lights:
                if pattern is not None:
                    content = np.ascontiguousarray(pattern, dtype=np.float32)
                    if (key := content.tobytes()) not in textures:
                        textures[key] = self.scene.add_texture(content, name="pattern")
                    light.texture = textures[key]
                numbers.append(self.scene.add_light(light))
            yield
        finally:
            for number in numbers:
                self.scene.remove_light(number)
            for texture in textures.values():
                self.scene.remove_texture(texture)

    def images(
        self,
        cameras: Sequence[kuafu.Camera],
        outputs: Sequence[str],
        samples_per_pixel: int,
        max_bounces: int,
        progress: Callable[[float], object] | None = None,
        keeps_surfaces: bool = True,
        environments: Sequence[int] | None = None,
        **options: Any,
    ) -> dict[str, NDArray]:
        """Renders {output: [camera][height][width][channels]}. keeps_surfaces: whether all surfaces reflect as in the
        file. In a room with measured light they are then matt, so bounced light takes fewer samples. options: as of
        kuafu.Renderer.render()."""
        images: dict[str, NDArray] = {}
        passes = [(tuple(outputs), max_bounces, samples_per_pixel)]
        if self._room is not None and keeps_surfaces and max_bounces > 0:
            # Bounced light is the projector's alone, by matt surfaces, so a few samples are enough.
            bounced = tuple(name for name in outputs if name in LIGHT[1:])
            few = max(1, round(BOUNCED_SHARE * samples_per_pixel))
            first = tuple(name for name in outputs if name not in bounced)
            passes = [(first, 0, samples_per_pixel), (bounced, max_bounces, few)]
        for done, (names, bounces, samples) in enumerate(passes):
            share = part_of(progress, done / len(passes), (done + 1) / len(passes))
            images |= self._renderer.render(
                self.scene, cameras, names, band="infrared", max_bounces=bounces, spp=samples, progress=share,
                environments=environments, **options,
            )  # fmt: skip
        if len(passes) > 1:
            images["projector_indirect"] = spread(images["projector_indirect"])
        if self._room is not None and "ambient" in images:
            images["ambient"] = images["ambient"] + self.room_light(cameras, samples_per_pixel, **options)
        return images

    def views(self, images: Mapping[str, NDArray], cameras: Sequence[kuafu.Camera]) -> list[dict[str, NDArray]]:
        """Splits rendered images by camera: returns {output: [height][width][channels]} each, filtered if the renderer
        smooths."""
        views = [{name: image[k] for name, image in images.items()} for k in range(len(cameras))]
        if not self._smooth:
            return views
        # Only one thread may read a scene, so its materials are read before several threads filter images.
        seen = [int(m) for m in np.unique(images["material_id"]) if m != _NOTHING_HIT]
        surfaces = {m: self.scene.get_material(m) for m in seen}
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return list(pool.map(lambda view, camera: smooth_view(view, camera, surfaces), views, cameras))


def engine_version(device: kuafu.Device) -> str:
    """Returns a text that changes with the library's code and the device: pixels are the same bits on one
    device only."""
    return f"kuafu {kuafu.__version__} {_library_digest()} on {device.info.name}"


@cache
def _library_digest() -> str:
    """Returns a short hash of the loaded libkuafu's content, so that no cached picture outlives the code that
    made it."""
    maps = Path("/proc/self/maps").read_text(encoding="utf-8").split("\n")
    paths = sorted({line.split(maxsplit=5)[5] for line in maps if "/libkuafu.so" in line})
    return hashlib.sha256(b"".join(Path(path).read_bytes() for path in paths)).hexdigest()[:12]
