# SPDX-License-Identifier: Apache-2.0
"""Computes indirect light by radiosity: form factors between texels by quasi-random rays, once per scene, for every
pose of the rig. All values are irradiance / pi, so that albedo times a value is a radiance."""

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates
from scipy.sparse import csr_matrix

from virtual_sensor.held_out.caster import LIFT_M, albedo_of, closest, tangents
from virtual_sensor.held_out.charts import charts, inside, locate

_RAYS = 192
_CHUNK = 400_000
_BOUNCES = 5
# The plastic number gives the rank-1 sequence of lowest discrepancy in two dimensions (Roberts 2018).
_R2 = np.array([0.7548776662466927, 0.5698402909980532])


class Lightmap:
    """Holds the texels of all solids, the light transport between them, and the sky's share at each."""

    def __init__(self, solids, rng, spacings):
        self._solids = solids
        self._charts = [charts(solid, spacing) for solid, spacing in zip(solids, spacings, strict=True)]
        flat = [(i, chart) for i, group in enumerate(self._charts) for chart in group]
        sizes = [chart.points.shape[0] * chart.points.shape[1] for _, chart in flat]
        starts = np.cumsum([0, *sizes])
        self.points = np.concatenate([chart.points.reshape(-1, 3) for _, chart in flat])
        self.normals = np.concatenate([chart.normals.reshape(-1, 3) for _, chart in flat])
        self.owner = np.concatenate([np.full(size, i) for (i, _), size in zip(flat, sizes, strict=True)])
        self._starts, at = [], 0
        for group in self._charts:
            self._starts.append(starts[at : at + len(group)])
            at += len(group)
        self.albedo = albedo_of(solids, self.owner, self.points)
        self.exposed = self._exposed()
        self._transport, self._sky = self._trace(rng)

    def _exposed(self):
        lifted = self.points + 1e-4 * self.normals
        hidden = np.zeros(len(lifted), dtype=bool)
        for i, solid in enumerate(self._solids):
            hidden |= inside(solid, lifted) & (self.owner != i)
        return ~hidden

    def _trace(self, rng):
        texels = np.flatnonzero(self.exposed)
        shift = rng.random((len(texels), 2))
        sky = np.zeros(len(self.points))
        rows, columns = [], []
        per_chunk = max(1, _CHUNK // _RAYS)
        for start in range(0, len(texels), per_chunk):
            part = texels[start : start + per_chunk]
            u = (shift[start : start + per_chunk, None] + np.arange(1, _RAYS + 1)[None, :, None] * _R2) % 1.0
            directions = _cosine(np.repeat(self.normals[part], _RAYS, axis=0), u.reshape(-1, 2))
            origins = np.repeat(self.points[part] + LIFT_M * self.normals[part], _RAYS, axis=0)
            t, _, index = closest(self._solids, origins, directions)
            sky[part] = (index < 0).reshape(-1, _RAYS).mean(axis=1)
            hit = np.flatnonzero(index >= 0)
            rows.append(np.repeat(part, _RAYS)[hit])
            columns.append(self._nearest_texel(index[hit], origins[hit] + t[hit, None] * directions[hit]))
        rows, columns = np.concatenate(rows), np.concatenate(columns)
        shape = (len(self.points), len(self.points))
        return csr_matrix((np.full(len(rows), 1.0 / _RAYS), (rows, columns)), shape=shape), sky

    def _nearest_texel(self, index, points):
        texel = np.zeros(len(points), dtype=int)
        for i, solid in enumerate(self._solids):
            here = np.flatnonzero(index == i)
            if not here.size:
                continue
            shapes = np.array([chart.points.shape[:2] for chart in self._charts[i]])
            chart, row, column = locate(solid, points[here], shapes)
            row = np.clip(np.rint(row).astype(int), 0, shapes[chart, 0] - 1)
            column = np.clip(np.rint(column).astype(int), 0, shapes[chart, 1] - 1)
            texel[here] = self._starts[i][chart] + row * shapes[chart, 1] + column
        return texel

    def bounced(self, first):
        """Returns the light at each texel after one bounce or more. first: the light that arrives directly."""
        total = np.zeros_like(first)
        for _ in range(_BOUNCES):
            total = self._transport @ (self.albedo * self._filled(first + total))
        return self._filled(total)

    def ambient(self, bounce_gain=0.0):
        """Returns each texel's light under a sky of radiance 1. bounce_gain: relative excess of bounced light."""
        return self._filled(self._sky) + (1.0 + bounce_gain) * self.bounced(self._sky)

    def _filled(self, values):
        """Gives texels inside of other solids the nearest exposed texel's value, for interpolation."""
        values = values.copy()
        for starts, group in zip(self._starts, self._charts, strict=True):
            for start, chart in zip(starts, group, strict=True):
                part = slice(start, start + chart.points.shape[0] * chart.points.shape[1])
                exposed = self.exposed[part].reshape(chart.points.shape[:2])
                if exposed.all() or not exposed.any():
                    continue
                nearest = distance_transform_edt(~exposed, return_distances=False, return_indices=True)
                values[part] = values[part].reshape(exposed.shape)[tuple(nearest)].ravel()
        return values

    def look_up(self, values, index, points):
        """Interpolates texel values at hit points; 0 without a hit. index: the solid that each ray hits, or -1."""
        found = np.zeros(len(points))
        for i, solid in enumerate(self._solids):
            here = np.flatnonzero(index == i)
            if not here.size:
                continue
            group = self._charts[i]
            shapes = np.array([chart.points.shape[:2] for chart in group])
            chart, row, column = locate(solid, points[here], shapes)
            for c, part in enumerate(group):
                mine = chart == c
                grid = values[self._starts[i][c] :][: shapes[c].prod()].reshape(shapes[c])
                found[here[mine]] = _bilinear(grid, row[mine], column[mine], part.wraps)
        return found


def _bilinear(grid, row, column, wraps):
    if wraps:
        grid, column = np.pad(grid, ((0, 0), (0, 1)), mode="wrap"), column % grid.shape[1]
    return map_coordinates(grid, [row, column], order=1, mode="nearest")


def _cosine(normals, u):
    """Returns cosine-distributed directions about the normals, by Malley's disc. u: random numbers [n][2]."""
    radius, turn = np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
    tangent, bitangent = tangents(normals)
    x, y, z = radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1.0 - u[:, 0])
    return x[:, None] * tangent + y[:, None] * bitangent + z[:, None] * normals
