# SPDX-License-Identifier: Apache-2.0
"""How the projector lights what each pixel sees: distance, angles, and the diffuse reflectance that the light layers
tell."""

import numpy as np

from activestereo.effects.core.ggx import Cosines, cosines_of
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import BoxSampler, Pattern, disc_sampler
from activestereo.effects.core.view import View, transform

# Below this cosine a grazing surface tells nothing of its reflectance.
_LEAST_COSINE = 0.05


class Facing:
    """How surfaces face camera and projector. Directions are unit, camera coordinates, [height][width][3]; cosines
    are 0 where nothing is seen or it faces away."""

    def __init__(self, view: View) -> None:
        self._view = view
        self.hit = view.depth_m > 0
        self.points = view.points()
        self.to_camera = _unit(-self.points)
        self.normal = np.where((view.normal * self.to_camera).sum(-1, keepdims=True) < 0, -view.normal, view.normal)
        self.camera_cosine = self._cosine(self.to_camera)
        source = np.linalg.inv(view.camera_to_projector)[:3, 3]
        self.to_projector, self.projector_cosine, self.irradiance = self.from_source(source)

    def lobe(self) -> Cosines:
        """The cosines of a highlight of the projector."""
        return self._view.once("lobe", lambda: cosines_of(self.normal, self.to_projector, self.to_camera))

    def from_source(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(direction to it, cosine, irradiance per radiant intensity in 1/m^2) of a point source without shadows."""
        way = position - self.points
        square = np.maximum((way**2).sum(-1), 1e-12)
        direction = _unit(way)
        cosine = self._cosine(direction)
        return direction, cosine, cosine / square

    def _cosine(self, direction: np.ndarray) -> np.ndarray:
        return np.where(self.hit, np.maximum((self.normal * direction).sum(-1), 0.0), 0.0)


class Shading(Facing):
    """A Facing, with what the light layers tell of the surfaces.

    reflectance: diffuse radiance per irradiance, albedo / pi, [height][width]; where the projector does not reach it is
    guessed from the ambient light by the scene's median.
    """

    @classmethod
    def of(cls, light: Light, view: View) -> "Shading":
        """The Shading of the light that a view was asked for last."""
        return view.latest("shading", light, lambda: cls(light, view))

    def __init__(self, light: Light, view: View) -> None:
        vars(self).update(vars(view.once("facing", lambda: Facing(view))))
        self.reflectance = self._reflectance(light, self.irradiance)

    def _reflectance(self, light: Light, irradiance: np.ndarray) -> np.ndarray:
        lit = self.hit & (light.flat > 0) & (self.projector_cosine > _LEAST_COSINE)
        own = light.flat / np.where(lit, irradiance, 1.0)
        share = np.median((own / np.maximum(light.ambient, 1e-12))[lit]) if lit.any() else 0.0
        return np.where(self.hit, np.where(lit, own, light.ambient * share), 0.0)

    def pattern_from(self, projector_points: np.ndarray, sampler: BoxSampler) -> np.ndarray:
        """Means of a BoxSampler's pattern at points in a projector's frame, 0 behind it; the own projector's footprint
        holds."""
        K, view = self._view.projector_K, self._view
        z = np.where(projector_points[..., 2] > 0, projector_points[..., 2], np.inf)
        y = projector_points[..., 1] / z
        u = K[0, 0] * projector_points[..., 0] / z + K[0, 1] * y + K[0, 2]
        box = K[0, 0] / view.K[0, 0], K[1, 1] / view.K[1, 1]
        mean = sampler(u, K[1, 1] * y + K[1, 2], *(np.full(u.shape, side) for side in box))
        return np.where(np.isfinite(z) & self.hit, mean, 0.0)

    def light_of_unit(self, intensity_m2: float, unit_points: np.ndarray, position: np.ndarray) -> np.ndarray:
        """Radiance over the ambient one under another projector with the own one's pattern. unit_points: the points in
        its frame; position: its place in the camera's."""
        view = self._view
        sharp = view.once("sharp pattern", lambda: disc_sampler(Pattern(view.pattern), 0.0))
        _, _, irradiance = self.from_source(position)
        return intensity_m2 * self.pattern_from(unit_points, sharp) * irradiance * self.reflectance

    def projector_points(self) -> np.ndarray:
        return transform(self._view.camera_to_projector, self.points)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
