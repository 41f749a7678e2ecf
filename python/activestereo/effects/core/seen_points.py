# SPDX-License-Identifier: Apache-2.0
"""Points of the world that several images see, with what of each image is not explained."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from activestereo.effects.core.judging import StartImage
from activestereo.effects.core.shading import Shading

_SEED = 12
# Dots lie between these sizes, in pixels: Gaussians that take noise and smooth light away.
_DOTS_PX = 0.8, 4.0


@dataclass(frozen=True)
class SeenPoints:
    """n pixels. points, normals: world [n][3], metres. glow: DN of irradiance 1. weight: 1/DN^2. residual: DN.
    dots: size of its part that is as fine as dots are, over the noise of a pixel."""

    points: np.ndarray
    normals: np.ndarray
    glow: np.ndarray
    weight: np.ndarray
    residual: np.ndarray
    dots: np.ndarray

    @classmethod
    def of(cls, images: list[StartImage], most: int) -> SeenPoints:
        """At most so many pixels, by chance, of those that see a surface."""
        columns = []
        for image in images:
            view, shading = image.view, Shading.of(image.light, image.view)
            to_world = view.frame.camera_to_world @ np.linalg.inv(view.left_to_camera)
            at = shading.hit & (shading.reflectance > 0)
            sharp, smooth = (gaussian_filter(image.residual, size) for size in _DOTS_PX)
            columns.append(
                (
                    shading.points[at] @ to_world[:3, :3].T + to_world[:3, 3],
                    shading.normal[at] @ to_world[:3, :3].T,
                    image.ambient_dn * shading.reflectance[at],
                    image.weight[at],
                    image.residual[at],
                    (np.abs(sharp - smooth) * np.sqrt(image.weight))[at],
                )
            )
        return cls(*(np.concatenate(column) for column in zip(*columns, strict=True))).some(most)

    def some(self, most: int) -> SeenPoints:
        pick = np.random.Generator(np.random.PCG64(_SEED)).permutation(len(self.residual))[:most]
        columns = self.points, self.normals, self.glow, self.weight, self.residual, self.dots
        return SeenPoints(*(x[pick] for x in columns))

    def lit_from(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(ways from a place, or from places [...][3], to the points, DN of a source of intensity 1 there)."""
        way = self.points - place[..., None, :]
        square = np.maximum((way**2).sum(-1), 1e-6)
        return way, self.glow * np.maximum(-(way * self.normals).sum(-1), 0.0) / (square * np.sqrt(square))

    def beyond_even(self, lit: np.ndarray) -> np.ndarray:
        """The residual without what a beam without a pattern would explain, as a gradient: weight times DN."""
        even = max(float(lit @ (self.weight * self.residual)), 0.0) / max(float(lit**2 @ self.weight), 1e-300)
        return self.weight * (self.residual - even * lit)
