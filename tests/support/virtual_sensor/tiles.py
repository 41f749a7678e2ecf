# SPDX-License-Identifier: Apache-2.0
"""Defines rectangles of tiles, each with its own albedo, as printed patterns on tables and walls."""

from dataclasses import dataclass

import numpy as np

from virtual_sensor.solids import Rectangle


@dataclass(frozen=True)
class Tiles(Rectangle):
    """A rectangle of tiles. albedo: nested tuple [rows along u][columns along v]."""

    def _grid(self):
        return np.asarray(self.albedo, dtype=np.float64)

    def tile_of(self, points):
        """Returns the row and column of the tile under each of the points [..., 3] on the rectangle."""
        grid = self._grid()
        offset = points - np.asarray(self.centre, dtype=np.float64)
        indices = []
        for edge, count in zip((self.u, self.v), grid.shape, strict=True):
            edge = np.asarray(edge, dtype=np.float64)
            where = (offset @ edge / (edge @ edge) + 1.0) * 0.5 * count
            indices.append(np.clip(where.astype(int), 0, count - 1))
        return tuple(indices)

    def albedo_at(self, points):
        return self._grid()[self.tile_of(points)]

    def pieces(self):
        """Returns one Patchwork for each albedo, with all tiles that have it."""
        grid = self._grid()
        return [Patchwork(f"{self.name}{k}", self, float(shade)) for k, shade in enumerate(np.unique(grid))]


@dataclass(frozen=True)
class Patchwork:
    """All tiles of one albedo in a Tiles rectangle, as one solid for the glTF file."""

    name: str
    tiles: Tiles
    albedo: float

    def triangles(self):
        grid = np.asarray(self.tiles.albedo, dtype=np.float64)
        centre, u, v = (np.asarray(a, dtype=np.float64) for a in (self.tiles.centre, self.tiles.u, self.tiles.v))
        rows, columns = grid.shape
        positions, normals, faces = [], [], []
        for i, j in np.argwhere(grid == self.albedo):
            middle = centre + u * ((2 * i + 1) / rows - 1.0) + v * ((2 * j + 1) / columns - 1.0)
            tile = Rectangle("", tuple(middle), tuple(u / rows), tuple(v / columns), self.albedo).triangles()
            positions.append(tile[0])
            normals.append(tile[1])
            faces.append(tile[2] + 4 * len(faces))
        return np.concatenate(positions), np.concatenate(normals), np.concatenate(faces)
