# SPDX-License-Identifier: Apache-2.0
"""Cuts pictures of an object out of a capture, and renders the same views under any materials. Each light is rendered
alone, so that intensities follow by linear least squares. Infrared images are in DN; colour images are made linear (IEC
61966-2-1) and stay 0..1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

import kuafu
from activestereo.capture.capture import Camera, Capture, Frame
from activestereo.common import srgb
from activestereo.effects.core.scene_surfaces import split_surfaces
from activestereo.scene_io.scene_files import load_scene_file

_MARGIN = 0.35  # share of the object's size around it; the known material there gives the lights' brightness
_LARGEST_PX = 72  # pictures are averaged down to this
_GROUPS = 4
_SATURATED = 0.97
# Model errors besides noise: a share of the light, and a shift in pixels of the object, its edges and the dots.
_OFF_SHARE, _OFF_PX = 0.03, 0.1
_NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)[..., None]


@dataclass(frozen=True)
class Picture:
    """A recorded picture of the object and its surroundings. seen: float32 [height, width, channel]. usable: mask of
    unsaturated pixels. sigma: standard deviation of noise and model error, as seen. lit: whether the projector was on.
    surface: [height, width], 1 + index of the object's surface, 0 around it."""

    name: str
    band: Literal["infrared", "visible"]
    lit: bool
    seen: NDArray[np.float32]
    usable: NDArray[np.bool_]
    sigma: NDArray[np.float32]
    camera: kuafu.Camera
    pose: NDArray[np.float64]
    surface: NDArray[np.int64]


class MaterialScene:
    """The capture's scene with its projector and lamps. Its materials may be changed."""

    def __init__(self, capture: Capture, device: str | int | kuafu.Device = "auto", max_bounces: int = 6) -> None:
        self._device = device if isinstance(device, kuafu.Device) else kuafu.Device(device)
        self._renderer, self.scene = kuafu.Renderer(self._device), kuafu.Scene(self._device)
        self._capture, self._bounces = capture, max_bounces
        load_scene_file(self.scene, capture.scene_path)
        split_surfaces(self.scene, capture.scene_path)
        self.scene.set_environment((1.0, 1.0, 1.0), ir_radiance=1.0, light_group=0)
        # Each lamp has a group of its own, as far as there are groups; the fit finds their colours.
        lamps = 0
        for number in range(self.scene.summary.light_count):
            lamp = self.scene.get_light(number)
            lamp.light_group, lamps = 1 + min(lamps, _GROUPS - 2), lamps + 1
            brightest = max(lamp.intensity)
            lamp.intensity, lamp.ir_intensity = (brightest, brightest, brightest), brightest
            self.scene.set_light(number, lamp)
        for known in capture.lights:
            pose = np.eye(4)
            pose[:3, 3] = known.position_m
            lamp = kuafu.Light(kind="point", intensity=(1.0, 1.0, 1.0), ir_intensity=1.0, radius_m=known.radius_m)
            lamp.light_to_world, lamp.light_group = pose, 1 + min(lamps, _GROUPS - 2)
            lamps += 1
            self.scene.add_light(lamp)
        self.group_count = 1 + min(lamps, _GROUPS - 1)
        projector = capture.rig.projector
        texture = self.scene.add_texture(projector.pattern(), name="pattern")
        self._projector = kuafu.Light(kind="projector", ir_intensity=1.0, texture=texture, k=projector.K)
        self._projector_id = self.scene.add_light(self._projector)

    def lights(self, picture: Picture, samples: int, seed: int) -> NDArray[np.float32]:
        """Renders a picture's view under each light alone, [height, width, channel, light]. The first light is the
        projector, 0 if it was off or is not visible. Then come each group of lamps and the room, and a constant for the
        black level."""
        to_projector = self._capture.rig.projector.left_to_projector
        self._projector.light_to_world = picture.pose @ np.linalg.inv(to_projector)
        self.scene.set_light(self._projector_id, self._projector)
        groups = tuple(f"light_group_{k}" for k in range(self.group_count))
        own = ("projector_direct", "projector_indirect") if picture.lit else ()
        images = self._renderer.render(
            self.scene,
            [picture.camera],
            own + groups,
            band=picture.band,
            spp=samples,
            max_bounces=self._bounces,
            seed=seed,
        )
        laser = sum((images[name][0] for name in own), np.zeros_like(images[groups[0]][0]))
        black = np.full_like(laser, 1.0 if picture.band == "infrared" else 0.0)
        return np.stack([laser, *(images[name][0] for name in groups), black], axis=-1)

    def material_ids(self, camera: kuafu.Camera) -> NDArray[np.uint32]:
        images = self._renderer.render(self.scene, [camera], ("material_id",), spp=1)
        return np.asarray(images["material_id"][0, ..., 0])


def pictures(scene: MaterialScene, capture: Capture, surfaces: Sequence[int], most_poses: int = 3) -> list[Picture]:
    """Returns pictures from the poses at which the object is largest: infrared with the projector on and off, and
    colour, as far as recorded. Raises ValueError if no pose shows the object."""
    poses: dict[bytes, list[Frame]] = {}
    for frame in capture.frames:
        poses.setdefault(np.round(frame.camera_to_world, 7).tobytes(), []).append(frame)
    sized = []
    for frames in poses.values():
        box = _box(scene, capture.rig.left, frames[0].camera_to_world, surfaces)
        if box is not None:
            sized.append(((box[2] - box[0]) * (box[3] - box[1]), frames))
    if not sized:
        raise ValueError(
            f"{capture.path}: the object is out of view in all {len(poses)} poses: check the scene's poses"
        )
    sized.sort(key=lambda entry: -entry[0])
    out: list[Picture] = []
    for _, frames in sized[:most_poses]:
        for lit in (True, False):
            chosen = [f for f in frames if (f.projector_power > 0) == lit and f.has_infrared]
            if chosen:
                seen: NDArray = np.mean([capture.ir(f, "left") for f in chosen], axis=0)[..., None]
                name = f"frames[id={chosen[0].id}].left"
                out += _picture(
                    scene, capture.rig.left, name, seen, lit, chosen[0].camera_to_world, surfaces, capture.rig.max_dn
                )
        with_color = [f for f in frames if f.color_path is not None]
        if with_color and capture.rig.color is not None:
            images = np.array([capture.color(f) for f in with_color], np.float32) / 255.0
            color: NDArray = np.mean(list(srgb.linear(images)), axis=0)
            name = f"frames[id={with_color[0].id}].color"
            pose: NDArray = frames[0].camera_to_world @ np.linalg.inv(capture.rig.color.left_to_color)
            out += _picture(scene, capture.rig.color, name, color, None, pose, surfaces, 1.0)
    if not any(picture.band == "infrared" for picture in out):
        raise ValueError(f"{capture.path}: no infrared image sees the object")
    return out


def _picture(
    scene: MaterialScene,
    camera: Camera,
    name: str,
    seen: NDArray,
    lit: bool | None,
    pose: NDArray[np.float64],
    surfaces: Sequence[int],
    highest: float,
) -> list[Picture]:
    """Cuts the object out of an image and scales it down; empty if the object is out of view. lit: None for a colour
    image. highest: the saturated value."""
    box = _box(scene, camera, pose, surfaces)
    if box is None:
        return []
    left, top, right, bottom = box
    crop = np.asarray(seen[top:bottom, left:right], np.float32)
    usable = (crop < _SATURATED * highest).all(axis=2)
    step = max(1, int(np.ceil(max(crop.shape[:2]) / _LARGEST_PX)))
    height, width = crop.shape[0] // step, crop.shape[1] // step

    def mean(image: NDArray) -> NDArray[np.float32]:
        whole = np.asarray(image[: height * step, : width * step], np.float32)
        return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.float32)

    K = camera.K.copy()
    K[0, 2], K[1, 2] = K[0, 2] - left, K[1, 2] - top
    K[:2, 2] = (K[:2, 2] + 0.5) / step - 0.5
    K[0, :2] /= step
    K[1, 1] /= step
    own = kuafu.Camera(width, height, K, pose)
    small = mean(crop).reshape(height, width, -1)
    floor = (1.0 if lit is not None else 0.01) / step
    # Take the light from a pixel's neighbours. With its own value a pixel with positive noise would weigh less than
    # others, and all fitted values would be too dark.
    light = (9.0 * uniform_filter(small, (3, 3, 1)) - small) / 8.0
    edges = _OFF_PX * (maximum_filter(small, footprint=_NEIGHBOURS) - minimum_filter(small, footprint=_NEIGHBOURS))
    sigma = np.sqrt(floor**2 + (_OFF_SHARE * light) ** 2 + edges**2).astype(np.float32)
    ids = scene.material_ids(own)
    surface = sum(((1 + k) * (ids == number) for k, number in enumerate(surfaces)), np.zeros(ids.shape, np.int64))
    band: Literal["infrared", "visible"] = "visible" if lit is None else "infrared"
    return [Picture(name, band, bool(lit), small, mean(usable) > 0.99, sigma, own, pose, surface)]


def _box(
    scene: MaterialScene, camera: Camera, pose: NDArray[np.float64], surfaces: Sequence[int]
) -> tuple[int, int, int, int] | None:
    """Returns (left, top, right, bottom) around the object with a margin; None if fewer than 100 of its pixels are
    visible."""
    whole = kuafu.Camera(camera.width, camera.height, camera.K, pose)
    v, u = np.nonzero(np.isin(scene.material_ids(whole), surfaces))
    if len(v) < 100:
        return None
    margin = int(_MARGIN * max(np.ptp(u), np.ptp(v)))
    low = max(int(u.min()) - margin, 0), max(int(v.min()) - margin, 0)
    return *low, min(int(u.max()) + margin, whole.width), min(int(v.max()) + margin, whole.height)
