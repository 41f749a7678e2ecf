"""Random fields that lie over each other (pixel gains under speckle): which of them do the frames show at once?

Variance components by the method of moments (Henderson's, as products of residuals of different frames at one pixel): a field adds
its variance to a product where both frames share its draw, a gain in every frame, a grain while the rig stands still. Noise that
frames do not share cancels, whatever its size.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import nnls

from activestereo.lab.diagnose_inadequacy import edges
from activestereo.lab.diagnose_score import interval, told
from activestereo.lab.diagnose_static import CLEAR_OF_ENDS, fit_static

# Fields with a draw per pixel, from those that most frames share to those that fewest do: the order in which they are predicted.
_ORDER = ("prnu", "fixed_pattern_noise", "speckle_static")
_BLOCKS = 16
# A component is believed that is so many of its standard errors large.
_SIGMAS = 3.0
# And that makes up this share of what all of them do.
_SMALLEST_PART = 0.1


@dataclass(frozen=True)
class Component:
    """variance and error: of a field's draws; floors: what it adds to the mean square of the train images, in floors."""

    variance: float
    error: float
    floors: float


def shown_together(entries, ranking):
    """The Entries, refitted in order, each to what those before it leave, whose fields the frames show at once beside each other; []
    where fewer than two are shown. entries: of random fields that pass alone, on top of the Ranking's base."""
    chosen = sorted((e for e in entries if e.id in _ORDER), key=lambda e: _ORDER.index(e.id))
    if len(chosen) < 2:
        return []
    train, test = (ranking.rows(o, ranking.base.solution) for o in (ranking.evidence.train, ranking.evidence.test))
    black_dn = ranking.base.solution.nuisances.black_dn
    shown = components({e.id: _largest_sigma(e) for e in chosen}, train, black_dn)
    least = _SMALLEST_PART * sum(c.floors for c in shown.values())
    fitted = []
    for e in (e for e in chosen if shown[e.id].floors > least and shown[e.id].variance > _SIGMAS * shown[e.id].error):
        fit = fit_static(e.id, train, test, black_dn)
        if fit is not None:
            fitted.append(replace(e, static=fit, parameters=_told(e, shown[e.id])))
            train, test = _left_of(train, fit.residuals), _left_of(test, fit.test_residuals)
    return fitted if len(fitted) > 1 else []


def _left_of(rows, residuals):
    return [(*row[:3], r) for row, r in zip(rows, residuals, strict=True)]


def _told(entry, component):
    """The entry's parameters; that of a field of one part is the component's deviation."""
    first, *more = entry.effect.parameters
    if more:
        return entry.parameters
    sigma = float(np.sqrt(component.variance))
    return told(entry.effect, {first.name: interval(first, sigma, component.error / (2.0 * sigma))})


def _largest_sigma(entry):
    """The deviation of a draw as fitted alone: no less than what it is beside others."""
    return float(np.sqrt(sum(s**2 for s in entry.static.sigma.values())))


def components(sigmas, train, black_dn):
    """{id: Component}, jointly; standard errors by leaving out blocks of rows in turn. sigmas: {id: deviation of a draw at most}."""
    ids = list(sigmas)
    blocks, powers = [], {name: 0.0 for name in ids}
    for eye in {o.eye for o, *_ in train}:
        images = [_image(row, sigmas, black_dn) for row in train if row[0].eye == eye]
        for image in images:
            for name in ids:
                powers[name] += float((image.weight * image.levers[name] ** 2).mean()) / len(train)
        for start in range(_BLOCKS):
            part = [_rows_from(image, start) for image in images]
            blocks.append(_normal_equations(part, ids))
    grams, moments = (np.array(list(x)) for x in zip(*blocks, strict=True))
    whole = _solved(grams.sum(0), moments.sum(0))
    left_out = np.array([_solved(grams.sum(0) - g, moments.sum(0) - m) for g, m in zip(grams, moments, strict=True)])
    spread = np.sqrt((len(blocks) - 1) / len(blocks) * ((left_out - left_out.mean(0)) ** 2).sum(0))
    return {name: Component(float(v), float(s), float(v * powers[name])) for name, v, s in zip(ids, whole, spread, strict=True)}


@dataclass(frozen=True)
class _Image:
    """pose: what stands still together; weight: 0 next to edges, whose misplacement stays with the pose, and where draws may be clipped, which
    makes offsets look like gains; levers: {id: DN per draw}."""

    pose: object
    weight: np.ndarray
    residual: np.ndarray
    levers: dict


def _image(row, sigmas, black_dn):
    o, image, dots, residual = row
    levers = {"prnu": image - black_dn, "fixed_pattern_noise": np.ones(image.shape), "speckle_static": dots}
    pose = None if o.frame.is_moving else o.frame.camera_to_world.tobytes()
    reach = np.max([CLEAR_OF_ENDS * sigma * np.abs(levers[name]) for name, sigma in sigmas.items()], axis=0)
    counts = ~edges(o) & (image > reach) & (image < o.view.max_dn - reach)
    return _Image(pose, np.where(counts, o.weight, 0.0), residual, {name: levers[name] for name in sigmas})


def _rows_from(image, start):
    return _Image(image.pose, image.weight[start::_BLOCKS], image.residual[start::_BLOCKS], {k: v[start::_BLOCKS] for k, v in image.levers.items()})


def _normal_equations(images, ids):
    gram, moment = np.zeros((len(ids), len(ids))), np.zeros(len(ids))
    for a, b in combinations(images, 2):
        still = a.pose is not None and a.pose == b.pose
        levers = [a.levers[n] * b.levers[n] * (still or n != "speckle_static") for n in ids]
        weight = a.weight * b.weight
        for i, lever in enumerate(levers):
            moment[i] += float((weight * lever * a.residual * b.residual).sum())
            gram[i] += [float((weight * lever * other).sum()) for other in levers]
    return gram, moment


def _solved(gram, moment):
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    return nnls(gram / np.outer(norm, norm), moment / norm)[0] / norm
