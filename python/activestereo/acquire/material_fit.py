# SPDX-License-Identifier: Apache-2.0
"""How well rendered pictures under a candidate's materials explain the recorded ones.

loss = colour + lambda infrared, each the square of the residual in deviations plus that of an oriented filter bank
(derivatives of Gaussians of two sizes, four directions), or of a network's early layers where one is given. Squares are
products of the residuals of two halves of the samples: the renderer's own noise has no part in their mean, where the
plain square prefers rough surfaces, which render with less of it. Of a network that holds to first order only, for its
layers are not linear.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from activestereo.acquire.material_views import MaterialScene, Picture
from activestereo.acquire.network_features import Network, PictureFeatures
from activestereo.engines.survey import set_surface

PARAMETERS = ("roughness", "metallic", "specular", "transmission", "ir_albedo")
LOW = np.array([0.03, 0.0, 0.0, 0.0, 0.01])
HIGH = np.array([1.0, 1.0, 1.0, 1.0, 0.98])
_PERCEPTUAL = 0.5  # weight of the filter bank, or of the network, beside the plain residual
_INFRARED = 1.0  # lambda
_SIZES_PX = (1.0, 2.0)
_DIRECTIONS = 4
_HUBER = 4.0


@dataclass(frozen=True)
class Residuals:
    """first, second: of the two halves of the samples, in deviations; loss: mean of their products, never below 0 on
    average."""

    first: NDArray[np.float64]
    second: NDArray[np.float64]

    @property
    def loss(self) -> float:
        return float(np.mean(self.first * self.second))

    @property
    def mean(self) -> NDArray[np.float64]:
        return 0.5 * (self.first + self.second)


class MaterialFit:
    """Residuals of candidates. theta: PARAMETERS of each surface in turn, [surfaces x 5]."""

    def __init__(
        self,
        scene: MaterialScene,
        pictures: Sequence[Picture],
        surfaces: Sequence[int],
        seed: int = 0,
        network: Network | None = None,
    ) -> None:
        """network: takes the filter bank's place."""
        self._scene, self._pictures, self._surfaces, self._seed = scene, pictures, surfaces, seed
        self._features = None if network is None else {p.name: PictureFeatures(network, p) for p in pictures}
        self.renders = 0

    @property
    def size(self) -> int:
        return len(self._surfaces) * len(PARAMETERS)

    def start(self) -> NDArray[np.float64]:
        """What the scene says."""
        out = []
        for number in self._surfaces:
            material = self._scene.scene.get_material(number)
            albedo = material.base_color[0] if material.ir_albedo is None else material.ir_albedo
            out += [material.roughness, material.metallic, material.specular, material.transmission, albedo]
        return np.clip(np.array(out), np.tile(LOW, len(self._surfaces)), np.tile(HIGH, len(self._surfaces)))

    def residuals(self, theta: NDArray[np.float64], samples: int) -> Residuals:
        """samples: of each half."""
        self.set(theta)
        self.renders += 1
        halves: tuple[list[NDArray], list[NDArray]] = ([], [])
        rendered = [
            [self._scene.lights(p, samples, self._seed + 2 * k + half) for half in (0, 1)]
            for k, p in enumerate(self._pictures)
        ]
        for band, weight in (("visible", 1.0), ("infrared", _INFRARED)):
            chosen = [(p, r) for p, r in zip(self._pictures, rendered, strict=True) if p.band == band]
            if not chosen:
                continue
            intensities = _intensities([(p, a, b) for p, (a, b) in chosen])
            count = sum(int(p.usable.sum()) for p, _ in chosen)
            for picture, pair in chosen:
                first, second = (self._compare(picture, np.einsum("yxcl,cl->yxc", r, intensities)) for r in pair)
                # Large differences count as a square root's; the weight knows no sign, so that noises still cancel.
                weights = np.sqrt(weight / count) * (1.0 + (first**2 + second**2) / (2.0 * _HUBER**2)) ** -0.25
                halves[0].append(weights * first)
                halves[1].append(weights * second)
        scale = np.sqrt(sum(len(part) for part in halves[0]))
        return Residuals(*(scale * np.concatenate(half) for half in halves))

    def estimate_colors(self, theta: NDArray[np.float64], samples: int) -> dict[int, tuple[float, float, float]]:
        """Gives surfaces that no one gave a colour (white, without a texture) that of the colour images: what is seen
        over what white would show, under the lights that the surroundings tell. {surface: linear RGB}."""
        blank = [n for n in self._surfaces if self._is_blank(n)]
        chosen = [p for p in self._pictures if p.band == "visible"]
        if not blank or not chosen:
            return {}
        self.set(theta)
        rendered = [self._scene.lights(p, samples, self._seed + k) for k, p in enumerate(chosen)]
        around = [replace(p, usable=p.usable & (p.surface == 0)) for p in chosen]
        intensities = _intensities(list(zip(around, rendered, rendered, strict=True)))
        images = [np.einsum("yxcl,cl->yxc", lights, intensities) for lights in rendered]
        out = {}
        for number in blank:
            own = [p.usable & (p.surface == 1 + self._surfaces.index(number)) for p in chosen]
            seen, white = (
                np.concatenate([image[mask] for image, mask in zip(stack, own, strict=True)])
                for stack in ([p.seen for p in chosen], images)
            )
            if len(seen) < 20:
                continue
            red, green, blue = (
                float(c) for c in np.clip(np.median(seen / np.maximum(white, 1e-3), axis=0), 0.02, 0.98)
            )
            material = self._scene.scene.get_material(number)
            material.base_color = (red, green, blue, 1.0)
            self._scene.scene.set_material(number, material)
            out[number] = (red, green, blue)
        return out

    def _is_blank(self, number: int) -> bool:
        material = self._scene.scene.get_material(number)
        return material.base_color_texture is None and min(material.base_color[:3]) > 0.999

    def _compare(self, picture: Picture, image: NDArray) -> NDArray[np.float64]:
        """Differences in deviations, and those of the filter bank or network."""
        rest = np.where(picture.usable[..., None], (image - picture.seen) / picture.sigma, 0.0)
        seen = _filtered(rest) if self._features is None else self._features[picture.name].differences(image)
        return np.concatenate([rest.ravel(), *(np.sqrt(_PERCEPTUAL) * part.ravel() for part in seen)])

    def set(self, theta: NDArray[np.float64]) -> None:
        for number, surface in zip(self._surfaces, self.surfaces(theta), strict=True):
            material = self._scene.scene.get_material(number)
            set_surface(material, surface)
            self._scene.scene.set_material(number, material)

    def surfaces(self, theta: NDArray[np.float64]) -> list[Mapping[str, float]]:
        rows = np.asarray(theta).reshape(len(self._surfaces), len(PARAMETERS))
        return [dict(zip(PARAMETERS, map(float, row), strict=True)) for row in rows]


def _intensities(pictures: Sequence[tuple[Picture, NDArray, NDArray]]) -> NDArray[np.float64]:
    """[channel][light] of all pictures of a band together, none below 0.

    Each half is the other's instrument: with the plain square, noise in the rendered lights would take intensity from
    them (errors in variables; Fuller, Measurement Error Models, 1987, section 1.4).
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
        out.append(_not_negative(H, b))
    return np.array(out)


def _not_negative(H: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solves H x = b; what is below 0, or lights nothing, is 0 and the rest solved again."""
    kept = np.flatnonzero(np.diag(H) > 1e-12 * max(float(np.diag(H).max()), 1e-300))
    while len(kept):
        size = np.sqrt(np.diag(H)[kept])
        x = np.linalg.lstsq(H[np.ix_(kept, kept)] / np.outer(size, size), b[kept] / size, rcond=1e-9)[0] / size
        if (x >= 0).all():
            out = np.zeros(len(b))
            out[kept] = x
            return out
        kept = np.delete(kept, int(np.argmin(x * size)))
    return np.zeros(len(b))


def _filtered(rest: NDArray) -> list[NDArray[np.float64]]:
    """Differences as the filter bank sees them: linear in the image, for only then do two halves' noises cancel in the
    mean."""
    parts = []
    for size in _SIZES_PX:
        across, down = (gaussian_filter(rest, (size, size, 0), order=(*order, 0)) for order in ((0, 1), (1, 0)))
        norm = size * np.sqrt(8.0 * np.pi) * size  # white noise keeps its deviation
        share = norm / np.sqrt(len(_SIZES_PX) * _DIRECTIONS)
        angles = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        parts += [share * (np.cos(angle) * across + np.sin(angle) * down) for angle in angles]
    return parts
