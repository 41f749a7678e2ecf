# SPDX-License-Identifier: Apache-2.0
"""Goodness of fit without an alternative hypothesis: how much of a residual any smooth effect could still explain.

Within a tile every smooth effect on the expected image acts as an offset, a gain, a displacement or a blur. These are
fitted to each half of the tile's pixels separately. The part on which both halves agree is structure, the rest is
noise. Independent draws (photons, read noise, grains, the renderer's samples) do not agree, in expectation.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import laplace

from activestereo.diagnose.evidence.observation import TILE_PX
from activestereo.diagnose.refine.fitter import ImageResidual

# Side of the chessboard's squares that make up the halves: neighbours share noise where images were resampled.
_SQUARE_PX = 4
# Precision of the coefficients' prior, as a part of the mean information of half a tile: coefficients that it cannot
# tell apart stay small.
_RIDGE = 0.05


def local_structure(rows: Sequence[ImageResidual]) -> float:
    """Returns the part of the residual on which both halves of the tiles agree: mean square per pixel, noise variances.

    It is unbiased up to the ridge, which holds it down: for pure noise it is near 0, of either sign.
    """
    pixels = [row.observation.pixels for row in rows]
    return sum(image_structure(row) * n for row, n in zip(rows, pixels, strict=True)) / sum(pixels)


def image_structure(row: ImageResidual) -> float:
    """Returns local_structure() of one image."""
    o, image, _, residual = row
    root = np.sqrt(o.weight)
    slope_v, slope_u = np.gradient(image)
    shapes = [_tiles(root * c) for c in (np.ones(image.shape), image, slope_u, slope_v, laplace(image))]
    x, target = np.stack(shapes, axis=-1), _tiles(root * residual)
    place = np.arange(TILE_PX) // _SQUARE_PX
    first = (np.add.outer(place, place) % 2 == 0).ravel()
    halves = [(x[:, half], target[:, half]) for half in (first, ~first)]
    grams = [columns.transpose(0, 2, 1) @ columns for columns, _ in halves]
    norm = np.sqrt(np.maximum(0.5 * np.einsum("tii->ti", grams[0] + grams[1]), 1e-30))
    a, b = (_fit(gram, columns, y, norm) for gram, (columns, y) in zip(grams, halves, strict=True))
    agreed = np.einsum("ti,tij,tj->t", a, grams[0] + grams[1], b)
    return float(agreed.sum() / target.size * row.residual.size / o.pixels)


def _tiles(values: np.ndarray) -> np.ndarray:
    """Cuts an image into tiles, [tile][pixel of the tile]; tiles that the image's border cuts are left out."""
    rows, columns = (n // TILE_PX for n in values.shape)
    cut = values[: rows * TILE_PX, : columns * TILE_PX].reshape(rows, TILE_PX, columns, TILE_PX)
    return cut.transpose(0, 2, 1, 3).reshape(rows * columns, TILE_PX**2)


def _fit(gram: np.ndarray, x: np.ndarray, target: np.ndarray, norm: np.ndarray) -> np.ndarray:
    """Fits a ridge regression in each tile; returns coefficients [tile][column].

    norm: of the columns, [tile][column], the same for both halves. The ridge is a part of a half's mean information on
    a column. A half that hardly shows a column (an edge that lies in the other half) therefore gets a small
    coefficient.
    """
    scaled = gram / (norm[:, :, None] * norm[:, None, :]) + _RIDGE * np.eye(x.shape[2])
    moment = np.einsum("tpi,tp->ti", x, target) / norm
    return np.linalg.solve(scaled, moment[..., None])[..., 0] / norm
