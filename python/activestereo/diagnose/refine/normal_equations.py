# SPDX-License-Identifier: Apache-2.0
"""Normal equations of a fit: sums over the pixels of each observation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from activestereo.capture.capture import SIDES
from activestereo.common.computed_once import computed_once
from activestereo.diagnose.evidence.observation import BLOCK_PX, Observation

_PLAIN = ("gram", "moment", "tile_chi2")


class Pixels:
    """The pixels of an Observation that count, ordered by material; all arrays are [n].

    index: into the flat image. measured: DN. root_weight: 1 / standard deviation, 1/DN. material: albedo index, -1 =
    none. tile: number of the image tile.
    """

    def __init__(self, observation: Observation, materials: int) -> None:
        o = observation
        index = np.arange(o.measured.size) if o.pick is None else o.pick
        label = np.where(o.material >= 0, o.material, materials).ravel()[index]
        order = np.argsort(label, kind="stable")
        self.observation, self.index, label = o, index[order], label[order]
        self.measured = self.gather(o.measured).astype(np.float64)
        self.root_weight = np.sqrt(self.gather(o.weight).astype(np.float64))
        self.material, self.tile = self.gather(o.material), self.gather(o.tile)
        self.focal_slope = self.gather(o.focal_slope).astype(np.float64)
        self.geometry_slopes = o.geometry_slopes.reshape(-1, o.measured.size).take(self.index, axis=1)
        self.geometry = self.geometry_slopes * self.root_weight.astype(np.float32)
        ends = np.searchsorted(label, np.arange(materials + 1))
        self.materials, self._runs = materials, [slice(first, last) for first, last in pairwise(ends)]

    def gather(self, image: np.ndarray) -> np.ndarray:
        """Returns an image's values at these pixels."""
        return image.ravel()[self.index]

    @computed_once
    def block(self) -> np.ndarray:
        """Returns the index of each pixel's block of BLOCK_PX, from 0."""
        height, width = self.observation.measured.shape
        rows, columns = np.arange(height) // BLOCK_PX, np.arange(width) // BLOCK_PX
        return self.gather(np.add.outer(rows * (width // BLOCK_PX + 1), columns))

    @computed_once
    def geometry_gram(self) -> np.ndarray:
        """Returns the products of the weighted slopes of the geometry, [k][k]. No fit changes them."""
        return self.geometry @ self.geometry.T

    def by_material(self, values: np.ndarray, factor: np.ndarray) -> np.ndarray:
        """Returns sums over each material's pixels of values [k][n] times a factor [n], [k][materials]."""
        return np.stack([values[:, run] @ factor[run] for run in self._runs], axis=1)


Cluster: TypeAlias = tuple[str, bytes, bool]


def cluster_of(o: Observation) -> Cluster:
    """Returns the key of the cluster that shares errors: one camera's images of one pose, with all repeats and
    settings."""
    return o.side, o.frame.camera_to_world.tobytes(), o.frame.is_moving


@dataclass
class Sums:
    """The normal equations of one linearisation: gram [n][n], moment [n], chi2 by tile, and moments by block, {cluster:
    [n][blocks]}."""

    gram: np.ndarray
    moment: np.ndarray
    tile_chi2: np.ndarray
    block_moment: dict[Cluster, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of_size(cls, size: int, tiles: int) -> "Sums":
        return cls(np.zeros((size, size)), np.zeros(size), np.zeros(tiles))

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, np.ndarray], observations: Sequence[Observation]) -> "Sums":
        """Makes the Sums from the arrays of as_arrays(). observations: the same ones."""
        clusters = dict.fromkeys(map(cluster_of, observations))
        blocks = {cluster: arrays[f"block_{i}"] for i, cluster in enumerate(clusters) if f"block_{i}" in arrays}
        gram, moment, tile_chi2 = (arrays[name] for name in _PLAIN)
        return cls(gram, moment, tile_chi2, blocks)

    def as_arrays(self) -> dict[str, np.ndarray]:
        """Returns the sums as named arrays; those by block are numbered in the order of the observations."""
        blocks = {f"block_{i}": moment for i, moment in enumerate(self.block_moment.values())}
        return {name: getattr(self, name) for name in _PLAIN} | blocks

    @property
    def total(self) -> float:
        return float(self.tile_chi2.sum())

    def add(
        self, pixels: Pixels, columns: list[np.ndarray], residual: np.ndarray, n_theta: int, phi: np.ndarray
    ) -> None:
        """Adds one observation.

        columns: derivatives [k][n] by all parameters except albedos and geometry. An albedo's derivative is the light
        that the material sends. It is computed from the columns of projector and ambient scale (n_theta and the next)
        times their scales.
        """
        dense, materials, own = len(columns), pixels.materials, self._own_rows(pixels, columns)
        A, r = np.stack(columns), residual * pixels.root_weight
        A *= pixels.root_weight
        single, geometry = np.vstack([A, r]).astype(np.float32), pixels.geometry
        self.tile_chi2 += np.bincount(pixels.tile, r * r, minlength=len(self.tile_chi2))
        self.gram[:dense, :dense] += A @ A.T
        self.moment[:dense] += A @ r
        # Three times as fast as matrix products of a BLAS without kernels for the processor.
        cross = np.einsum("in,jn->ji", single, geometry)
        self.gram[:dense, own] += cross[:, :-1].T
        self.gram[own, :dense] += cross[:, :-1]
        self.gram[np.ix_(own, own)] += pixels.geometry_gram()
        self.moment[own] += cross[:, -1]
        if materials:
            glow = A[n_theta] * phi[0] + A[n_theta + 1] * phi[1]
            diagonal, rows = np.arange(dense, dense + materials), np.concatenate([np.arange(dense), own])
            *sums, square, force = pixels.by_material(np.vstack([A, glow, r]), glow)
            self.gram[diagonal, diagonal] += square
            self.moment[diagonal] += force
            both = np.concatenate([np.array(sums), pixels.by_material(geometry, glow.astype(np.float32))])
            self.gram[np.ix_(rows, diagonal)] += both
            self.gram[np.ix_(diagonal, rows)] += both.T

    def _own_rows(self, pixels: Pixels, columns: list[np.ndarray]) -> np.ndarray:
        """Returns the indices into the normal equations of the twelve geometry parameters that move an observation.
        columns: as in add()."""
        return len(columns) - len(SIDES) + pixels.observation.geometry_places

    def add_blocks(
        self, pixels: Pixels, columns: list[np.ndarray], residual: np.ndarray, n_theta: int, phi: np.ndarray
    ) -> None:
        """Adds one observation to block_moment. Arguments: as in add()."""
        dense, materials = len(columns), pixels.materials
        force, block = residual * pixels.root_weight**2, pixels.block()
        blocks = int(block.max()) + 1
        moment = np.zeros((len(self.moment), blocks))
        rows = [*range(dense), *self._own_rows(pixels, columns)]
        for j, column in zip(rows, [*columns, *pixels.geometry_slopes], strict=True):
            moment[j] = np.bincount(block, column * force, minlength=blocks)
        glow = (columns[n_theta] * phi[0] + columns[n_theta + 1] * phi[1]) * force
        # The last row is of pixels without a material and is dropped.
        label = np.where(pixels.material >= 0, pixels.material, materials) * blocks + block
        by_material = np.bincount(label, glow, minlength=(materials + 1) * blocks)
        moment[dense : dense + materials] = by_material.reshape(-1, blocks)[:-1]
        cluster = cluster_of(pixels.observation)
        self.block_moment[cluster] = self.block_moment.get(cluster, 0.0) + moment
