# SPDX-License-Identifier: Apache-2.0
"""Random fields that overlap, such as pixel gains and speckle: which of them the frames show at once.

Variance components by the method of moments (Henderson's, as products of residuals of different frames at one pixel):
a field adds its variance to a product where both frames share its draw, a gain in every frame, a grain while the rig
stands still. Noise that frames do not share cancels, whatever its size.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import nnls

from activestereo.diagnose.channels.draws import lever_image
from activestereo.diagnose.channels.field_fit import Beside, fit_fields
from activestereo.diagnose.channels.static_field import field_parameters
from activestereo.diagnose.evidence.model_discrepancy import edges
from activestereo.diagnose.findings import BaseFit, Finding
from activestereo.diagnose.refine import ImageResidual
from activestereo.diagnose.score.intervals import Interval, interval, within_ranges
from activestereo.diagnose.thresholds import Thresholds
from activestereo.effects import Effect
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy

_BLOCKS = 16
_ROUNDS = 2


@dataclass(frozen=True)
class Component:
    """variance and error: of a field's draws; reduced_chi2: what it adds to the mean square of the train images, in
    noise variances.
    """

    variance: float
    error: float
    reduced_chi2: float


def pixel_term(effect: Effect) -> RandomTerm | None:
    """The term of an effect that draws for every pixel, or None."""
    terms = (t for t in effect.random_terms if t.shared_by in (SharedBy.PIXEL, SharedBy.VIEW) and not t.sparse_share)
    return next(terms, None)


def shown_together(findings: Sequence[Finding], base: BaseFit, thresholds: Thresholds) -> list[Finding]:
    """Findings of random fields that the frames show at once, refitted in order, each to what those before it
    leave; [] for fewer than two.

    findings: of random fields that may be named alone, on top of the base.
    """
    dense = _dense_together(findings, base, thresholds)
    sparse = [f for f in findings if _is_sparse(f)]
    others = dense or [f for f in findings if not _is_sparse(f)][:1]
    return _with_sparse(sparse, others, base, thresholds) or dense if sparse and others else dense


def _is_sparse(finding: Finding) -> bool:
    return any(term.sparse_share for term in finding.effect.random_terms)


def _with_sparse(
    sparse: Sequence[Finding], others: Sequence[Finding], base: BaseFit, thresholds: Thresholds
) -> list[Finding]:
    """Sparse fields whose draws stand out of the others, and the others as fitted to what those leave; [] for fewer
    than two that add their share to what all explain.
    """
    fitted, gains = list(others), [0.0] * len(others)
    for _ in range(_ROUNDS):  # strong draws widen what they have to stand out of
        fields = [(f.explanation.fields, term) for f in fitted if not _is_sparse(f) for term in f.effect.random_terms]
        beside = [(term, fit.sigma[term.parameter]) for fit, term in fields if fit is not None]
        fitted, gains = _in_turn([(f, beside if _is_sparse(f) else ()) for f in (*sparse, *others)], base, thresholds)
    shown = [f for f, gain in zip(fitted, gains, strict=True) if gain > thresholds.smallest_field_share * sum(gains)]
    return shown if len(shown) > 1 else []


def _in_turn(
    findings: Sequence[tuple[Finding, Beside]], base: BaseFit, thresholds: Thresholds
) -> tuple[list[Finding], list[float]]:
    """Findings, each fitted to what those before it leave, and by how much chi2 falls."""
    rows = base.train
    fitted: list[Finding] = []
    gains: list[float] = []
    for f, beside in findings:
        fit = fit_fields(f.effect, rows, base.solution.nuisances.black_dn, thresholds, beside)
        if fit is not None:
            left = _leaving(rows, fit.residuals)
            gains.append(_chi2(rows) - _chi2(left))
            rows, parameters = left, field_parameters(f.effect, fit)
            fitted.append(replace(f, explanation=replace(f.explanation, fields=fit, parameters=parameters)))
    return fitted, gains


def _chi2(rows: Sequence[ImageResidual]) -> float:
    return float(sum((row.observation.weight * row.residual**2).sum() for row in rows))


def _dense_together(findings: Sequence[Finding], base: BaseFit, thresholds: Thresholds) -> list[Finding]:
    """Those of the findings whose draws every pixel has; [] for fewer than two.

    They are fitted from those that most frames share to those that fewest do, multiplicative ones first.
    """
    terms = ((pixel_term(f.effect), f) for f in findings)
    chosen = sorted(((term, f) for term, f in terms if term is not None), key=lambda pair: _order(pair[0]))
    if len(chosen) < 2:
        return []
    train = base.train
    black_dn = base.solution.nuisances.black_dn
    largest = {f.id: _largest_sigma(f) for _, f in chosen}
    shown = components({f.id: term for term, f in chosen}, largest, train, black_dn, thresholds)
    least = thresholds.smallest_field_share * sum(c.reduced_chi2 for c in shown.values())
    fitted = []
    for _, f in chosen:
        part = shown[f.id]
        if not (part.reduced_chi2 > least and part.variance > thresholds.component_sigmas * part.error):
            continue
        fit = fit_fields(f.effect, train, black_dn, thresholds)
        if fit is not None:
            explanation = replace(f.explanation, fields=fit, parameters=_parameters(f, part))
            fitted.append(replace(f, explanation=explanation))
            train = _leaving(train, fit.residuals)
    return fitted if len(fitted) > 1 else []


def _order(term: RandomTerm) -> tuple[bool, bool]:
    return term.shared_by is SharedBy.VIEW, term.lever is Lever.ONE


def _leaving(rows: Sequence[ImageResidual], residuals: Sequence[np.ndarray]) -> tuple[ImageResidual, ...]:
    return tuple(row._replace(residual=r) for row, r in zip(rows, residuals, strict=True))


def _parameters(finding: Finding, component: Component) -> Mapping[str, Interval]:
    """The finding's parameters; that of a field of one part is the component's deviation."""
    first, *more = finding.effect.parameters
    if more:
        return finding.explanation.parameters
    sigma = float(np.sqrt(component.variance))
    return within_ranges(finding.effect, {first.name: interval(first, sigma, component.error / (2.0 * sigma))})


def _largest_sigma(finding: Finding) -> float:
    """The deviation of a draw as fitted alone: no less than what it is beside others."""
    fields = finding.explanation.fields
    return 0.0 if fields is None else float(np.linalg.norm(list(fields.sigma.values())))


def components(
    terms: Mapping[str, RandomTerm],
    sigmas: Mapping[str, float],
    train: Sequence[ImageResidual],
    black_dn: float,
    thresholds: Thresholds,
) -> dict[str, Component]:
    """{id: Component}, jointly; standard errors by leaving out blocks of rows in turn.

    sigmas: {id: deviation of a draw at most}.
    """
    ids = list(terms)
    blocks, powers = [], {name: 0.0 for name in ids}
    for side in {o.side for o, *_ in train}:
        images = [_image(row, terms, sigmas, black_dn, thresholds) for row in train if row[0].side == side]
        for image in images:
            for name in ids:
                powers[name] += float((image.weight * image.levers[name] ** 2).mean()) / len(train)
        for start in range(_BLOCKS):
            part = [_rows_from(image, start) for image in images]
            blocks.append(_normal_equations(part, terms))
    grams, moments = (np.array(list(x)) for x in zip(*blocks, strict=True))
    whole = _solved(grams.sum(0), moments.sum(0))
    without = np.array([_solved(grams.sum(0) - g, moments.sum(0) - m) for g, m in zip(grams, moments, strict=True)])
    spread = np.sqrt((len(blocks) - 1) / len(blocks) * ((without - without.mean(0)) ** 2).sum(0))
    return {
        name: Component(float(v), float(s), float(v * powers[name]))
        for name, v, s in zip(ids, whole, spread, strict=True)
    }


@dataclass(frozen=True)
class _Image:
    """pose: what stands still together, None = moving.

    weight: 0 next to edges, whose misplacement stays with the pose, and where draws may be clipped, which makes
    offsets look like gains. levers: {id: DN per draw}.
    """

    pose: Hashable
    weight: np.ndarray
    residual: np.ndarray
    levers: Mapping[str, np.ndarray]


def _image(
    row: ImageResidual,
    terms: Mapping[str, RandomTerm],
    sigmas: Mapping[str, float],
    black_dn: float,
    thresholds: Thresholds,
) -> _Image:
    o, image, _, residual = row
    levers = {name: lever_image(term.lever, row, black_dn) for name, term in terms.items()}
    pose = None if o.frame.is_moving else o.frame.camera_to_world.tobytes()
    reach = np.max([thresholds.clear_of_ends * sigma * np.abs(levers[name]) for name, sigma in sigmas.items()], axis=0)
    counts = ~edges(o) & (image > reach) & (image < o.view.max_dn - reach)
    return _Image(pose, np.where(counts, o.weight, 0.0), residual, levers)


def _rows_from(image: _Image, start: int) -> _Image:
    rows = slice(start, None, _BLOCKS)
    levers = {k: v[rows] for k, v in image.levers.items()}
    return _Image(image.pose, image.weight[rows], image.residual[rows], levers)


def _normal_equations(images: Sequence[_Image], terms: Mapping[str, RandomTerm]) -> tuple[np.ndarray, np.ndarray]:
    gram, moment = np.zeros((len(terms), len(terms))), np.zeros(len(terms))
    for a, b in combinations(images, 2):
        still = a.pose is not None and a.pose == b.pose
        levers = [
            a.levers[n] * b.levers[n] * (still or term.shared_by is not SharedBy.VIEW) for n, term in terms.items()
        ]
        weight = a.weight * b.weight
        for i, lever in enumerate(levers):
            moment[i] += float((weight * lever * a.residual * b.residual).sum())
            gram[i] += [float((weight * lever * other).sum()) for other in levers]
    return gram, moment


def _solved(gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    return nnls(gram / np.outer(norm, norm), moment / norm)[0] / norm
