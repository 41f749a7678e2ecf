# SPDX-License-Identifier: Apache-2.0
"""Scores every column of a dictionary by the linear model, with the nuisances projected out under their priors.

A are the nuisances' columns, with prior precision P and pull o; C are the columns and r is the residual, all in noise
deviations. With X = A C' and K = (A A' + P)^-1 (Schur's complement),

    information on the columns' coefficients    S = C C' - X' K X
    their score                                 u = C (r - A' K (A r - o))

Sums are kept apart by the surface that a pixel shows, so that an effect of some surfaces needs no columns of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.search.linear import Columns, Linear
from activestereo.effects.core.surfaces import MOST_MATERIALS

# A surface with a smaller share of the pixels has no group of its own.
_LEAST_SURFACE = 0.002
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Scores:
    """Holds inner products over pixels for c columns, k nuisances and each group of pixels: one group for each large
    surface, the last for the rest. gram [groups][c][c]: columns with columns; cross [groups][k][c]: nuisances with
    columns; moment [groups][c]: columns with the residual after the nuisances' fit. by_block [groups][c][blocks],
    nuisance_by_block [k][blocks]: the latter by image block.

    surfaces: the number of each group's surface. inverse: K of this file's head. total: chi2 of that residual. pixels:
    their number.
    """

    gram: Matrix
    cross: Matrix
    moment: Matrix
    by_block: NDArray[np.float32]
    nuisance_by_block: Matrix
    surfaces: tuple[int, ...]
    inverse: Matrix
    total: float
    pixels: int

    def select(self, columns: slice, surfaces: Sequence[int] | None = None) -> tuple[Matrix, Matrix, Matrix]:
        """Returns (information [c][c], score [c], score by image block [c][blocks]) of columns on some surfaces; None =
        on all."""
        groups: slice | list[int] = slice(None)
        if surfaces is not None:
            groups = [g for g, number in enumerate(self.surfaces) if number in surfaces]
        X = self.cross[:, :, columns][groups].sum(0)
        G = self.inverse @ X
        information = self.gram[:, columns, columns][groups].sum(0) - X.T @ G
        blocks = self.by_block[:, columns][groups].sum(0) - G.T @ self.nuisance_by_block
        return information, self.moment[:, columns][groups].sum(0), blocks


def scores(linear: Linear, columns: Columns) -> Scores:
    """Computes the Scores of columns [c][n] by a linear model."""
    A, r = linear.nuisances, linear.residual
    K = (A @ A.T).astype(np.float64) + np.diag(linear.precision)
    norm = np.sqrt(np.maximum(np.diag(K), 1e-300))
    inverse = np.linalg.pinv(K / np.outer(norm, norm), rcond=1e-7, hermitian=True) / np.outer(norm, norm)
    step = inverse @ ((A @ r).astype(np.float64) - linear.pull)
    left = r - step.astype(np.float32) @ A
    surfaces, group = _groups(linear.material)
    blocks = int(linear.block.max()) + 1
    sums = []
    for g in range(len(surfaces) + 1):
        here = np.flatnonzero(group == g)
        here = here[np.argsort(linear.block[here], kind="stable")]
        C, rest = columns[:, here], left[here]
        by_block = np.zeros((len(columns), blocks), np.float32)
        if here.size:
            found, starts = np.unique(linear.block[here], return_index=True)
            by_block[:, found] = np.add.reduceat(C * rest, starts, axis=1)
        products = C @ C.T, A[:, here] @ C.T, C @ rest
        sums.append((*(x.astype(np.float64) for x in products), by_block))
    gram, cross, moment, by_block = (np.stack(x) for x in zip(*sums, strict=True))
    total = float(r @ r - step @ ((A @ r) - linear.pull))
    by_nuisance = [np.bincount(linear.block, a * left, minlength=blocks).astype(np.float64) for a in A]
    nuisance_by_block = np.stack(by_nuisance)
    return Scores(gram, cross, moment, by_block, nuisance_by_block, surfaces, inverse, total, len(r))


def _groups(material: NDArray[np.int64]) -> tuple[tuple[int, ...], NDArray[np.int64]]:
    """Returns (surfaces that are large enough, each pixel's group)."""
    numbers, counts = np.unique(material, return_counts=True)
    large = numbers[(counts > _LEAST_SURFACE * len(material)) & (numbers < MOST_MATERIALS)]
    group = np.searchsorted(large, material)
    inside = np.isin(material, large)
    return tuple(map(int, large)), np.where(inside, group, len(large))
