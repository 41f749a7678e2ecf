"""From fits to evidence: cross-validated chi2, the pixels' effective number, log-likelihood gains, intervals."""

from dataclasses import dataclass, field

import numpy as np

from activestereo.lab.diagnose_data import FOLDS, TILE_PX
from activestereo.lab.diagnose_occam import is_shape

# Normal quantile of a two-sided 90 % interval.
Z90 = 1.645
# Formulas and survey are approximate: to this share of what was found (blind worlds with formulas of their own err by 8 % in the
# median, practice captures by 0.2-5 %; with this share intervals hold the truth in 20 of 22 worlds of generation 1).
_INADEQUACY = 0.10


@dataclass
class Entry:
    """One explanation of the train frames. chi2: cross-validated; tile_chi2: in-sample, by tile; frame_gain: relative fall of each
    frame's chi2 that the effect touches; parameters: {name: {value, low, high, unit}}; explained: share of the chi2 above the floor.

    varying: mean square, in floors, that its trace would explain beyond that with an amplitude that varies (diagnose_constancy).

    occam: nats that its freedom costs, 0 for what is not fitted to images; choice: nats of choices that it took (diagnose_occam) or that
    the survey's errors may explain (diagnose_depth); repeats: mean square, in floors, that it leaves in every frame of a view alike
    (rounding to coarse steps), which is no other effect's.

    plain_share, plain_floors: explained and gain_floors of the error in DN as it is, not weighed by its expected variance; None
    where it was not looked at. channel: what it is judged on: "infrared" (expected images), "noise" (repeats) or "depth" (the device's disparity); of the last two
    chi2 is the base's, and explained is a share of the noise's or the disparity error's variance."""

    effect: object
    chi2: float
    tile_chi2: np.ndarray
    solution: object = None
    static: object = None
    parameters: dict = field(default_factory=dict)
    nats: float = 0.0
    explained: float = 0.0
    gain_floors: float = 0.0
    plain_share: float | None = None
    plain_floors: float = 0.0
    consistency: float = 1.0
    channel: str = "infrared"
    occam: float = 0.0
    choice: float = 0.0
    repeats: float = 0.0
    varying: float = 0.0

    @property
    def id(self):
        return self.effect.id


def cross_validated(fitter, solution):
    """chi2 where each fold of tiles is judged with the parameters of the others, by the linearisation at the solution."""
    sums, play = solution.sums, solution.play
    n = len(solution.theta)
    total = 0.0
    for fold in range(FOLDS):
        kept = type(sums)(np.delete(sums.gram, fold, 0), np.delete(sums.moment, fold, 0), sums.chi2, sums.tile_chi2)
        step = fitter.solve(kept, solution.phi, n, play, solution.theta, 1e-9)
        total += sums.chi2[fold] - 2.0 * step @ sums.moment[fold] + step @ sums.gram[fold] @ step
    return float(total)


def design_effect(tile_chi2, tile_pixels):
    """By how much the tiles' chi2 varies more than that of as many independent normal pixels: 1 = independent."""
    full = tile_pixels == TILE_PX**2
    values = tile_chi2[full] if full.sum() > 8 else tile_chi2
    per_tile = tile_pixels[full] if full.sum() > 8 else tile_pixels
    scale = values.sum() / per_tile.sum()
    return float(max(1.0, values.var() / (2.0 * per_tile.mean() * max(scale, 1e-12) ** 2)))


def nats_of(base_chi2, chi2, pixels, deff):
    """Gain of the profile log-likelihood with the noise scale free: what no model explains counts as noise."""
    return 0.5 * pixels / deff * float(np.log(base_chi2 / chi2))


def gain_error(base, entry, deff, base_chi2, pixels):
    """Standard error of a difference of nats between two entries, paired by tile."""
    difference = base.tile_chi2 - entry.tile_chi2
    spread = np.sqrt(len(difference) * difference.var())
    return 0.5 * pixels / deff * spread / base_chi2


def interval(parameter, value, deviation):
    """(value, low, high) of a 90 % interval: a standard error, and the models' own inadequacy for what was found: an amplitude's distance
    from neutral, a shape's whole value, whose neutral one is a usual place and not the absence of anything."""
    size = value if is_shape(parameter) else value - parameter.neutral
    half = 0.0 if parameter.choice else Z90 * float(np.hypot(deviation, _INADEQUACY * size))
    return value, value - half, value + half


def intervals(fitter, solution, first, candidate):
    """{name: {value, low, high, unit}} of the candidate's parameters, 90 %, clipped to their ranges. first: the index of its first."""
    deviation = np.sqrt(np.maximum(np.diag(fitter.covariance(solution)), 0.0))
    values = solution.theta[first:]
    return told(candidate, {p.name: interval(p, v, d) for p, v, d in zip(candidate.parameters, values, deviation[first:], strict=False)})


def told(candidate, found):
    """Parameters of an Entry from {name: (value, low, high)}, inside their ranges; neutral and unknown where not found."""
    out = {}
    for p in candidate.parameters:
        value, low, high = found.get(p.name, (p.neutral, p.low, p.high))
        low, high = min(max(p.low, low), p.high), max(min(p.high, high), p.low)  # an end that is no number is the range's
        out[p.name] = {"value": float(np.clip(value, p.low, p.high)), "low": float(low), "high": float(high), "unit": p.unit}
    return out


def frame_consistency(observations, base_tiles, tiles):
    """Share of the images that get better, of those that an effect touches noticeably (weighed alike)."""
    better = touched = 0
    for o in observations:
        index = np.unique(o.tile)
        before, after = base_tiles[index].sum(), tiles[index].sum()
        if abs(before - after) > 0.002 * before:
            touched += 1
            better += after < before
    return better / touched if touched else 0.0
