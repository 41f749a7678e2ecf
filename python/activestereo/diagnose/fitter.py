# SPDX-License-Identifier: Apache-2.0
"""Fits a model to observations by weighted least squares in effect parameters and nuisances jointly.

The free nuisances are projector scale, ambient scale, black level and, under priors, focal lengths, albedos and
geometry. The method is Gauss-Newton with Levenberg's damping. Images are recomputed at every step, never extrapolated.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from activestereo.capture.capture import SIDES
from activestereo.common.computed_once import computed_once
from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.diagnose.evidence import NuisancePrior, Observation
from activestereo.diagnose.geometry import TWIST
from activestereo.diagnose.kept import FitCache, content_key, effect_content
from activestereo.diagnose.pixels import DENSE, SCALES, AllPixels, LightMemory, Pixels, Sums, exposed
from activestereo.effects import Effect, Light, Model, Parameter, Stage
from activestereo.effects.core.model import Nuisances

# The step of a finite difference: this share of a parameter's typical value, or of a quarter of its distance from
# neutral.
_STEP = 0.02
_DISTANCE_SHARE = 0.25
# Standard deviation of a parameter's prior, in widths of its range: the prior only breaks ties.
_PRIOR_RANGES = 3.0
# Standard deviation of a measured black level's prior, as a share of the measured standard error.
_HELD = 1e-3
# Levenberg's damping: its start, its growth and fall, and where a fit gives up.
_DAMPING, _DAMPING_STEP, _LEAST_RAISED, _MOST_DAMPING = 1e-3, 10.0, 1e-2, 10.0
# Amplitudes of the rig's correction: two focal lengths, and six of the projector's pose.
RIG_AMPLITUDES = len(SIDES) + TWIST
# Solutions whose images are remembered.
_REMEMBERED = 3


@dataclass(frozen=True)
class ParameterSpace:
    """The parameters of a model's deterministic effects, then those of one candidate effect, as one vector theta.

    base: the model. pairs: (Effect, Parameter) of each entry of theta. start: theta at the start of fits.
    """

    base: Model
    pairs: tuple[tuple[Effect, Parameter], ...]
    start: np.ndarray

    @classmethod
    def of(cls, model: Model, candidate: Effect | None = None) -> "ParameterSpace":
        """Makes the space of a model's effects on expected images and of a candidate. A fit starts at the model's
        values, and at the neutral values of the candidate."""
        fitted = [(e, values) for e, values in model.effects if e.is_in_mean]
        pairs = [(e, p) for e, _ in fitted for p in e.parameters]
        start = [values[p.name] for e, values in fitted for p in e.parameters]
        if candidate is not None:
            pairs += [(candidate, p) for p in candidate.parameters]
            start += [p.neutral for p in candidate.parameters]
        return cls(model, tuple(pairs), np.array(start, dtype=np.float64))

    def of_parameters(self, name: str) -> np.ndarray:
        """Returns one attribute (`name`) of every parameter, [n]."""
        return np.array([getattr(p, name) for _, p in self.pairs])

    @property
    def low(self) -> np.ndarray:
        return self.of_parameters("low")

    @property
    def high(self) -> np.ndarray:
        return self.of_parameters("high")

    @property
    def neutral(self) -> np.ndarray:
        return self.of_parameters("neutral")

    @property
    def given(self) -> np.ndarray:
        """Returns which parameters are choices, such as a set of surfaces, bool [n]. No fit changes them."""
        return self.of_parameters("choice").astype(bool)

    @property
    def in_light(self) -> np.ndarray:
        """Returns which parameters belong to effects on the light, up to and including the lens, bool [n]."""
        return np.array([e.stage <= Stage.OPTICS for e, _ in self.pairs], dtype=bool)

    def model(self, theta: np.ndarray) -> Model:
        """Returns the model with the parameters theta."""
        chosen: dict[str, tuple[Effect, dict[str, float]]] = {}
        for (e, p), value in zip(self.pairs, theta, strict=True):
            chosen.setdefault(e.id, (e, {}))[1][p.name] = float(value)
        model = self.base
        for e, values in chosen.values():
            model = model.with_effect(e, **values)
        return model

    def steps(self, theta: np.ndarray) -> np.ndarray:
        """Returns finite-difference steps [n], negative where a positive step would leave the range. One-sided
        parameters step to the typical value at least: images change by the square of a blur, without a slope at 0."""
        typical, most = self.of_parameters("typical"), self.of_parameters("slope_step")
        step = _STEP * np.maximum(typical, _DISTANCE_SHARE * np.abs(theta - self.neutral))
        away = np.where(self.low == self.neutral, self.of_parameters("typical_value") - theta, 0.0)
        step = np.minimum(np.maximum(step, away), most)
        return np.where(theta + step > self.high, -step, step)


@dataclass(frozen=True)
class Solution:
    """The result of a fit.

    theta: effect parameters. phi: nuisances (see pixels.py). sums: normal equations at the solution.
    """

    space: ParameterSpace
    theta: np.ndarray
    phi: np.ndarray
    sums: Sums
    model: Model = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", self.space.model(self.theta))

    @property
    def effects(self) -> list[Effect]:
        """The effects whose parameters were fitted."""
        return list({e.id: e for e, _ in self.space.pairs}.values())

    @property
    def nuisances(self) -> Nuisances:
        return Nuisances(*map(float, self.phi[:SCALES]))


def fit_key(observations: str, space: ParameterSpace, *values: object) -> str | None:
    """Returns the cache key of a fit; None if the space holds an effect that a user wrote. observations: hash of the
    images. values: further numbers and arrays on which the fit depends."""
    effects = [effect_content(e) for e, _ in (*space.base.effects, *space.pairs)]
    if None in effects:
        return None
    base = [tuple(values.items()) for _, values in space.base.effects]
    names = [p.name for _, p in space.pairs]
    return content_key(observations, effects, base, names, space.start, values)


class ImageResidual(NamedTuple):
    """One observation under a solution; images [height][width] in DN. expected: the fitted image. projector: the
    projector's direct light. residual: measured minus expected, 0 at pixels where the scene is unknown."""

    observation: Observation
    expected: np.ndarray
    projector: np.ndarray
    residual: np.ndarray


class Fitter:
    """Fits models to a fixed set of observations.

    prior: of the nuisances. tiles: the number of tiles in all train observations. supersampled: False makes warps read
    pixels only, for fast scans. memory: the cache that keeps fits, or None.
    """

    def __init__(
        self,
        observations: Sequence[Observation],
        prior: NuisancePrior,
        tiles: int,
        supersampled: bool = True,
        memory: FitCache | None = None,
    ) -> None:
        self.observations, self.memory = observations, memory
        self._supersampled = supersampled
        self.nuisance_prior = prior
        self._tiles = tiles
        self._lights = LightMemory(observations)
        self._residuals: OrderedDict[int, tuple[Solution, list[ImageResidual]]] = OrderedDict()

    @property
    def materials(self) -> int:
        """The number of materials with an albedo nuisance."""
        return self.nuisance_prior.materials

    @computed_once
    def pixels(self) -> list[Pixels]:
        """Returns the pixels that count in each observation."""
        return [Pixels(o, self.materials) for o in self.observations]

    def pixels_used(self) -> int:
        """Returns the number of pixels that count."""
        return sum(o.pixels for o in self.observations)

    def tile_pixels(self) -> np.ndarray:
        """Returns the number of pixels that count in each tile."""
        return np.bincount(np.concatenate([p.tile for p in self.pixels()]), minlength=self._tiles)

    @computed_once
    def _content(self) -> str:
        return content_key(self.observations, self.nuisance_prior, self._tiles, self._supersampled)

    def remembered(
        self, make: Callable[[], Mapping[str, np.ndarray]], space: ParameterSpace, *values: object
    ) -> Mapping[str, np.ndarray]:
        """Returns make(), or the cached result for the same observations, space and values."""
        if self.memory is None:
            return make()
        return self.memory.once(fit_key(self._content(), space, *values), make)

    def phi0(self, nuisances: Nuisances) -> np.ndarray:
        return np.concatenate([nuisances.vector(), np.zeros(len(self.nuisance_prior.sigma))])

    def forget(self) -> None:
        """Drops the lights and residuals that are kept for further fits."""
        self._lights = LightMemory(self.observations)
        self._residuals.clear()

    def lights(self, space: ParameterSpace, theta: np.ndarray) -> list[Light]:
        """Returns the light of every observation under the parameters theta."""
        model = space.model(theta)
        return [self.light(model, i) for i in range(len(self.observations))]

    def light(self, model: Model, i: int) -> Light:
        """Returns the light of observation i under a model."""
        return self._lights(model, i, self._supersampled)

    def residuals(self, solution: Solution) -> list[ImageResidual]:
        """Returns the ImageResidual of every observation under a solution. It caches those of the last solutions."""
        if id(solution) not in self._residuals:
            self._residuals[id(solution)] = solution, self._residuals_of(solution)
        self._residuals.move_to_end(id(solution))
        while len(self._residuals) > _REMEMBERED:
            self._residuals.popitem(last=False)
        return self._residuals[id(solution)][1]

    def _residuals_of(self, solution: Solution) -> list[ImageResidual]:
        out = []
        for i, o in enumerate(self.observations):
            light = self.light(solution.model, i)
            image = signal(solution.model, o, light, solution.phi)
            dots = solution.phi[0] * o.frame.exposure_gain * o.frame.projector_power * light.direct
            residual = o.measured - image if o.view.known is None else np.where(o.view.known, o.measured - image, 0.0)
            out.append(ImageResidual(o, image, dots, residual))
        return out

    def chi2(self, space: ParameterSpace, theta: np.ndarray, phi: np.ndarray, lights: Sequence[Light]) -> float:
        """Returns the weighted sum of squared residuals over all pixels under (theta, phi), plus the squares of
        sigmas(phi)."""
        model = space.model(theta)

        def squares(pixels: Pixels, light: Light) -> float:
            rest = pixels.measured - _moved(exposed(model, pixels, light, phi)[0], pixels, phi)
            return float(((rest * pixels.root_weight) ** 2).sum())

        return sum(map(squares, self.pixels(), lights)) + float((self.sigmas(phi) ** 2).sum())

    def sigmas(self, phi: np.ndarray) -> np.ndarray:
        """Returns the distances of nuisances, from focal lengths on, from their prior means, in prior deviations."""
        return (phi[SCALES:] - self.nuisance_prior.value) / self.nuisance_prior.sigma

    def linearise(
        self, space: ParameterSpace, theta: np.ndarray, phi: np.ndarray, lights: Iterable[Light],
        n_theta: int | None = None,
    ) -> Sums:  # fmt: skip
        """Returns the normal equations at (theta, phi). Columns: the first n_theta entries of theta (None: all), then
        phi."""
        n_theta = len(theta) if n_theta is None else n_theta
        size = n_theta + len(phi)
        sums = Sums(np.zeros((size, size)), np.zeros(size), np.zeros(self._tiles))
        has_blocks = self._supersampled and n_theta > 0
        for pixels, columns, residual in self.pixel_slopes(space, theta, phi, lights, n_theta):
            sums.add(pixels, columns, residual, phi, has_blocks)
        return sums

    def pixel_slopes(
        self, space: ParameterSpace, theta: np.ndarray, phi: np.ndarray, lights: Iterable[Light], n_theta: int
    ) -> Iterator[tuple[Pixels, list[np.ndarray], np.ndarray]]:
        """Yields (pixels, derivatives, residual [n]) for each observation. Derivatives are [n] each, by the first
        n_theta entries of theta, then by projector scale, ambient scale, black level and both focal lengths."""
        steps, one, here = space.steps(theta), np.eye(len(theta), dtype=bool), space.model(theta)
        models = [space.model(np.where(one[j], theta + steps, theta)) for j in range(n_theta)]
        for i, (pixels, light) in enumerate(zip(self.pixels(), lights, strict=True)):
            image, scale_columns = exposed(here, pixels, light, phi, True)
            columns = []
            for j, model in enumerate(models):
                if space.given[j]:
                    columns.append(np.zeros(image.shape))
                    continue
                moved = self.light(model, i) if space.in_light[j] else light
                columns.append((exposed(model, pixels, moved, phi)[0] - image) / steps[j])
            columns += scale_columns or []
            none, is_right = np.zeros(image.shape), pixels.observation.view.is_right
            columns += [none, pixels.focal_slope] if is_right else [pixels.focal_slope, none]
            yield pixels, columns, pixels.measured - _moved(image, pixels, phi)

    def covariance(self, solution: Solution) -> np.ndarray:
        """Returns the covariance of theta, [n][n], without the assumption of independent pixels.

        It is the sandwich estimate over clusters of errors (Liang and Zeger 1986). A cluster is one block of a camera's
        image at one pose, with all repeats and settings. Errors of the scene measurement are added, because priors hold
        the nuisances near wrong values.
        """
        n = len(solution.theta)
        rows, prior = self.inverse(solution)[:n], self.prior(n, solution.space)
        prior[n + SCALES - 1] /= _HELD**2
        pulls = [rows @ moment for moment in solution.sums.block_moment.values()]
        return sum(pull @ pull.T for pull in pulls) + (rows * prior) @ rows.T

    def prior_sigmas(self, solution: Solution, base: Solution | None = None) -> float:
        """Returns the largest distance of a nuisance from its prior mean, in stated deviations. With a base solution,
        it is the largest excess over the base's distance."""
        strain = np.abs(self.sigmas(solution.phi))
        farthest = (strain if base is None else strain - np.abs(self.sigmas(base.phi))).max(initial=0.0)
        return float(farthest / np.sqrt(self.nuisance_prior.weighed_up))

    def rig_penalty(self, solution: Solution) -> float:
        """Returns the sum of squared distances of focal lengths and projector pose from their prior means, in stated
        deviations."""
        of_rig = np.delete(self.sigmas(solution.phi), np.s_[len(SIDES) : len(SIDES) + self.materials])
        return float((of_rig[:RIG_AMPLITUDES] ** 2).sum() / self.nuisance_prior.weighed_up)

    def albedo_sigmas(self, solution: Solution, stated: float, farthest: int = 1) -> float:
        """Returns the distance of an albedo from the scene's, in stated deviations: of the farthest one, or with
        farthest=2 of the second farthest, and so on. It is 0 if there are too few. Light and albedos share one factor,
        which is fixed so that the median material reflects as stated."""
        factors = np.append(1.0, 1.0 + solution.phi[DENSE : DENSE + self.materials])
        sigmas = np.sort(np.abs(factors / np.median(factors) - 1.0)) / stated
        return float(sigmas[-farthest]) if len(sigmas) > farthest else 0.0

    def inverse(self, solution: Solution) -> np.ndarray:
        """Returns the inverse of the normal matrix with its priors at a solution; rows and columns: theta, then phi."""
        gram = solution.sums.gram + np.diag(self.prior(len(solution.theta), solution.space))
        return inverse_normal_matrix(gram)

    def solve(
        self, sums: Sums, phi: np.ndarray, n_theta: int, space: ParameterSpace, theta: np.ndarray, damping: float
    ) -> np.ndarray:
        """Returns the damped Gauss-Newton step in (theta, phi), from normal equations at (theta, phi)."""
        gram = sums.gram + np.diag(self.prior(n_theta, space))
        damped = gram + damping * np.diag(np.diag(gram))
        return inverse_normal_matrix(damped) @ (sums.moment - self.pull(phi, n_theta, space, theta))

    def _foretold(
        self, sums: Sums, phi: np.ndarray, n_theta: int, space: ParameterSpace, theta: np.ndarray, step: np.ndarray
    ) -> float:
        """Returns the fall of chi2 by a step, priors included, if images were linear in (theta, phi)."""
        slope = sums.moment - self.pull(phi, n_theta, space, theta)
        return float(2.0 * step @ slope - step @ (sums.gram @ step + self.prior(n_theta, space) * step))

    def pull(self, phi: np.ndarray, n_theta: int, space: ParameterSpace, theta: np.ndarray) -> np.ndarray:
        """Returns the gradient of the priors at (theta, phi): precision times offset."""
        offset, known = np.where(space.given, 0.0, theta - space.neutral)[:n_theta], self.nuisance_prior
        black_dn = 0.0 if known.black_dn is None else known.black_dn[0]
        mean = np.concatenate([np.zeros(SCALES - 1), [black_dn], known.value])
        return self.prior(n_theta, space) * np.concatenate([offset, phi - mean])

    def prior(self, n_theta: int, space: ParameterSpace) -> np.ndarray:
        """Returns the prior precisions of (theta, phi): weak for effects, 0 for scales, nuisance_prior's for the rest.
        A measured black level is held tightly, because a missing effect shifts it by more than its deviation."""
        known = self.nuisance_prior.black_dn
        scales = [*np.zeros(SCALES - 1), 0.0 if known is None else (_HELD * known[1]) ** -2]
        width = _PRIOR_RANGES * (space.high - space.low)[:n_theta]
        return np.concatenate([1.0 / width**2, scales, 1.0 / self.nuisance_prior.sigma**2])

    def nuisance_fit(self, space: ParameterSpace, theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, float]:
        """Refits phi at fixed theta by one linear step; returns (phi, chi2 of the linear model)."""
        sums = self.linearise(space, theta, phi, self.lights(space, theta), n_theta=0)
        step = self.solve(sums, phi, 0, space, theta, 1e-9)
        return phi + step, sums.total - 2.0 * step @ sums.moment + step @ sums.gram @ step

    def refine(
        self, space: ParameterSpace, theta: np.ndarray, phi: np.ndarray, iterations: int, tolerance: float = 2e-5
    ) -> Solution:
        """Fits from a start (theta, phi); returns the Solution. It stops after `iterations`, or when chi2 falls by less
        than a share `tolerance`, or would if images were linear."""
        make = lambda: self._refined(space, theta, phi, iterations, tolerance)  # noqa: E731
        found = self.remembered(make, space, theta, phi, iterations, tolerance)
        return Solution(space, found["theta"], found["phi"], Sums.of_arrays(found, self.observations))

    def _refined(
        self, space: ParameterSpace, theta: np.ndarray, phi: np.ndarray, iterations: int, tolerance: float
    ) -> dict[str, np.ndarray]:
        """Computes refine() and returns the solution as arrays."""
        lights = self.lights(space, theta)
        damping, n = _DAMPING, len(theta)
        sums = self.linearise(space, theta, phi, lights)
        chi2 = sums.total + float((self.sigmas(phi) ** 2).sum())
        for _ in range(iterations):
            step = self.solve(sums, phi, n, space, theta, damping)
            if self._foretold(sums, phi, n, space, theta, step) < tolerance * chi2:
                break
            moved = np.where(space.given, theta, np.clip(theta + step[:n], space.low, space.high))
            trial_phi = phi + step[n:]
            trial_lights = self.lights(space, moved) if space.in_light.any() else lights
            value = self.chi2(space, moved, trial_phi, trial_lights)
            if not value < chi2:  # not a number, too
                damping = max(damping * _DAMPING_STEP, _LEAST_RAISED)
                if damping > _MOST_DAMPING:
                    break
                continue
            done = chi2 - value < tolerance * chi2
            theta, phi, lights, chi2 = moved, trial_phi, trial_lights, value
            sums = self.linearise(space, theta, phi, lights)
            damping = max(damping / _DAMPING_STEP, 1e-6)
            if done:
                break
        return {"theta": theta, "phi": phi} | sums.as_arrays()


def signal(model: Model, observation: Observation, light: Light, phi: np.ndarray) -> np.ndarray:
    """Returns an observation's expected image in DN, float64 [height][width]."""
    pixels = AllPixels(observation)
    image = _moved(exposed(model, pixels, light, phi)[0], pixels, phi)
    return image.reshape(observation.measured.shape)


def _moved(image: np.ndarray, pixels: Pixels | AllPixels, phi: np.ndarray) -> np.ndarray:
    """Returns the expected values [n] changed by focal lengths and geometry, to first order, and clipped if changed."""
    o = pixels.observation
    twists = phi[SCALES + o.geometry_places].astype(np.float32)
    change = phi[SCALES + o.view.is_right] * pixels.focal_slope
    if twists.any():
        change = change + twists @ pixels.geometry_slopes
    elif not np.any(change):
        return image
    moved = image + change
    return np.clip(moved, 0.0, o.view.max_dn, out=moved)
