# SPDX-License-Identifier: Apache-2.0
"""Finds the best materials of an object near a candidate. Pictures of the object are cut out of a capture, and the same
views are rendered under candidate materials. Each light is rendered alone, so its intensity follows by linear least
squares. Infrared images are in DN; colour images are made linear (IEC 61966-2-1) and stay 0..1.

loss = colour + lambda infrared. Each is the square of the residual, in standard deviations, plus that of an oriented
filter bank's responses (derivatives of Gaussians of two sizes, four directions). A square is the product of two
residuals, each rendered with half of the samples, so the renderer's noise cancels in the mean. The plain square would
prefer rough surfaces, which render with less noise.

Gauss-Newton takes its derivatives from designed sets of renders, since renderer noise hides the difference of two
renders close to each other. In a two-level design with its mirror image (Plackett and Burman 1946; Box and Wilson
1951), every render informs every derivative. Sixteen renders give the derivatives by eight parameters, each with the
noise of all sixteen. No product of two parameters is mistaken for the effect of a third one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import hadamard
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter, uniform_filter
from scipy.optimize import lsq_linear

import kuafu
from activestereo.capture.capture import Camera, Capture, Frame
from activestereo.common import srgb
from activestereo.common.pose import rigid_motion
from activestereo.common.progress_bar import Progress, part_of, silent
from activestereo.effects.core.surfaces import split_surfaces
from activestereo.effects.engines.capture_inputs import set_surface
from activestereo.scene_io.scene_files import load_scene_file

_MARGIN = 0.35  # share of the object's size around it; the known material there gives the lights' brightness
_LARGEST_PX = 72  # pictures are averaged down to this
_GROUPS, _MOST_POSES = 4, 3
_SATURATED = 0.97
# Model errors besides noise: a share of the light, and a shift in pixels of the object, its edges and the dots.
_OFF_SHARE, _OFF_PX = 0.03, 0.1
_NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)[..., None]


@dataclass(frozen=True)
class Picture:
    """A recorded picture of the object and its surroundings. seen: float32 [height, width, channel]. usable: mask of
    unsaturated pixels. sigma: standard deviation of noise and model error, in the shape and unit of `seen`. lit:
    whether the projector was on. camera: of the cut-out. pose: 4x4 camera_to_world. surface: [height, width], 1 + index
    of the object's surface, 0 around it."""

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
            lamp = kuafu.Light(kind="point", intensity=(1.0, 1.0, 1.0), ir_intensity=1.0, radius_m=known.radius_m)
            lamp.light_to_world, lamp.light_group = rigid_motion(known.position_m), 1 + min(lamps, _GROUPS - 2)
            lamps += 1
            self.scene.add_light(lamp)
        self.group_count = 1 + min(lamps, _GROUPS - 1)
        projector = capture.rig.projector
        texture = self.scene.add_texture(projector.pattern(), name="pattern")
        self._projector = kuafu.Light(kind="projector", ir_intensity=1.0, texture=texture, k=projector.K)
        self._projector_id = self.scene.add_light(self._projector)

    def lights(self, picture: Picture, samples: int, seed: int) -> NDArray[np.float32]:
        """Renders a picture's view under each light alone, [height, width, channel, light]. The first light is the
        projector, 0 if it was off or is not visible. Then come the room's light, each group of lamps, and the black
        level, which is 1 in infrared and 0 in colour pictures."""
        to_projector = self._capture.rig.projector.left_to_projector
        self._projector.light_to_world = picture.pose @ np.linalg.inv(to_projector)
        self.scene.set_light(self._projector_id, self._projector)
        groups = tuple(f"light_group_{k}" for k in range(self.group_count))
        own = ("projector_direct", "projector_indirect") if picture.lit else ()
        images = self._renderer.render(
            self.scene, [picture.camera], own + groups, band=picture.band, spp=samples, max_bounces=self._bounces,
            seed=seed,
        )  # fmt: skip
        laser = sum((images[name][0] for name in own), np.zeros_like(images[groups[0]][0]))
        black = np.full_like(laser, 1.0 if picture.band == "infrared" else 0.0)
        return np.stack([laser, *(images[name][0] for name in groups), black], axis=-1)

    def material_ids(self, camera: kuafu.Camera) -> NDArray[np.uint32]:
        images = self._renderer.render(self.scene, [camera], ("material_id",), spp=1)
        return np.asarray(images["material_id"][0, ..., 0])


def pictures(scene: MaterialScene, capture: Capture, surfaces: Sequence[int]) -> list[Picture]:
    """Returns pictures from the three poses at which the object is largest: infrared with the projector on and off, and
    colour, as far as recorded. Raises ValueError if no pose or no infrared image shows the object."""
    poses: dict[bytes, list[Frame]] = {}
    for frame in capture.frames:
        poses.setdefault(np.round(frame.camera_to_world, 7).tobytes(), []).append(frame)
    sized = []
    for frames in poses.values():
        box = _box(scene, capture.rig.left, frames[0].camera_to_world, surfaces)
        if box is not None:
            sized.append(((box[2] - box[0]) * (box[3] - box[1]), frames))
    if not sized:
        told = f"the object is out of view in all {len(poses)} poses: check the scene's poses"
        raise ValueError(f"{capture.path}: {told}")
    sized.sort(key=lambda entry: -entry[0])
    out: list[Picture] = []
    for _, frames in sized[:_MOST_POSES]:
        for lit in (True, False):
            chosen = [f for f in frames if (f.projector_power > 0) == lit and f.has_infrared]
            if chosen:
                seen: NDArray = np.mean([capture.ir(f, "left") for f in chosen], axis=0)[..., None]
                name = f"frames[id={chosen[0].id}].left"
                at, most = chosen[0].camera_to_world, capture.rig.max_dn
                out += _picture(scene, capture.rig.left, name, seen, lit, at, surfaces, most)
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
    scene: MaterialScene, camera: Camera, name: str, seen: NDArray, lit: bool | None, pose: NDArray[np.float64],
    surfaces: Sequence[int], highest: float,
) -> list[Picture]:  # fmt: skip
    """Returns [the Picture of the object, cut out of an image and scaled down], or [] if the object is out of view.
    seen: the image. lit: whether the projector was on; None for a colour image. highest: saturated value of `seen`."""
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


PARAMETERS = ("roughness", "metallic", "specular", "transmission", "ir_albedo")
COLORS = ("red", "green", "blue")
_RANGES = {
    "roughness": (0.03, 1.0), "metallic": (0.0, 1.0), "specular": (0.0, 1.0), "transmission": (0.0, 1.0),
    "ir_albedo": (0.01, 0.98), "red": (0.02, 0.98), "green": (0.02, 0.98), "blue": (0.02, 0.98),
}  # fmt: skip
_GRAY = 0.2  # second base colour besides white; the two renders separate the light that depends on the colour
_PERCEPTUAL = 0.5  # weight of the filter bank beside the plain residual
_INFRARED = 1.0  # lambda
_SIZES_PX = (1.0, 2.0)
_DIRECTIONS = 4
_HUBER = 4.0


@dataclass(frozen=True)
class Residuals:
    """Residuals of one candidate, a set of material values. first, second: rendered minus recorded pictures, in
    standard deviations times weights, each from an independent half of the samples. Weights let large differences count
    as their square root. loss: mean of first x second, never below 0 on average."""

    first: NDArray[np.float64]
    second: NDArray[np.float64]
    weights: NDArray[np.float64]

    @property
    def loss(self) -> float:
        return float(np.mean(self.first * self.second))


class MaterialFit:
    """Computes residuals of candidate materials. A candidate theta is a vector of values, one for each of `parameters`,
    which are pairs (material's number, name). The names are PARAMETERS for each surface. COLORS are added if there are
    colour images and the surface has no colour (white, without a texture). The colour is fitted with each candidate
    anew: a fixed one would contain part of the gloss."""

    def __init__(
        self, scene: MaterialScene, pictures: Sequence[Picture], surfaces: Sequence[int], seed: int = 0
    ) -> None:
        self._scene, self._pictures, self._surfaces, self._seed = scene, pictures, surfaces, seed
        self._materials = {n: scene.scene.get_material(n) for n in surfaces}
        colored = any(p.band == "visible" for p in pictures)
        own = self._materials.items()
        blank = [n for n, m in own if m.base_color_texture is None and min(m.base_color[:3]) > 0.999]
        names = {n: PARAMETERS + (COLORS if colored and n in blank else ()) for n in surfaces}
        self.parameters = tuple((n, name) for n in surfaces for name in names[n])
        self.low, self.high = np.array([_RANGES[name] for _, name in self.parameters]).reshape(-1, 2).T
        self.renders = 0

    def start(self) -> NDArray[np.float64]:
        """Returns the scene's own values as a candidate, from which the fit starts."""
        out = []
        for number, name in self.parameters:
            material = self._materials[number]
            if name in COLORS:
                out.append(material.base_color[COLORS.index(name)])
            elif name == "ir_albedo" and material.ir_albedo is None:
                out.append(material.base_color[0])
            else:
                out.append(getattr(material, name))
        return np.clip(np.array(out), self.low, self.high)

    def residuals(
        self, theta: NDArray[np.float64], samples: int, weights: NDArray[np.float64] | None = None
    ) -> Residuals:
        """Renders a candidate and compares it with the recorded pictures. samples: per pixel in each half. weights: of
        another candidate's residuals, if both are to be subtracted; None: computed here."""
        self.set(theta)
        self.renders += 1
        halves: tuple[list[NDArray], list[NDArray], list[NDArray]] = ([], [], [])
        rendered = [
            [self._scene.lights(p, samples, self._seed + 2 * k + half) for half in (0, 1)]
            for k, p in enumerate(self._pictures)
        ]
        for band, weight in (("visible", 1.0), ("infrared", _INFRARED)):
            chosen = [(p, r) for p, r in zip(self._pictures, rendered, strict=True) if p.band == band]
            if not chosen:
                continue
            intensities = light_intensities([(p, a, b) for p, (a, b) in chosen])
            count = sum(int(p.usable.sum()) for p, _ in chosen)
            for picture, pair in chosen:
                first, second = (self._compare(picture, np.einsum("yxcl,cl->yxc", r, intensities)) for r in pair)
                halves[0].append(first)
                halves[1].append(second)
                # The weight knows no sign, so that noises still cancel.
                halves[2].append(np.sqrt(weight / count) * (1.0 + (first**2 + second**2) / (2.0 * _HUBER**2)) ** -0.25)
        one, two, own = (np.concatenate(parts) for parts in halves)
        if weights is None:
            weights = np.sqrt(len(own)) * own
        return Residuals(weights * one, weights * two, weights)

    def with_colors(self, theta: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
        """Returns the candidate with its colours replaced by those that fit best to its other values. Light intensities
        come from the pixels around the object."""
        free = np.array([name in COLORS for _, name in self.parameters])
        if not free.any():
            return theta
        chosen = [p for p in self._pictures if p.band == "visible"]
        stacks = []
        for value in (1.0, _GRAY):
            self.set(np.where(free, value, theta))
            rendered = [self._scene.lights(p, samples, self._seed + k) for k, p in enumerate(chosen)]
            around = [replace(p, usable=p.usable & (p.surface == 0)) for p in chosen]
            intensities = light_intensities(list(zip(around, rendered, rendered, strict=True)))
            stacks.append([np.einsum("yxcl,cl->yxc", lights, intensities) for lights in rendered])
        white, gray = stacks
        out = theta.copy()
        for place, number in enumerate(self._surfaces):
            own = [p.usable & (p.surface == 1 + place) for p in chosen]
            seen, bright, dark = (
                np.concatenate([image[mask] for image, mask in zip(stack, own, strict=True)])
                for stack in ([p.seen for p in chosen], white, gray)
            )
            rows = [k for k, (n, name) in enumerate(self.parameters) if n == number and name in COLORS]
            for channel, row in enumerate(rows):
                # A picture is linear in a surface's colour, except for light that the surface reflects on itself.
                share = (bright - dark)[:, channel] / (1.0 - _GRAY)
                told = share > 0.2 * max(float(np.median(share)), 1e-6) if len(share) else []
                if np.sum(told) >= 20:
                    value = 1.0 - (bright - seen)[told, channel] / share[told]
                    out[row] = np.clip(np.median(value), self.low[row], self.high[row])
        return out

    def _compare(self, picture: Picture, image: NDArray) -> NDArray[np.float64]:
        """Returns a rendered image minus the picture, in standard deviations, followed by a filter bank's responses to
        it. Both are linear in the image, because only then does the noise of two halves cancel in the mean."""
        rest = np.where(picture.usable[..., None], (image - picture.seen) / picture.sigma, 0.0)
        parts = [rest.ravel()]
        for size in _SIZES_PX:
            across, down = (gaussian_filter(rest, (size, size, 0), order=(*order, 0)) for order in ((0, 1), (1, 0)))
            norm = size * np.sqrt(8.0 * np.pi) * size  # white noise keeps its deviation
            share = norm / np.sqrt(len(_SIZES_PX) * _DIRECTIONS)
            for angle in np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS:
                part = share * (np.cos(angle) * across + np.sin(angle) * down)
                parts.append(np.sqrt(_PERCEPTUAL) * part.ravel())
        return np.concatenate(parts)

    def set(self, theta: NDArray[np.float64]) -> None:
        for number, material in self._materials.items():
            values = {name: float(v) for (n, name), v in zip(self.parameters, theta, strict=True) if n == number}
            set_surface(material, {name: values[name] for name in PARAMETERS})
            if "red" in values:
                material.base_color = (values["red"], values["green"], values["blue"], 1.0)
            self._scene.scene.set_material(number, material)


def light_intensities(pictures: Sequence[tuple[Picture, NDArray, NDArray]]) -> NDArray[np.float64]:
    """Fits the lights' intensities [channel, light], which all pictures of a band share and none of which is below 0.
    pictures: (picture, its single-light renders by each half of the samples).

    Each half serves as the other's instrumental variable. With plain least squares, noise in the renders would bias
    intensities low (errors in variables; Fuller, Measurement Error Models, 1987, section 1.4).
    """
    out = []
    for channel in range(pictures[0][1].shape[2]):
        count = pictures[0][1].shape[3]
        H, b = np.zeros((count, count)), np.zeros(count)
        for picture, first, second in pictures:
            weight = 1.0 / picture.sigma[picture.usable][:, channel].astype(np.float64)
            one, two = (half[picture.usable][:, channel] * weight[:, None] for half in (first, second))
            H += 0.5 * (one.T @ two + two.T @ one)
            b += 0.5 * (one + two).T @ (picture.seen[picture.usable][:, channel] * weight)
        # H x = b; an intensity below 0, or of a light that lights nothing, is 0 and the rest solved again.
        x, kept = np.zeros(count), np.flatnonzero(np.diag(H) > 1e-12 * max(float(np.diag(H).max()), 1e-300))
        while len(kept):
            size = np.sqrt(np.diag(H)[kept])
            found = np.linalg.lstsq(H[np.ix_(kept, kept)] / np.outer(size, size), b[kept] / size, rcond=1e-9)[0] / size
            if (found >= 0).all():
                x[kept] = found
                break
            kept = np.delete(kept, int(np.argmin(found * size)))
        out.append(x)
    return np.array(out)


# Errors of neighbouring pixels are correlated, and the model has errors, too: so many residuals count as one.
_ALIKE = 12.0
# Standard deviations of all other errors, from trials on balls, boxes and cups with known paints.
_FLOORS = {"roughness": 0.04, "metallic": 0.02, "specular": 0.06, "transmission": 0.04, "ir_albedo": 0.025}
_COLOR_FLOOR = 0.03
# A direction of theta with a larger standard deviation than this counts as not determined.
_OPEN = 0.6
# Gloss goes with powers of roughness: below this the design's reach shrinks with it.
_LINEAR_ROUGHNESS = 0.4
# If a residual's two halves of the samples ever differ by this many deviations, rare bright paths made it (a dot by way
# of gloss). Derivatives leave it out, whatever its sign.
_WILD = 6.0
_STEPS = 3  # with the same derivatives
_FARTHEST = 2.0  # largest step from the start, in reaches


@dataclass(frozen=True)
class Refined:
    """A refined candidate theta, its residuals, and the standard deviations sigma of theta."""

    theta: NDArray[np.float64]
    residuals: Residuals
    sigma: NDArray[np.float64]


def refine(
    fit: MaterialFit, theta: NDArray[np.float64], reaches: Sequence[float], samples: int,
    progress: Progress = silent,
) -> Refined:  # fmt: skip
    """Improves a candidate by Gauss-Newton, once for each of `reaches`. Derivatives come from renders of several
    variants, whose distance from their middle is the reach. samples: per pixel in each half of a variant's render. New
    candidates are judged with four times as many."""
    best = fit.residuals(theta, 4 * samples)
    for number, reach in enumerate(reaches):
        part = part_of(progress, number / len(reaches), (number + 1) / len(reaches))
        # Derivatives [half][residual][parameter], around the place nearest to theta whose design lies within the range.
        size = len(theta)
        half = hadamard(1 << (size - 1).bit_length())[:, :size]
        signs, steps = np.concatenate([half, -half]), np.full(size, reach)
        for k, (_, name) in enumerate(fit.parameters):
            if name == "roughness":
                steps[k] *= min(1.0, theta[k] / _LINEAR_ROUGHNESS)
        middle = np.clip(theta, fit.low + steps, fit.high - steps)
        J, apart = np.zeros((2, len(best.weights), size)), np.zeros(len(best.weights))
        for done, row in enumerate(signs):
            rendered = fit.residuals(middle + row * steps, samples, best.weights)
            J[0] += rendered.first[:, None] * row
            J[1] += rendered.second[:, None] * row
            np.maximum(apart, np.abs(rendered.first - rendered.second), out=apart)
            part((done + 1) / len(signs))
        J /= len(signs) * steps
        J[:, apart > _WILD] = 0.0
        J1, J2 = J
        # Products of two halves here, too: noise in the derivatives does not shrink the step.
        H = 0.5 * (J1.T @ J2 + J2.T @ J1)
        noise = float(np.mean((best.first - best.second) ** 2)) / 4.0
        unit = _ALIKE * (max(best.loss, 1.0) + noise)
        values, vectors = np.linalg.eigh(H)
        values = np.maximum(values, unit / _OPEN**2)
        A = np.sqrt(values)[:, None] * vectors.T
        low, high = np.maximum(fit.low, theta - _FARTHEST * reach), np.minimum(fit.high, theta + _FARTHEST * reach)
        for _ in range(_STEPS):
            b = -0.5 * (J1.T @ best.second + J2.T @ best.first)
            bounds = (low - theta - 1e-9, high - theta + 1e-9)
            step = lsq_linear(A, vectors.T @ b / np.sqrt(values), bounds).x
            moved = np.clip(theta + step, low, high)
            other = fit.residuals(moved, 4 * samples)
            if other.loss >= best.loss:
                break
            theta, best = moved, other
    # Each half of the samples alone would lead elsewhere; the difference shows the renderer's noise.
    elsewhere = J2.T @ best.first - J1.T @ best.second
    by_noise = 0.5 * (vectors @ ((vectors.T @ elsewhere) / values))
    floors = np.array([_FLOORS.get(name, _COLOR_FLOOR) for _, name in fit.parameters])
    sigma = np.sqrt(unit * np.sum(vectors**2 / values, axis=1) + by_noise**2 + floors**2)
    return Refined(theta, best, sigma)
