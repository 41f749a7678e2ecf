"""What repeats tell of temporal noise: structure that independent pixels cannot have (rows, coarse steps), and photon transfer.

The level of independent noise is a nuisance: read, shot and speckle noise are told with their values, but count as missing only
where the model states its noise, that is where it has a temporal noise effect already.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from activestereo.effects import Randomness
from activestereo.lab.noise import repeat_statistics, transfer_rows

_QUANTISATION_VARIANCE = 1.0 / 12.0
# Half of the 90 % quantile of chi-square with one degree of freedom.
_LIKELIHOOD_DROP = 1.353
_STEPS = np.arange(1.5, 32.01, 0.02)
_OFFSETS = np.arange(8) / 8
_COMB_SHARE = 0.995
_LARGEST_CORRELATION = 0.4
_LEAST_LEVELS = 6
_GRID = np.geomspace(1e-3, 20.0, 400)


@dataclass(frozen=True)
class NoiseFit:
    """nats: gain of log-likelihood; variance: what it explains per pixel, DN^2; values: {parameter: (value, low, high)}; repeats: frames
    of one view share it, so that their floor does not hold it."""

    nats: float
    variance: float
    values: dict
    repeats: bool = False


def fit_noise(candidate, evidence, model):
    """A NoiseFit of a candidate that changes noise alone; None where the data have no repeats or it is none of those."""
    if candidate.id == "quantisation":
        return _comb(evidence)
    if candidate.randomness is not Randomness.TEMPORAL or not evidence.has_floor:
        return None
    if candidate.id == "row_noise":
        return _rows(evidence)
    return _transfer(candidate, evidence, model)


def _comb(evidence):
    """Digital numbers that come in steps: the widest comb that holds all pixels."""
    levels = int(evidence.capture.rig.max_dn) + 1
    counts = sum(np.bincount(np.rint(o.measured).astype(int).ravel(), minlength=levels) for o in evidence.train)
    counts[0] = counts[-1] = 0  # clipped
    used, total = np.nonzero(counts)[0], counts.sum()
    if len(used) < _LEAST_LEVELS or len(used) > 0.7 * (used[-1] - used[0] + 1):
        return NoiseFit(0.0, 0.0, {"step_dn": (0.0, 0.0, 1.0)})
    fitting = []
    for step in _STEPS:
        k = np.arange(len(counts) / step + 1)
        for offset in _OFFSETS:
            levels = np.rint(step * (k + offset)).astype(int)
            levels = levels[levels < len(counts)]
            if counts[levels].sum() > _COMB_SHARE * total:
                fitting.append(step)
    if not fitting:
        return NoiseFit(0.0, 0.0, {"step_dn": (0.0, 0.0, 1.0)})
    widest = max(fitting)
    same = [s for s in fitting if s > 0.97 * widest]
    step = float(np.mean(same))
    return NoiseFit(float(total * np.log(step)), step**2 / 12.0, {"step_dn": (step, min(same) - 0.02, max(same) + 0.02)}, repeats=True)


def _rows(evidence):
    """Rows of a frame that share an offset: marginal likelihood of the differences of repeats."""
    weight, moment, pixels, beside, both = [], [], 0, 0.0, 0.0
    for first, second in _pairs(evidence.train):
        w = 0.5 * (first.weight + second.weight)
        difference = (first.measured.astype(np.float64) - second.measured) / np.sqrt(2.0)
        weight.append(w.sum(axis=1))
        moment.append((w * difference).sum(axis=1))
        beside += float(moment[-1][1:] @ moment[-1][:-1])
        both += float(weight[-1][1:] @ weight[-1][:-1])
        pixels += difference.size
    if not weight:
        return None
    A, B = np.concatenate(weight).astype(np.float64), np.concatenate(moment)
    square = _GRID[:, None] ** 2
    nats = 0.5 * (B**2 * square / (1.0 + square * A) - np.log1p(square * A)).sum(axis=1)
    best = int(nats.argmax())
    if nats[best] <= 0:
        return NoiseFit(0.0, 0.0, {"sigma_dn": (0.0, 0.0, float(_GRID[nats > -_LIKELIHOOD_DROP].max(initial=_GRID[0])))})
    if beside > _LARGEST_CORRELATION * both * _GRID[best] ** 2:
        return None  # bands of light that flickers: rows of noise know nothing of each other
    inside = _GRID[nats > nats[best] - _LIKELIHOOD_DROP]
    return NoiseFit(float(nats[best]), float(_GRID[best] ** 2), {"sigma_dn": (float(_GRID[best]), float(inside[0]), float(inside[-1]))})


def _pairs(observations):
    groups = {}
    for o in observations:
        if o.frame.repeat_group is not None:
            groups.setdefault((o.frame.repeat_group, o.eye), []).append(o)
    return [(a, b) for group in groups.values() for a, b in zip(group, group[1:], strict=False)]


# By what a term's variance grows: (effect, parameter, column of gain, signal and signal squared, parameter of a coefficient).
_TERMS = {
    "read_noise": ("sigma_dn", lambda gain, signal, square: np.ones_like(signal), np.sqrt),
    "shot_noise": ("dn_per_electron", lambda gain, signal, square: gain * signal, lambda c: c),
    "speckle_temporal": ("contrast", lambda gain, signal, square: square, np.sqrt),
}


def _transfer(candidate, evidence, model):
    """Photon transfer of the repeats with a term and without it, all others refitted; nats are 0 where the model states no noise."""
    if candidate.id not in _TERMS:
        return None
    capture = evidence.capture
    rows = [row for entry in repeat_statistics(capture, "train") for row in transfer_rows(entry, capture.rig.max_dn)]
    if not rows:
        return None
    stated = [e.id for e, _ in model.effects if e.id in _TERMS]
    others = [name for name in (stated or _TERMS) if name != candidate.id]
    black = evidence.nuisances.black_dn
    without, _, _ = _fit_terms(rows, others, black)
    misfit, value, error = _fit_terms(rows, [candidate.id, *others], black)
    name, column, parameter = _TERMS[candidate.id]
    low, high = (float(parameter(max(value + side * 1.645 * error, 0.0))) for side in (-1, 1))
    mean = np.average([column(row[0], max(row[1] - black, 0.0), max(row[2] - 2 * black * row[1] + black**2, 0.0)) for row in rows])
    nats = 0.5 * (without - misfit) if stated else 0.0
    return NoiseFit(float(nats), float(value * mean), {name: (float(parameter(value)), low, high)})


def _fit_terms(rows, names, black_dn):
    """(chi2, first term's coefficient, its standard error)."""
    gain, mean, square, variance, weight = np.array(rows).T
    signal, signal_square = np.maximum(mean - black_dn, 0.0), np.maximum(square - 2 * black_dn * mean + black_dn**2, 0.0)
    target = (variance - _QUANTISATION_VARIANCE) * weight
    if not names:
        return float((target**2).sum()), 0.0, 0.0
    design = np.stack([_TERMS[n][1](gain, signal, signal_square) for n in names], axis=1) * weight[:, None]
    coefficients, misfit = nnls(design, target)
    norm = np.maximum(np.sqrt((design**2).sum(axis=0)), 1e-300)
    inverse = np.linalg.pinv((design / norm).T @ (design / norm), rcond=1e-12, hermitian=True)
    scale = max(1.0, misfit**2 / max(len(target) - len(names), 1))
    return float(misfit**2), float(coefficients[0]), float(np.sqrt(inverse[0, 0] * scale) / norm[0])
