# SPDX-License-Identifier: Apache-2.0
"""Finds starting values for a fit of a second projector on the rig, whose dots match the picture from one place alone.

A fine grid of places beside the rig and of yaw angles is tried. At each, the residual is regressed on the dots that a
projector there would cast.
"""

import numpy as np

from activestereo.effects.core.judging import StartImage
from activestereo.effects.core.resample import Pattern, smooth_pattern
from activestereo.effects.core.shading import Shading
from activestereo.effects.core.view import transform

_REACH_M, _LARGEST_YAW_RAD = 0.4, 0.3
# The step of the trials is about a dot's width. Dots are blurred to it, so that none falls between two trials.
_STEP_RAD = 0.009
_IMAGES, _PIXELS = 3, 1500
_STARTS = 4
_SEED = 12


def unit_starts(images: list[StartImage]) -> list[dict[str, float]]:
    """Returns intensity, place and yaw of the best few places, {parameter: value} each. Images without the own
    projector's dots are taken first."""
    chosen = sorted(images, key=lambda image: image.view.frame.projector_power)[:_IMAGES]
    scenes = [_Scene(image) for image in chosen]
    depth = np.median(np.concatenate([s.points[:, 2] for s in scenes])) if scenes else 1.0
    places = np.arange(-_REACH_M, _REACH_M, _STEP_RAD * depth)
    yaws = np.arange(-_LARGEST_YAW_RAD, _LARGEST_YAW_RAD, _STEP_RAD)
    gains, strengths = (np.zeros((len(places), len(yaws))) for _ in range(2))
    for i, x in enumerate(places):
        both = sum((s.products(x, yaws) for s in scenes), np.zeros((2, len(yaws))))
        strengths[i] = np.maximum(both[0], 0.0) / np.maximum(both[1], 1e-300)
        gains[i] = strengths[i] * both[0]
    best = [np.unravel_index(flat, gains.shape) for flat in np.argsort(-gains, axis=None)[:_STARTS]]
    return [
        {
            "intensity_m2": float(strengths[i, j]),
            "offset_x_m": float(places[i]),
            "offset_y_m": 0.0,
            "yaw_rad": float(yaws[j]),
        }  # fmt: skip
        for i, j in best
    ]


class _Scene:
    """Random pixels of one image, with their part in the regression. points: projector coordinates [n][3], metres."""

    def __init__(self, image: StartImage) -> None:
        view, shading = image.view, Shading.of(image.light, image.view)
        where = np.flatnonzero(shading.hit & (shading.reflectance > 0))
        pick = np.random.Generator(np.random.PCG64([_SEED, view.seed])).permutation(where)[:_PIXELS]
        rotation = view.camera_to_projector[:3, :3]
        self.points = transform(view.camera_to_projector, shading.points).reshape(-1, 3)[pick]
        self._normal = shading.normal.reshape(-1, 3)[pick] @ rotation.T
        self._glow = image.ambient_dn * shading.reflectance.ravel()[pick]
        self._weight, self._residual = image.weight.ravel()[pick].astype(np.float64), image.residual.ravel()[pick]
        self._K = view.projector_K
        sigma_px = 0.5 * _STEP_RAD * self._K[0, 0]
        smooth = smooth_pattern(view.once("pattern", lambda: Pattern(view.pattern)), sigma_px)
        self._pattern = np.pad(smooth.astype(np.float32), 1)  # pixels beside the pattern are dark

    def products(self, x: float, yaws: np.ndarray) -> np.ndarray:
        """Returns [2][yaws]: weighted products of the dots with the residual, and with themselves. A projector of unit
        intensity, x metres beside the own one, casts the dots at each yaw in radians."""
        way = self.points - [x, 0.0, 0.0]
        square = np.maximum((way**2).sum(-1), 1e-6)
        irradiance = np.maximum(-(way * self._normal).sum(-1), 0.0) / (square * np.sqrt(square))
        c, s = np.cos(yaws)[:, None].astype(np.float32), np.sin(yaws)[:, None].astype(np.float32)
        x_m, y_m, z_m = way.T.astype(np.float32)
        ahead = s * x_m + c * z_m
        z = np.where(ahead > 1e-3, ahead, np.float32(1e-6))
        height, width = self._pattern.shape
        column, row = (
            np.clip(np.rint(k * tangent / z + (middle + 1.0)), 0, side - 1).astype(np.int32)
            for k, tangent, middle, side in (
                (np.float32(self._K[0, 0]), c * x_m - s * z_m, np.float32(self._K[0, 2]), width),
                (np.float32(self._K[1, 1]), y_m, np.float32(self._K[1, 2]), height),
            )
        )
        dots = self._pattern.ravel().take(row * width + column) * (ahead > 1e-3)
        lit = (self._glow * irradiance).astype(np.float32)
        weight = self._weight.astype(np.float32)
        return np.stack([dots @ (lit * weight * self._residual.astype(np.float32)), dots**2 @ (lit**2 * weight)])
