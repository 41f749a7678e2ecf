# SPDX-License-Identifier: Apache-2.0
"""From fits to evidence: cross-validated chi2, the pixels' effective number, log-likelihood gains."""

from collections.abc import Sequence

import numpy as np

from activestereo.diagnose.evidence.observation import FOLDS, Observation
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.parameter_space import Solution

# An image that an effect changes by less than this share of its chi2 is not touched by it.
_TOUCHED_SHARE = 0.002


def cross_validated(fitter: Fitter, solution: Solution) -> float:
    """chi2 where each fold of tiles is judged with the parameters of the others, by the linearisation at the
    solution.
    """
    sums, n = solution.sums, len(solution.theta)
    total = 0.0
    for fold in range(FOLDS):
        kept = type(sums)(np.delete(sums.gram, fold, 0), np.delete(sums.moment, fold, 0), sums.chi2, sums.tile_chi2)
        step = fitter.solve(kept, solution.phi, n, solution.space, solution.theta, 1e-9)
        total += sums.chi2[fold] - 2.0 * step @ sums.moment[fold] + step @ sums.gram[fold] @ step
    return float(total)


def design_effect(tile_chi2: np.ndarray, tile_pixels: np.ndarray) -> float:
    """By how much the tiles' chi2 varies more than that of as many independent normal pixels: 1 = independent."""
    full = tile_pixels > 0.5 * tile_pixels.max()
    chi2, pixels = tile_chi2[full], tile_pixels[full]
    scale = max(chi2.sum() / pixels.sum(), 1e-12)
    return float(max(1.0, (chi2 / pixels).var() * pixels.mean() / (2.0 * scale**2)))


def nats_of(base_chi2: float, chi2: float, pixels: int, design: float) -> float:
    """Gain of the profile log-likelihood with the noise scale free: what no model explains counts as noise."""
    return 0.5 * pixels / design * float(np.log(base_chi2 / chi2))


def gain_error(first_tiles: np.ndarray, second_tiles: np.ndarray, chi2: float, pixels: int, design: float) -> float:
    """Standard error of the difference of two explanations' nats, paired by tile.

    tiles: chi2 by tile; chi2: the smaller total.
    """
    difference = first_tiles - second_tiles
    spread = np.sqrt(len(difference) * difference.var())
    return 0.5 * pixels / design * spread / chi2


def frame_consistency(observations: Sequence[Observation], base_tiles: np.ndarray, tiles: np.ndarray) -> float:
    """Share of the images that get better, of those that an effect touches noticeably (weighed alike)."""
    better = touched = 0
    for o in observations:
        index = np.unique(o.tile)
        before, after = base_tiles[index].sum(), tiles[index].sum()
        if abs(before - after) > _TOUCHED_SHARE * before:
            touched += 1
            better += after < before
    return better / touched if touched else 0.0
