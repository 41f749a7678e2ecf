# SPDX-License-Identifier: Apache-2.0
"""Objects' places as nuisances: what small rigid motions of a surveyed object change in an image.

An object that stands a millimetre from where the survey has it moves its outline, the edges of its materials, and
nothing else that is worth a column. Along such an edge two pixels of the finer image belong to different surfaces; a
displacement across their common side changes the image there by the difference of their radiance times the
displacement. Where one of them hides the other its own motion counts alone; where they meet at one depth, each object's
counts by half.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from activestereo.lab.layers import PixelLayers, Sampling

if TYPE_CHECKING:
    from activestereo.lab.diagnose.evidence.observation import Shot
    from activestereo.lab.fit import Nuisances

# How well a survey knows places and orientations: standard deviations.
PLACE_SIGMA_M, TURN_SIGMA_RAD = 0.7e-3, 2.5e-3
MOTIONS = 6
# Depths that differ by more than this share are one behind the other.
_DEPTH_STEP = 0.03
# What a motion by its deviation changes by less, in deviations of the noise, is no part of a column.
_LEAST = 0.05


class _Sides(NamedTuple):
    """Of pixel sides between two surfaces, in one direction: the pixels before and after each ([n] flat indices of the
    finer image), and their radiance in DN before and after, a pixel away from the side where that is the same surface.
    """

    before: np.ndarray
    after: np.ndarray
    dn_before: np.ndarray
    dn_after: np.ndarray


@dataclass(frozen=True)
class Objects:
    """of_surface: the object of each surface, -1 = none. centre_m: the points about which they turn, [objects][3]."""

    of_surface: np.ndarray
    centre_m: np.ndarray

    @property
    def columns(self) -> int:
        return MOTIONS * len(self.centre_m)

    @classmethod
    def seen(cls, shots: Sequence[Shot], of_surface: Sequence[int]) -> Objects:
        """The objects that shots show; of_surface: as scene_surfaces.objects_of_surfaces() has it."""
        numbers = np.array([*of_surface, -1], dtype=np.int64)
        if any(not isinstance(s.layers, PixelLayers) or any(s.view.distortion) for s in shots):
            return cls(np.full(len(numbers), -1), np.zeros((0, 3)))
        sums = np.zeros((numbers.max() + 1, 4))
        for s in shots:
            material = np.asarray(s.layers.material, dtype=np.int64)
            shown = numbers[np.minimum(material, len(numbers) - 1)]
            points = _to_world(s, s.view.points())
            for k in np.unique(shown[(shown >= 0) & (s.view.depth_m > 0)]):
                here = (shown == k) & (s.view.depth_m > 0)
                sums[k] += [*points[here].sum(axis=0), here.sum()]
        order = np.cumsum(sums[:, 3] > 0) - 1
        known = np.where(sums[:, 3] > 0, order, -1)
        centre = sums[sums[:, 3] > 0]
        return cls(np.append(known, -1)[numbers], centre[:, :3] / centre[:, 3:])


def place_slopes(shot: Shot, objects: Objects, nuisances: Nuisances, deviation_dn: np.ndarray) -> csr_matrix:
    """DN per deviation of each object's motions: three translations along the world's axes, three turns about them;
    float32 [pixels][6 objects]. deviation_dn: the noise's, [height][width].
    """
    shape = (shot.measured.size, objects.columns)
    if not objects.columns:
        return csr_matrix(shape, dtype=np.float32)
    assert isinstance(shot.layers, PixelLayers)
    fine = shot.layers.fine
    entries = list(_entries(shot, shot.layers, objects, _image(shot, nuisances), Sampling(fine.scale, fine.margin_px)))
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    sigma = np.tile([PLACE_SIGMA_M] * 3 + [TURN_SIGMA_RAD] * 3, len(objects.centre_m))
    slopes = coo_matrix((values * sigma[columns], (rows, columns)), shape=shape).tocsr()
    noise = np.repeat(deviation_dn.ravel(), np.diff(slopes.indptr))
    slopes.data[np.abs(slopes.data) < _LEAST * noise] = 0.0
    slopes.eliminate_zeros()
    return slopes.astype(np.float32)


def with_places(
    shots: Sequence[Shot],
    images: Mapping[tuple[int, str], np.ndarray],
    slopes: Mapping[tuple[int, str], csr_matrix],
    deviations_dn: Mapping[tuple[int, str], np.ndarray],
) -> dict[tuple[int, str], np.ndarray]:
    """Expected images with the motions that explain the shots best under their prior."""
    count = slopes[shots[0].key].shape[1]
    gram, moment = np.eye(count), np.zeros(count)
    for s in shots:
        root = 1.0 / np.maximum(deviations_dn[s.key], 1e-6).ravel()
        weighted = slopes[s.key].multiply(root[:, None]).tocsr()
        gram += (weighted.T @ weighted).toarray()
        moment += weighted.T @ (root * (s.measured - images[s.key]).ravel())
    motions = np.linalg.solve(gram, moment)
    return {s.key: images[s.key] + (slopes[s.key] @ motions).reshape(images[s.key].shape) for s in shots}


def _image(shot: Shot, nuisances: Nuisances) -> np.ndarray:
    """DN above black of the finer image."""
    assert isinstance(shot.layers, PixelLayers)
    direct, indirect, ambient, _ = shot.layers.fine.images.astype(np.float64)
    frame = shot.frame
    level = 1.0 if frame.ambient is None else frame.ambient
    laser = nuisances.projector_scale * frame.projector_power * (direct + indirect)
    return (laser + nuisances.ambient_scale * level * ambient) * frame.exposure_gain


def _entries(
    shot: Shot, layers: PixelLayers, objects: Objects, image: np.ndarray, sampling: Sampling
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(pixel, column, DN per metre or radian) of every side's motions."""
    z, surface = layers.fine_depth_m.ravel().astype(np.float64), layers.fine_surface.astype(np.int64)
    numbers = objects.of_surface[np.minimum(surface, len(objects.of_surface) - 1)].ravel()
    height, width = shot.measured.shape
    for axis in (0, 1):
        sides = _sides(surface, image, axis)
        both_seen = (z[sides.before] > 0) & (z[sides.after] > 0)
        nearer = np.where(z[sides.before] > 0, z[sides.before], np.inf) < np.where(
            z[sides.after] > 0, z[sides.after], np.inf
        )
        gap = np.abs(z[sides.before] - z[sides.after])
        meet = both_seen & (gap <= _DEPTH_STEP * np.minimum(z[sides.before], z[sides.after]))
        for pixel, is_front in ((sides.before, nearer), (sides.after, ~nearer)):
            share = np.where(meet, 0.5, is_front)
            chosen = np.flatnonzero((share > 0) & (numbers[pixel] >= 0) & (z[pixel] > 0))
            at, number = pixel[chosen], numbers[pixel[chosen]]
            flow = _flow(shot, sampling, at, z[at], objects.centre_m[number], surface.shape[1], axis)
            # A displacement of a side sweeps the area of one finer pixel per finer pixel.
            change = (share * (sides.dn_before - sides.dn_after))[chosen, None] * flow / sampling.scale**2
            columns = MOTIONS * number[:, None] + np.arange(MOTIONS)
            for half in (sides.before, sides.after):
                down, right = np.divmod(half[chosen], surface.shape[1])
                v, u = down // sampling.scale - sampling.margin_px, right // sampling.scale - sampling.margin_px
                inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
                pixels = np.repeat((v * width + u)[inside], MOTIONS)
                yield pixels, columns[inside].ravel(), 0.5 * change[inside].ravel()


def _sides(surface: np.ndarray, image: np.ndarray, axis: int) -> _Sides:
    """axis: 0 between rows, 1 between columns; sides next to the border are left out."""
    index = np.arange(surface.size).reshape(surface.shape)
    s, dn, flat = (np.moveaxis(a, axis, 0) for a in (surface, image, index))
    edge = s[1:-2] != s[2:-1]
    before = np.where(s[:-3] == s[1:-2], dn[:-3], dn[1:-2])
    after = np.where(s[3:] == s[2:-1], dn[3:], dn[2:-1])
    return _Sides(flat[1:-2][edge], flat[2:-1][edge], before[edge], after[edge])


def _flow(
    shot: Shot, sampling: Sampling, at: np.ndarray, z: np.ndarray, centre_m: np.ndarray, width: int, axis: int
) -> np.ndarray:
    """Finer pixels down (axis 0) or right (1) per metre and radian, [n][6], of what is seen at finer pixels."""
    down, right = np.divmod(at, width)
    u, v = ((x + 0.5) / sampling.scale - 0.5 - sampling.margin_px for x in (right, down))
    x, y = shot.view.rays(u, v)
    K = sampling.scale * shot.view.K
    rotation = _camera_to_world(shot)[:3, :3]
    arm = _to_world(shot, np.stack([x * z, y * z, z], axis=-1)) - centre_m
    world = np.concatenate(
        [np.broadcast_to(np.eye(3), (len(z), 3, 3)), np.cross(np.eye(3)[None], arm[:, None])], axis=1
    )
    moved = world @ rotation
    if axis == 0:
        return K[1, 1] * (moved[..., 1] - y[:, None] * moved[..., 2]) / z[:, None]
    across = K[0, 0] * (moved[..., 0] - x[:, None] * moved[..., 2])
    return (across + K[0, 1] * (moved[..., 1] - y[:, None] * moved[..., 2])) / z[:, None]


def _camera_to_world(shot: Shot) -> np.ndarray:
    return shot.frame.camera_to_world @ np.linalg.inv(shot.view.left_to_camera)


def _to_world(shot: Shot, points: np.ndarray) -> np.ndarray:
    to_world = _camera_to_world(shot)
    return points @ to_world[:3, :3].T + to_world[:3, 3]


