# SPDX-License-Identifier: Apache-2.0
"""Projects the radiance of every surface cell of a room out of residuals and columns, so that no texture must be known.

A cell is a pixel of one view with a surface behind it. A column is the change of all images by one effect. In a band
(bands.py), image k shows z_k = g_k t + sum of columns c, with the cell's unknown radiance t and the image's gain g.
Weighted least squares for t removes the radiances (Schur's complement, block by block). The rest is linear in the
columns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.views import Image
from activestereo.diagnose.room.bands import BANDS, LEAST_GEOMETRY
from activestereo.diagnose.room.columns import Column, gradient_change, of_view, prior_precision
from activestereo.diagnose.room.light import RoomLight

# Every n-th pixel is a cell: neighbours in a band share errors.
_STEP = {"slow": 4, "fine": 3, "dots": 4, "pair": 3}
# Deviation of one image's value in a band: a floor in DN, and a share of the light.
_ERROR = {"slow": (0.25, 0.02), "fine": (0.5, 0.015), "dots": (0.3, 0.05), "pair": (0.5, 0.025)}
_TILES = (5, 8)  # of a view's image, down and across
# Share of a motion that a pair of images shows, for its cameras' gradients differ: known distortions of a lens were
# found at 0.60 of their size in a D415's recordings, at 0.66 in drawn rooms.
_SHOWN = 0.6
_STUDENT, _ROUNDS, _RIDGE = 3.0, 3, 1e-9


@dataclass
class Block:
    """One view's surface cells (pixels with a surface behind them) in one band. at: {image index: (column, row) of each
    cell in that image, px}. residual [image][cell]: recorded values, with the cells' radiances not yet removed. columns
    [column][image][cell]: image changes by each effect or calibration error. gain and error variance [image][cell]; the
    variance is infinite if an image does not see a cell. tile [cell]: index of each cell's image tile."""

    band: str
    at: dict[int, tuple[Image, Image]]
    residual: NDArray[np.float32]
    columns: NDArray[np.float32]
    gain: NDArray[np.float32]
    variance: NDArray[np.float32]
    tile: NDArray[np.int64]

    def read(self, k: int, image: Image, order: int = cv2.INTER_CUBIC) -> NDArray[np.float32]:
        """Returns image k sampled at the cells, [cell]. order: OpenCV's interpolation."""
        column, row = self.at[k]
        out = np.empty(column.shape[1], np.float32)
        for first in range(0, len(out), 30000):  # OpenCV's remap takes at most 32767 columns
            part = np.s_[:, first : first + 30000]
            out[first : first + 30000] = cv2.remap(
                image, column[part], row[part], order, borderMode=cv2.BORDER_REPLICATE
            )
        return out


@dataclass(frozen=True)
class Normal:
    """The normal equations for the columns' coefficients, after the cells' radiances are projected out. information
    [tile][column][column], score [tile][column], for the tiles of all bands. trust: {band: mean of the cells' final
    weights, relative to 1 / variance}. prior: the columns' prior precision [column][column]."""

    information: NDArray[np.float64]
    score: NDArray[np.float64]
    trust: Mapping[str, float]
    prior: NDArray[np.float64]


def blocks_of(room: Room, light: RoomLight, columns: Sequence[Column], bands: Sequence[str] = BANDS) -> list[Block]:
    """Returns a Block for each view and band that has cells, with recorded values and each column's change of each
    image. The change is 0 in images that the column does not affect."""
    blocks = [_block(room, light, band, view, len(columns)) for view in range(room.views) for band in bands]
    blocks = [block for block in blocks if len(block.tile)]
    for number, column in enumerate(columns):
        for k in column.images:
            changed = _changed(room, light, column, k, bands)
            for block in (b for b in blocks if b.band in changed and k in b.at):
                on = k - k % 2 if block.band == "pair" and column.flow is not None else k
                block.columns[number, list(block.at).index(k)] = block.read(on, changed[block.band])
    return blocks


def _changed(room: Room, light: RoomLight, column: Column, k: int, bands: Sequence[str]) -> dict[str, Image]:
    """Returns {band: change of image k by a column at coefficient 1}, for the bands in which the column counts. In the
    band "pair", a displacement is computed on the left camera's pixels for both images. Errors of two images' gradients
    would differ by more than the two cameras' displacements do."""
    looks, asked = light.looks[k], [band for band in bands if band in column.bands]
    unlit = column.change(k, light.room[k])
    out = {band: image for band, image in looks.of_room(unlit).items() if band in asked}
    if "dots" in asked:
        out["dots"] = looks.even(looks.amplitude(column.change(k, light.room[k] + light.dots[k]) - unlit))
    if "pair" in asked and column.flow is not None:
        flow, left = column.moves(k), k - k % 2
        if k != left:
            there, own = room.places(left, k), column.moves(left)
            along, across = (np.where(there.seen, there.read(d), o) for d, o in zip(flow, own, strict=True))
            flow = along, across
        out["pair"] = light.looks[left].pair(np.float32(_SHOWN) * gradient_change(light.both[left], *flow))
    elif "pair" in asked:
        out["pair"] = looks.pair(column.change(k, light.both[k]))
    return out


def _block(room: Room, light: RoomLight, band: str, view: int, columns: int) -> Block:
    """Returns the Block of a view's cells in one band, with residual, gain and variance from `light`. columns: the
    number of columns; they stay 0 until blocks_of() fills them."""
    step, own = np.s_[1 :: _STEP[band], 1 :: _STEP[band]], 2 * view
    asked = {"dots": range(0, 2 * room.judged, 2),  # sessions differ in the pattern's scale
             "pair": of_view(view)}.get(band, range(len(room.images)))  # fmt: skip
    places = {k: room.places(own, k) for k in asked}
    new = room.images[own].usable.copy()
    for earlier in range(view if band != "pair" else 0):
        new &= ~room.places(own, 2 * earlier).seen
    seen = np.stack([places[k].seen[step] & new[step] for k in asked])
    if band == "dots":
        bright = {k: (room.images[k].geometry > LEAST_GEOMETRY).astype(np.float32) for k in asked}
        seen &= np.stack([places[k].read(bright[k])[step] > 0.99 for k in asked])
    live = seen.sum(axis=0) > 1
    row, column = np.indices(live.shape)
    tile = (view * _TILES[0] + row * _TILES[0] // live.shape[0]) * _TILES[1] + column * _TILES[1] // live.shape[1]
    tile += BANDS.index(band) * _tiles(room)  # each band has its own tiles
    # Cells lie between pixels, so that every image is interpolated alike: interpolation blurs.
    shift = np.random.default_rng(0).uniform(-0.5, 0.5, (2, *live.shape)).astype(np.float32)
    between = [
        np.float32(1) + _STEP[band] * n.astype(np.float32) + s for n, s in zip((column, row), shift, strict=True)
    ]
    read = lambda of_pixels: cv2.remap(of_pixels, *between, cv2.INTER_LINEAR)[live][None]  # noqa: E731
    at = {k: (read(places[k].column), read(places[k].row)) for k in asked}
    seen = seen[:, live]
    residual, gain, level = (np.empty(seen.shape, np.float32) for _ in range(3))
    block = Block(band, at, residual, np.zeros((columns, *seen.shape), np.float32), gain, level, tile[live])
    floor, share = _ERROR[band]
    for n, k in enumerate(asked):
        each = light.looks[k].all(light.seen[k])
        residual[n] = block.read(k, each[band])
        lit = light.gain[k] * room.images[k].geometry if band == "dots" else light.gain[k]
        gain[n] = block.read(k, lit, cv2.INTER_LINEAR)
        level[n] = np.abs(block.read(k, each["dots" if band == "dots" else "slow"], cv2.INTER_LINEAR))
    block.variance = np.where(seen, floor**2 + (share * level) ** 2, np.inf).astype(np.float32)
    return block


def normal(
    room: Room, columns: Sequence[Column], blocks: Sequence[Block], beside: int,
    planned: Mapping[str, float] | None = None,
) -> Normal:  # fmt: skip
    """Sums the blocks' cells into the normal equations of the columns' coefficients. beside: the first `beside` columns
    are fitted before cells get robust weights; changes by other columns then count as outliers. planned: Normal.trust
    of a real recording, for blocks of a planned one. Nothing is measured there yet, so all scores are 0.

    A cell's weight falls with its own residual (Student's distribution). A band is scaled by its cells' spread.
    Information and scores are divided by the overdispersion of the tiles' scores, at least 1 (a tempered likelihood).
    """
    prior, tiles, count = prior_precision(room, columns), _tiles(room), len(columns)
    information, score = np.zeros((len(BANDS) * tiles, count, count)), np.zeros((len(BANDS) * tiles, count))
    trust = dict(planned or {})
    for number, band in enumerate(BANDS):
        own, of_band = [b for b in blocks if b.band == band], slice(number * tiles, (number + 1) * tiles)
        first = [1.0 / b.variance for b in own]
        if planned is not None:
            _sum_tiles(own, [np.float32(trust.get(band, 0.0)) * w for w in first], information, score)
        elif own:
            weights = _robust(own, first, beside, prior)
            _sum_tiles(own, weights, information, score)
            temper = _temper(information[of_band], score[of_band], beside, prior)
            information[of_band] /= temper
            score[of_band] /= temper
            trust[band] = float(sum(w.sum() for w in weights) / sum(w.sum() for w in first)) / temper
    return Normal(information, score if planned is None else np.zeros_like(score), trust, prior)


def _tiles(room: Room) -> int:
    """Returns the number of tiles (rectangles of an image) in one band, summed over all views."""
    return room.views * _TILES[0] * _TILES[1]


def _sum_tiles(
    blocks: Sequence[Block], weights: Sequence[NDArray[np.float32]], information: NDArray[np.float64],
    score: NDArray[np.float64],
) -> None:  # fmt: skip
    """Writes each tile's information [tile][c][c] and score [tile][c], summed over its cells, into the arrays given.
    weights: [image][cell] of each block."""
    for b, w in zip(blocks, weights, strict=True):
        z = _projected(np.concatenate([b.residual[None], b.columns]), w, b.gain)
        order = np.argsort(b.tile, kind="stable")
        for part in np.split(order, np.flatnonzero(np.diff(b.tile[order])) + 1):
            here = z[:, :, part].reshape(len(z), -1)
            product = ((here * w[:, part].ravel()) @ here.T).astype(np.float64)
            information[b.tile[part[0]]], score[b.tile[part[0]]] = product[1:, 1:], product[1:, 0]


def _projected(z: NDArray[np.float32], weight: NDArray[np.float32], gain: NDArray[np.float32]) -> NDArray[np.float32]:
    """Projects the cells' radiances out of z [c][image][cell]. For each cell it fits z = radiance x gain over the
    images by weighted least squares, and returns z minus that fit."""
    square = np.maximum((weight * gain * gain).sum(axis=0), 1e-9)
    mean = np.einsum("ij,cij->cj", weight * gain, z) / square
    return z - gain * mean[:, None]


def _robust(
    blocks: Sequence[Block], first: list[NDArray[np.float32]], beside: int, prior: NDArray[np.float64]
) -> list[NDArray[np.float32]]:
    """Returns robust weights [image][cell] of each block. A weight falls with the cell's residual, relative to the
    spread of all residuals, after a fit of the first `beside` columns. first: 1 / variance of each block. prior: the
    columns' prior precision."""
    weights = first
    for _ in range(_ROUNDS):
        z = [_projected(np.concatenate([b.residual[None], b.columns[:beside]]), w, b.gain)
             for b, w in zip(blocks, weights, strict=True)]  # fmt: skip
        flat = [x.reshape(len(x), -1) for x in z]
        H = sum(((x * w.ravel()) @ x.T).astype(np.float64) for x, w in zip(flat, weights, strict=True))
        eta = _fitted(H[1:, 1:], prior[:beside, :beside], H[1:, 0]).astype(np.float32)
        each = []  # mean square residual of each block's cells
        for x, w in zip(z, first, strict=True):
            rest = x[0] - np.einsum("c,cij->ij", eta, x[1:])
            each.append((rest * rest * w).sum(axis=0) / np.maximum((w > 0).sum(axis=0) - 1, 1))
        square = float(np.sqrt(np.median(np.concatenate(each)) / 0.6)) ** 2
        weights = [(w / (1.0 + x / square / _STUDENT) / square).astype(np.float32)
                   for w, x in zip(first, each, strict=True)]  # fmt: skip
    return weights


def _temper(
    information: NDArray[np.float64], score: NDArray[np.float64], beside: int, prior: NDArray[np.float64]
) -> float:
    """Returns the overdispersion of the tiles' scores after a fit of the first `beside` columns, at least 1."""
    H, s = information.sum(axis=0), score.sum(axis=0)
    eta = _fitted(H[:beside, :beside], prior[:beside, :beside], s[:beside])
    told = np.diag(H) > 1e-9
    ratio = ((score - information[:, :, :beside] @ eta) ** 2).sum(axis=0)[told] / np.diag(H)[told]
    return float(np.clip(np.median(ratio), 1.0, 1e4))


def _fitted(H: NDArray[np.float64], prior: NDArray[np.float64], score: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.solve(H + prior + np.diag(_RIDGE * np.diag(H)), score)
