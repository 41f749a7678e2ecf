# SPDX-License-Identifier: Apache-2.0
"""Fits the few likeliest effects beside the model, from starts that their scores and the dictionary's points give.

Effects of surfaces, air and lamps have formulas as image functions, so they are fitted to rendered images of the effect
instead. The engine renders the effect at a fit, then again with each parameter one step further. The random numbers are
the same, so that differences show the effect and not the noise. These differences then replace the formula, as a
function linear in the parameters.

The formula of a response effect is one family of curves; sensors have others (Grossberg and Nayar 2003, What is the
space of camera response functions?). A residual that depends on a pixel's value alone belongs to the response. A free
curve is therefore fitted beside the response's formula.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import ImageKey
from activestereo.common.computed_once import computed_once
from activestereo.diagnose.dictionary import start_images
from activestereo.diagnose.fitter import Fitter, ParameterSpace, Solution, fit_key
from activestereo.diagnose.kept import content_key
from activestereo.diagnose.linear import fitted_model, linearised, score_alone
from activestereo.diagnose.pixels import SCALES
from activestereo.diagnose.selection import Candidate
from activestereo.effects import Effect, Light, Model, Stage, View, known_differences
from activestereo.effects.core.surfaces import MATERIAL_FAMILY

# Rounds of rendering and fitting, and steps of each fit. A difference steps by this share of the typical value or of
# the parameter's own distance. A round moves a parameter by at most so many steps, and is the last below a half. Then
# so many times the samples render the effect once more: the noise of few is an error that all views share.
_RENDER_ROUNDS, _RENDER_STEPS, _LAST_SAMPLES = 2, 4, 4
_STEP_TYPICAL, _STEP_DISTANCE = 0.2, 0.15
_TRUSTED, _SETTLED = 6.0, 0.5
# Parameters imitate less than this share of noise.
_IMITATED = 0.1
_Images = Mapping[ImageKey, np.ndarray]
# Nodes of the piecewise linear curve, evenly spaced in the logarithm of the value; steps of the fit with it.
_NODES, _CURVE_STEPS = 10, 4
# Fits take a few steps on few images from the best start, and from a second one with this part of its gain, unless the
# first leaves next to nothing. Then fits within this part of the best gain take more steps on all images, until chi2
# hardly falls; the others are only measured there. Where the best one leaves next to nothing, they have to be as good.
_STEPS, _RIVAL, _NOTHING, _MORE, _CLOSE, _AS_GOOD, _TOLERANCE = 2, 0.6, 0.05, 6, 0.5, 0.9, 1e-3
# Steps of a fit with a newly named effect, and the share of chi2 by whose fall it stops; the same from narrow peaks.
SETTLING, _PEAK = (8, 1e-4), (3, 2e-5)
# An effect whose formula was never measured may miss this share of its squared signature.
_UNMEASURED = 1.0 / 3.0
# Real facets and depths of scatter follow other laws than the library's materials.
_OF_MATERIALS = 4.0


class Rendering(Protocol):
    """Renders how a model's effects change the light of a capture's train frames; returns {image key: change of direct,
    indirect and ambient light, float32 [3][height][width]}. Calls with equal `samples`, a factor on the usual number,
    use the same random numbers."""

    def __call__(self, model: Model, samples: int = 1, /) -> _Images: ...


@dataclass(frozen=True)
class _Rendered:
    """Replaces an effect's formula by rendered images: its change of the light [3][height][width] at parameters theta,
    and the slopes of that change by each parameter ({} for parameters without a step)."""

    effect: Effect
    theta: np.ndarray
    change: _Images
    slopes: tuple[_Images, ...]

    @computed_once
    def content(self) -> str:
        """Returns a hash of the images, for the key of a cached fit."""
        return content_key(self.theta, self.change, self.slopes)

    def apply(self, light: Light, view: View, **values: float) -> Light:
        """Is the effect's image function. Neutral amplitudes leave the light unchanged."""
        given, key = np.array([values[p.name] for p in self.effect.parameters]), (view.frame.id, view.side)
        amplitudes = [v == p.neutral for p, v in zip(self.effect.parameters, given, strict=True) if p.neutral == 0.0]
        if all(amplitudes):
            return light
        change = self.change[key]
        for away, slope in zip(given - self.theta, self.slopes, strict=True):
            if away and slope:
                change = change + away * slope[key]
        images = zip((light.direct, light.indirect, light.ambient), change, strict=True)
        direct, indirect, ambient = (np.maximum(old + new, 0.0) for old, new in images)
        return replace(light, direct=direct, indirect=indirect, ambient=ambient)


def fitted_to_renders(fitter: Fitter, start: Solution, rendering: Rendering) -> Solution:
    """Renders the last effect of a fit, replaces its formula by the rendered changes, and fits again. Returns the best
    fit, which is `start` if no new fit is better, or if the first render tells that none will be."""
    effect, own = start.effects[-1], slice(len(start.theta) - len(start.effects[-1].parameters), None)

    def change(values: np.ndarray, samples: int = 1) -> _Images:
        named = {p.name: float(np.clip(v, p.low, p.high)) for p, v in zip(effect.parameters, values, strict=True)}
        return rendering(Model().with_effect(effect, **named), samples)

    def emulated(values: np.ndarray, here: _Images, slopes: Sequence[_Images]) -> Effect:
        return replace(effect, apply=_Rendered(effect, values.copy(), here, tuple(slopes)).apply)

    def fitted(values: np.ndarray, here: _Images, slopes: Sequence[_Images], near: Solution) -> Solution:
        rendered = emulated(values, here, slopes)
        pairs = tuple((rendered if e.id == effect.id else e, p) for e, p in start.space.pairs)
        theta = np.concatenate([near.theta[: own.start], values])
        return fitter.refine(replace(start.space, pairs=pairs), theta, near.phi, _RENDER_STEPS)

    best = solution = start
    theta, slopes = start.theta[own], list[_Images]([{}] * len(effect.parameters))
    for _ in range(_RENDER_ROUNDS):
        here, steps = change(theta), _steps(effect, theta)
        if solution is start and not _tells_more(fitter, start, emulated(theta, here, slopes)):
            return start
        slopes = []
        for j, (p, step) in enumerate(zip(effect.parameters, steps, strict=True)):
            if p.scales_light and theta[j]:  # one render tells all its values
                slopes.append({key: image / theta[j] for key, image in here.items()})
                continue
            there = change(np.where(np.arange(len(steps)) == j, theta + step, theta)) if step else {}
            slopes.append({key: (image - here[key]) / step for key, image in there.items()})
        solution = fitted(theta, here, slopes, solution)
        best = min(best, solution, key=lambda s: s.sums.total)
        reach = np.where([p.scales_light for p in effect.parameters], np.inf, np.abs(steps))
        moved = np.clip(solution.theta[own], theta - _TRUSTED * reach, theta + _TRUSTED * reach)
        is_settled = (np.abs(moved - theta) <= _SETTLED * reach).all()
        theta = moved
        if is_settled:
            break
    finer = fitted(theta, change(theta, _LAST_SAMPLES), slopes, solution)
    return min(best, finer, key=lambda s: s.sums.total)


def _tells_more(fitter: Fitter, fit: Solution, rendered: Effect) -> bool:
    """Returns whether a render of the last effect of a fit tells more than its formula. rendered: the effect with its
    render of usual samples.

    The render's difference from the formula, d, has a part that the fitted parameters imitate. If that is not noise,
    the parameters are others. With the other part the residual r correlates as E r d = e, the square of the formula's
    error, while E d^2 = e + n, with the render's noise n. The render of _LAST_SAMPLES changes chi2 by n / samples - e.
    """
    linear, values = linearised(fitter, fit), fit.model.effects[-1][1]
    d = linear.change(fit.model.with_effect(rendered, **values), linear.images(fit.model))
    information, score = score_alone(linear, d)
    imitated = 1.0 - information / max(float(d @ d), 1e-12)
    return score * (1 + _LAST_SAMPLES) > information or imitated > _IMITATED


def _steps(effect: Effect, values: np.ndarray) -> np.ndarray:
    """Returns finite-difference steps [n] within the range; 0 for choices and for parameters that the engine lacks."""
    out = []
    for p, v in zip(effect.parameters, values, strict=True):
        step = min(max(_STEP_TYPICAL * p.typical, _STEP_DISTANCE * abs(v - p.neutral)), p.slope_step)
        out.append(0.0 if p.choice or not p.in_engine else -step if v + step > p.high else step)
    return np.array(out)


@dataclass(frozen=True)
class _Curve:
    """A response effect with a correction curve after it. The curve adds `added` DN at signals of `nodes` DN above
    black, and is linear between nodes."""

    effect: Effect
    nodes: NDArray[np.float64]
    added: NDArray[np.float64]

    @computed_once
    def content(self) -> str:
        """Returns a hash of the curve, for the key of a cached fit."""
        return content_key(self.nodes, self.added)

    def apply(self, signal: NDArray[np.float64], view: View, **values: float) -> NDArray[np.float64]:
        """Is the effect's image function. Neutral parameters leave the signal unchanged."""
        if values == self.effect.neutral_values:
            return signal
        value = self.effect.apply(signal, view, **values)
        return np.asarray(value + np.interp(value, self.nodes, self.added))


def is_response(effect: Effect) -> bool:
    """Returns whether an effect is a response curve that all pixels share."""
    return effect.stage is Stage.READOUT and effect.is_pointwise


def refit_free_curve(fitter: Fitter, solution: Solution) -> Solution:
    """Adds a free correction curve to the last effect of a fit if it is a response curve, and returns the new fit.
    Other fits are returned unchanged."""
    if not solution.effects or not is_response(solution.effects[-1]):
        return solution
    effect = solution.effects[-1]
    linear, own = linearised(fitter, solution), len(solution.theta)
    pixels = fitter.pixels()
    weight = np.concatenate([p.root_weight for p in pixels])
    measured = np.concatenate([p.measured for p in pixels])
    value = measured - linear.residual / np.maximum(weight, 1e-12) - solution.phi[SCALES - 1]
    nodes = np.geomspace(max(np.quantile(value, 0.02), 1.0), pixels[0].observation.view.max_dn, _NODES)
    nodes = np.append(0.0, nodes)  # no light gives no signal: an offset there would pass for dark signal
    curve = np.stack([np.interp(value, nodes, row) * weight for row in np.eye(_NODES + 1)[1:]])
    # In double precision: scales and black level are nearly curves themselves.
    columns = np.concatenate([linear.nuisances[own:], curve], dtype=np.float64)
    gram = columns @ columns.T
    prior = np.concatenate([linear.precision[own:], np.full(_NODES, 1e-3)])
    pull = np.concatenate([linear.pull[own:], np.zeros(_NODES)])
    norm = np.sqrt(np.diag(gram) + prior)
    moment = (columns @ linear.residual - pull) / norm
    step = np.linalg.lstsq((gram + np.diag(prior)) / np.outer(norm, norm), moment, rcond=1e-9)[0] / norm
    bent = replace(effect, apply=_Curve(effect, nodes, np.append(0.0, step[-_NODES:])).apply)
    values = next(values for e, values in solution.model.effects if e is effect)
    space = ParameterSpace.of(solution.model.with_effect(bent, **values))
    return fitter.refine(space, space.start, solution.phi, _CURVE_STEPS)


def refit_at_peaks(fitter: Fitter, fit: Solution) -> Solution:
    """Refits each effect that has several narrow likelihood peaks (Effect.starts) from its promising peaks, beside the
    other effects. Returns the best fit."""
    for effect in [e for e in fit.effects if e.starts is not None]:
        fit = _best_peak(fitter, fit, effect)
    return fit


def _best_peak(fitter: Fitter, fit: Solution, effect: Effect) -> Solution:
    assert effect.starts is not None
    without = fitted_model(fitter, fit.model.without_effect(effect.id), fit.phi)
    own = np.array([e.id == effect.id for e, _ in fit.space.pairs])
    thetas = [fit.theta]
    for start in effect.starts(start_images(linearised(fitter, without))):
        values = [start.get(p.name, v) for (_, p), v in zip(fit.space.pairs, fit.theta, strict=True)]
        thetas.append(np.where(own, np.clip(values, fit.space.low, fit.space.high), fit.theta))
    here, *gains = (without.sums.total - fitter.nuisance_fit(fit.space, theta, fit.phi)[1] for theta in thetas)
    peaks = [(theta, _PEAK) for theta, gain in zip(thetas[1:], gains, strict=True) if gain > _RIVAL * here]
    begun = [(fit.theta, SETTLING), *peaks]

    def refined(start: tuple[np.ndarray, tuple[int, float]]) -> Solution:
        theta, steps = start
        return fitter.refine(fit.space, theta, fit.phi, *steps)

    if fitter.memory is not None and fit_key("", fit.space) is not None:
        fitter.memory.make_ahead(refined, begun)
    return min(map(refined, begun), key=lambda f: f.sums.total)


@dataclass(frozen=True)
class Refit:
    """A fit of one effect beside a model. rendered: whether rendered images replaced the effect's formula."""

    solution: Solution
    rendered: bool = False

    @property
    def chi2(self) -> float:
        return self.solution.sums.total


def refits(
    fitter: Fitter, scored: Fitter, near: Solution, chosen: Sequence[Candidate], rendering: Rendering | None,
    least: float = 0.0,
) -> dict[str, Refit]:  # fmt: skip
    """Fits each chosen effect alone beside the model of a fit, from its nuisances; returns {effect: Refit}. scored: a
    fitter with few images, for first steps. rendering: renders effects of air and surfaces, in place of their formulas;
    None keeps the formulas. least: gain of a formula's fit below which no render is worth its time."""
    if not chosen:
        return {}
    by_name, model, base_chi2 = {c.id: c for c in chosen}, near.model, near.sums.total
    spaces = [ParameterSpace.of(model, c.best.atom.effect) for c in chosen]
    base = ParameterSpace.of(model)
    base_of_few = scored.nuisance_fit(base, base.start, near.phi)[1]

    def fit(space: ParameterSpace) -> Solution:
        return _from_starts(scored, space, by_name[_name(space)], near.phi, base_of_few)

    first = _side_by_side(scored, fit, spaces)
    gains = {name: base_of_few - f.chi2 for name, f in first.items()}
    most_of_few = max(gains.values(), default=0.0)
    is_all = base_of_few - most_of_few - scored.pixels_used() < _NOTHING * most_of_few
    least_of_few = most_of_few * (_AS_GOOD if is_all else _CLOSE)

    def settled(space: ParameterSpace) -> Solution:
        name = _name(space)
        is_close = gains[name] >= least_of_few or most_of_few < 0.0
        s = first[name].solution
        return fitter.refine(space, s.theta, s.phi, _MORE if is_close else 0, _TOLERANCE)

    found = _side_by_side(fitter, settled, spaces)
    most = max((base_chi2 - f.chi2 for f in found.values()), default=0.0)
    for name, f in found.items():
        effect, values = f.solution.model.effects[-1]
        is_rendered = effect.is_simulated(values) and Stage.MEDIUM <= effect.stage <= Stage.SURFACE
        if rendering is not None and is_rendered:
            if base_chi2 - f.chi2 > max((1.0 - formula_error(effect, _UNMEASURED)) * most, least):
                rendered = fitted_to_renders(fitter, f.solution, rendering)
                found[name] = Refit(rendered, rendered is not f.solution)
    return found


def restore_functions(model: Model, candidates: Sequence[Effect]) -> Model:
    """Returns the model with each effect replaced by the candidate of the same id, if there is one. Candidates have the
    effects' original image functions; a fit may have replaced these by rendered images."""
    own = {e.id: e for e in candidates}
    return Model(tuple((own.get(e.id, e), values) for e, values in model.effects))


def missed_share(effect: Effect, is_exact: bool, usual: float) -> float:
    """Returns the share of an effect's gain that its images may miss. is_exact: whether renders replaced its formula.
    usual: what even renders miss, but for materials."""
    least = _OF_MATERIALS * usual if effect.family == MATERIAL_FAMILY else usual
    return least if is_exact or is_response(effect) else max(least, 2.0 * usual, formula_error(effect, least))


def formula_error(effect: Effect, otherwise: float) -> float:
    """Returns the share of an effect's squared image change that its formula misses, as measured against the render
    engines; `otherwise` if it was never measured."""
    measured = known_differences().get(effect.id)
    return otherwise if measured is None else min(measured**2, _UNMEASURED)


def _name(space: ParameterSpace) -> str:
    """Returns the id of the effect that is fitted."""
    return space.pairs[-1][0].id


def _side_by_side(
    fitter: Fitter, fit: Callable[[ParameterSpace], Solution], spaces: Sequence[ParameterSpace]
) -> dict[str, Refit]:
    """Fits every space; returns {effect: Refit}. Fits that the cache can keep are made in several processes, the
    longest first: from the camera on, where effects redraw or blur finished images."""
    if fitter.memory is not None:
        cached = [space for space in spaces if fit_key("", space) is not None]
        cached.sort(key=lambda space: space.pairs[-1][0].stage >= Stage.CAMERA, reverse=True)
        fitter.memory.make_ahead(fit, cached)
    return {_name(space): Refit(fit(space)) for space in spaces}


def _from_starts(
    fitter: Fitter, space: ParameterSpace, chosen: Candidate, phi: np.ndarray, base_chi2: float
) -> Solution:
    """Fits an effect from its starts and from neutral; returns the best fit. Each start is evaluated once, and only
    the promising ones are fitted: the best and one of another atom, or all good ones of an effect with narrow peaks.
    Each fit begins at the nuisances of its start: far from them a step may fail. base_chi2: chi2 at neutral."""
    effect, starts = space.pairs[-1][0], chosen.starts
    own = len(space.start) - len(effect.parameters)
    thetas = [np.concatenate([space.start[:own], [start[p.name] for p in effect.parameters]]) for _, start in starts]

    def look() -> dict[str, np.ndarray]:
        fits = [fitter.nuisance_fit(space, theta, phi) for theta in thetas]
        return {"phi": np.array([fitted for fitted, _ in fits]), "chi2": np.array([chi2 for _, chi2 in fits])}

    looked = fitter.remembered(look, space, thetas, phi)
    seen, phis = np.append(looked["chi2"], base_chi2), [*looked["phi"], phi]
    thetas, atoms = [*thetas, space.start], [*(atom for atom, _ in starts), None]
    best, *others = np.argsort(seen)
    gain, fit = base_chi2 - seen, fitter.refine(space, thetas[best], phis[best], _STEPS)
    left = fit.sums.total - fitter.pixels_used()
    if left < _NOTHING * (base_chi2 - fit.sums.total):
        return fit
    rivals = [k for k in others if gain[k] > _RIVAL * gain[best] and (effect.starts or atoms[k] is not atoms[best])]
    rivals = [fitter.refine(space, thetas[k], phis[k], _STEPS) for k in rivals[: None if effect.starts else 1]]
    return min([fit, *rivals], key=lambda f: f.sums.total)
