# SPDX-License-Identifier: Apache-2.0
"""Loads a scene file into kuafu, and renders its infrared images for capture_renderer.py. Its ambient light is even
from all sides, or room light that was measured on each surface.

`activestereo calibrate world` stores such room light as the surfaces' emission, and marks the asset by the extras
{"room_light": "emission"}. The emission contains all bounces, so it lights no other surface. The surfaces of such a
scene are matt, so none mirrors it."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import kuafu
from activestereo.capture.capture import Capture
from activestereo.common.progress_bar import Progress, part_of
from activestereo.effects.core.surfaces import split_surfaces
from activestereo.effects.engines.smooth import smooth_view
from activestereo.scene_io.scene_files import load_scene_file, read_document

# The share of a pixel's samples for bounced light in a room with measured light. Only the projector's light bounces
# there: about a hundredth of its direct light, without dots. A blur over neighbours removes its noise.
BOUNCED_SHARE = 1.0 / 16.0
_SPREAD_PX = 1.5
BOUNCED_VERSION = f"{BOUNCED_SHARE} spread {_SPREAD_PX}"
# Emission has no noise: more samples only cover a pixel's square more evenly.
_MOST_SAMPLES = 4
# Visible and infrared radiance of even ambient light.
_EVEN = (1.0, 1.0, 1.0), 1.0


def has_room_light(scene_path: Path) -> bool:
    """Returns whether a scene file's emission is measured room light."""
    if scene_path.suffix.lower() not in (".gltf", ".glb"):
        return False
    extras = read_document(scene_path).get("asset", {}).get("extras")
    return isinstance(extras, dict) and extras.get("room_light") == "emission"


def is_measured_room(capture: Capture) -> bool:
    """Returns whether `calibrate world` made a capture and two or more of its train views have poses and depth."""
    posed = capture.measured.get("poses", {}).get("frames", [])
    train = [f for f in capture.frames if f.id in posed and f.split == "train" and f.depth_path is not None]
    return len(train) > 1 and has_room_light(capture.scene_path)


class RoomLight:
    """Renders the measured room light of a scene, from a kuafu scene of its own. Its surfaces emit that light and
    reflect nothing."""

    def __init__(self, device: kuafu.Device, scene_path: Path) -> None:
        self._scene = kuafu.Scene(device)
        load_scene_file(self._scene, scene_path)
        for number in range(self._scene.summary.material_count):
            material = self._scene.get_material(number)
            material.base_color, material.ir_albedo = (0.0, 0.0, 0.0, 1.0), 0.0
            material.ir_emission = material.emission[0]  # which glTF has for visible light alone
            self._scene.set_material(number, material)

    def images(self, renderer: kuafu.Renderer, cameras: Sequence[Any], spp: int, **options: Any) -> np.ndarray:
        """Returns radiance [camera][height][width][1] under an ambient scale of 1. No light is sampled, since the first
        hit emits all of it."""
        room = renderer.render(
            self._scene, cameras, ("ambient",), band="infrared", max_bounces=0, light_sampling="bsdf",
            spp=min(spp, _MOST_SAMPLES), **options,
        )  # fmt: skip
        return np.asarray(room["ambient"])


def light_by_room(scene: kuafu.Scene, device: kuafu.Device, scene_path: Path) -> RoomLight | None:
    """Sets the ambient light of a loaded scene. With measured room light in the file the ambient light is 0, and the
    result is the RoomLight that renders it. Otherwise the ambient light is 1 from all sides, and the result is None."""
    if not has_room_light(scene_path):
        scene.set_environment(*_EVEN)
        return None
    scene.set_environment((0.0, 0.0, 0.0), ir_radiance=0.0)
    for number in range(scene.summary.material_count):
        material = scene.get_material(number)
        material.emission, material.ir_emission, material.emission_texture = (0.0, 0.0, 0.0), 0.0, None
        scene.set_material(number, material)
    return RoomLight(device, scene_path)


LIGHT = ("projector_direct", "projector_indirect", "ambient")
GEOMETRY = ("depth", "normal", "position", "material_id")
_NOTHING_HIT = 0xFFFFFFFF


class LoadedScene:
    """A scene file whose only light is ambient: 1 from all sides, or the room's measured light. smooth: filters bounced
    and ambient light on matt surfaces, see smooth.py. Raises kuafu.FileError."""

    def __init__(self, scene_path: Path, device: kuafu.Device, smooth: bool) -> None:
        self.renderer, self.scene = kuafu.Renderer(device), kuafu.Scene(device)
        self._smooth = smooth
        load_scene_file(self.scene, scene_path)
        split_surfaces(self.scene, scene_path)
        self.room = light_by_room(self.scene, device, scene_path)

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

    @contextmanager
    def dark(self) -> Iterator[None]:
        """Removes the even ambient light while the context lasts."""
        self.scene.set_environment((0.0, 0.0, 0.0), ir_radiance=0.0)
        try:
            yield
        finally:
            if self.room is None:
                self.scene.set_environment(*_EVEN)

    def images(
        self,
        cameras: Sequence[kuafu.Camera],
        outputs: Sequence[str],
        samples_per_pixel: int,
        max_bounces: int,
        progress: Progress | None = None,
        keeps_surfaces: bool = True,
        environments: Sequence[int] | None = None,
        **options: Any,
    ) -> dict[str, NDArray]:
        """Renders {output: [camera][height][width][channels]}. keeps_surfaces: whether all surfaces reflect as in the
        file. In a room with measured light they are then matt, so bounced light takes fewer samples. options: as of
        kuafu.Renderer.render()."""
        images: dict[str, NDArray] = {}
        passes = [(tuple(outputs), max_bounces, samples_per_pixel)]
        if self.room is not None and keeps_surfaces and max_bounces > 0:
            # Bounced light is the projector's alone, by matt surfaces, so a few samples are enough.
            bounced = tuple(name for name in outputs if name in LIGHT[1:])
            few = max(1, round(BOUNCED_SHARE * samples_per_pixel))
            first = tuple(name for name in outputs if name not in bounced)
            passes = [p for p in ((first, 0, samples_per_pixel), (bounced, max_bounces, few)) if p[0]]
        for done, (names, bounces, samples) in enumerate(passes):
            share = part_of(progress, done / len(passes), (done + 1) / len(passes))
            images |= self.renderer.render(
                self.scene, cameras, names, band="infrared", max_bounces=bounces, spp=samples, progress=share,
                environments=environments, **options,
            )  # fmt: skip
        if len(passes) > 1:
            across = 0.0, _SPREAD_PX, _SPREAD_PX, 0.0
            images["projector_indirect"] = gaussian_filter(images["projector_indirect"], across, mode="nearest")
        if self.room is not None and "ambient" in images:
            room = self.room.images(self.renderer, cameras, samples_per_pixel, **options)
            images["ambient"] = images["ambient"] + room
        return images

    def views(self, images: Mapping[str, NDArray], cameras: Sequence[kuafu.Camera]) -> list[dict[str, NDArray]]:
        """Splits rendered images by camera: returns {output: [height][width][channels]} for each. They are filtered if
        `smooth` was set."""
        views = [{name: image[k] for name, image in images.items()} for k in range(len(cameras))]
        if not self._smooth:
            return views
        # Only one thread may read a scene, so its materials are read before several threads filter images.
        seen = [int(m) for m in np.unique(images["material_id"]) if m != _NOTHING_HIT]
        surfaces = {m: self.scene.get_material(m) for m in seen}
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return list(pool.map(lambda view, camera: smooth_view(view, camera, surfaces), views, cameras))


def engine_version(device: kuafu.Device) -> str:
    """Returns a text that changes with the library's code and the device: only one device gives the same bits."""
    return f"kuafu {kuafu.__version__} {_library_digest()} on {device.info.name}"


@cache
def _library_digest() -> str:
    """Returns a short hash of the loaded libkuafu, so that no cached picture outlives the code that made it."""
    maps = Path("/proc/self/maps").read_text(encoding="utf-8").split("\n")
    paths = sorted({line.split(maxsplit=5)[5] for line in maps if "/libkuafu.so" in line})
    return hashlib.sha256(b"".join(Path(path).read_bytes() for path in paths)).hexdigest()[:12]
