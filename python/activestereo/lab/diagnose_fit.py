"""Fits a model with one candidate effect to the train frames: weighted least squares in effect parameters and nuisances jointly.

Free are the parameters of every effect in play, projector scale, ambient scale, black level, focal lengths and albedos under
their priors. Gauss-Newton with Levenberg's damping from several starts; images are recomputed, never extrapolated.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from activestereo.effects import Randomness, Stage
from activestereo.lab.diagnose_light import DENSE, SCALES, AllPixels, LightMemory, exposed
from activestereo.lab.diagnose_sums import Pixels, Sums
from activestereo.lab.fit import Nuisances

_STEP = 0.02
# Parameters are held by a prior this many ranges wide: it only breaks ties.
_PRIOR_RANGES = 3.0
# Those that are held, by one so many ranges wide.
_HELD = 1e-7


class Play:
    """The effects in play, and which of their parameters are free; held: those that stay neutral; given: choices, which stay as they are."""

    def __init__(self, model, candidate=None, refit=True):
        self._base = model
        fitted = [(e, p) for e, p in model.effects if refit and e.randomness is Randomness.NONE]
        self.free = [(e, p) for e, _ in fitted for p in e.parameters]
        self.start = np.array([values[p.name] for e, values in fitted for p in e.parameters])
        if candidate is not None:
            self.free += [(candidate, p) for p in candidate.parameters]
            self.start = np.append(self.start, [p.neutral for p in candidate.parameters])
        self.low = np.array([p.low for _, p in self.free])
        self.high = np.array([p.high for _, p in self.free])
        self.typical = np.array([p.typical for _, p in self.free])
        self.neutral = np.array([p.neutral for _, p in self.free])
        self.held = np.zeros(len(self.free), dtype=bool)
        self.given = np.array([p.choice for _, p in self.free], dtype=bool)
        self.in_camera = np.array([e.stage is Stage.CAMERA for e, _ in self.free], dtype=bool)
        self.in_light = np.array([e.stage <= Stage.OPTICS for e, _ in self.free], dtype=bool)

    def model(self, theta):
        chosen = {}
        for (e, p), value in zip(self.free, theta, strict=True):
            chosen.setdefault(e.id, (e, {}))[1][p.name] = float(value)
        model = self._base
        for e, values in chosen.values():
            model = model.with_effect(e, **values)
        return model

    def steps(self, theta):
        """Finite-difference steps that stay in range."""
        step = _STEP * np.maximum(self.typical, 0.25 * np.abs(theta - self.neutral))
        return np.where(theta + step > self.high, -step, step)


@dataclass
class Solution:
    """theta, phi: effect parameters and nuisances; sums at the solution."""

    play: Play
    theta: np.ndarray
    phi: np.ndarray
    sums: Sums

    @property
    def model(self):
        return self.play.model(self.theta)

    @property
    def effects(self):
        """Those whose parameters were fitted."""
        return list({e.id: e for e, _ in self.play.free}.values())

    @property
    def nuisances(self):
        return Nuisances(*map(float, self.phi[:SCALES]))

    @property
    def albedo(self):
        return self.phi[DENSE:]


class Fitter:
    """Fits over given observations. held_sigma: prior deviations of the nuisances that have one. fine=False: warps on pixels alone."""

    def __init__(self, observations, held_sigma, tiles, fine=True):
        self.observations = observations
        self._fine = fine
        self._held_sigma = held_sigma
        self._tiles = tiles
        self._lights = LightMemory(observations)

    @property
    def materials(self):
        """Those that have an albedo nuisance."""
        return len(self._held_sigma) - (DENSE - SCALES)

    @cached_property
    def _pixels(self):
        return [Pixels(o, self.materials) for o in self.observations]

    def phi0(self, nuisances):
        return np.concatenate([nuisances.vector(), np.zeros(len(self._held_sigma))])

    def lights(self, play, theta):
        """The Light of every observation."""
        model = play.model(theta)
        return [self._lights(model, i, self._fine) for i in range(len(self.observations))]

    def chi2(self, play, theta, phi, lights):
        model, total = play.model(theta), 0.0
        for pixels, light in zip(self._pixels, lights, strict=True):
            image = exposed(model, pixels, light, phi)[0]
            rest = (pixels.measured - _with_focal(image, pixels, phi)) * pixels.root_weight
            total += float(rest @ rest)
        return total + float(((phi[SCALES:] / self._held_sigma) ** 2).sum())

    def linearise(self, play, theta, phi, lights, free_theta=True):
        """Sums at (theta, phi). Columns: theta (if free), then phi."""
        n_theta = len(theta) if free_theta else 0
        sums = Sums.of_size(n_theta + len(phi), self._tiles)
        for pixels, columns, residual in self._slopes(self._pixels, play, theta, phi, lights, n_theta):
            sums.add(pixels, columns, residual, n_theta, phi)
            if self._fine and n_theta:
                sums.add_blocks(pixels, columns, residual, n_theta, phi)
        return sums

    def slopes(self, play, theta, phi, lights, n_theta):
        """Yields (observation, derivatives by the first n_theta of theta, scales and black level, residual), images."""
        whole = [AllPixels(o) for o in self.observations]
        for pixels, columns, residual in self._slopes(whole, play, theta, phi, lights, n_theta):
            shape = pixels.observation.measured.shape
            yield pixels.observation, [c.reshape(shape) for c in columns], residual.reshape(shape)

    def _slopes(self, pixels_of, play, theta, phi, lights, n_theta):
        """slopes() over Pixels: (Pixels, derivatives [n] each, residual [n])."""
        steps = play.steps(theta)
        models = [None if play.given[j] else play.model(np.where(np.arange(len(theta)) == j, theta + steps, theta)) for j in range(n_theta)]
        here = play.model(theta)
        # The slope of a warp is known well enough from the pixels alone; what is fitted are the fine images.
        coarse = self._fine and bool(play.in_camera[:n_theta].any())
        for i, (pixels, light) in enumerate(zip(pixels_of, lights, strict=True)):
            image, scale_columns = exposed(here, pixels, light, phi, True)
            near = self._lights(here, i, False) if coarse else light
            from_there = exposed(here, pixels, near, phi)[0] if coarse else image
            columns = []
            for j in range(n_theta):
                if models[j] is None:
                    columns.append(np.zeros(image.shape))
                    continue
                in_light = play.in_light[j]
                moved = self._lights(models[j], i, self._fine and not coarse) if in_light else light
                columns.append((exposed(models[j], pixels, moved, phi)[0] - (from_there if in_light else image)) / steps[j])
            columns += scale_columns
            none, is_right = np.zeros(image.shape), pixels.observation.view.is_right
            columns += [none, pixels.focal_slope] if is_right else [pixels.focal_slope, none]
            yield pixels, columns, pixels.measured - image - phi[SCALES + is_right] * pixels.focal_slope

    def covariance(self, solution):
        """Of theta, [n][n]: the sandwich over clusters that share errors (Liang and Zeger 1986): blocks of an eye's image, repeats and
        settings of one pose together. None of it asks for independent pixels."""
        n = len(solution.theta)
        gram = solution.sums.gram.sum(0) + np.diag(self.prior(n, solution.play))
        norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        rows = (np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-12, hermitian=True) / np.outer(norm, norm))[:n]
        pulls = [rows @ moment for moment in solution.sums.block_moment.values()]
        return sum(pull @ pull.T for pull in pulls)

    def solve(self, sums, phi, n_theta, play, theta, damping):
        """The damped Gauss-Newton step in (theta, phi)."""
        prior = self.prior(n_theta, play)
        offset = np.where(play.given, 0.0, theta - play.neutral)[:n_theta]
        offset = np.concatenate([offset, np.zeros(SCALES), phi[SCALES:]])
        gram, moment = sums.gram.sum(0) + np.diag(prior), sums.moment.sum(0) - prior * offset
        norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        scaled = gram / np.outer(norm, norm) + damping * np.eye(len(norm))
        return np.linalg.lstsq(scaled, moment / norm, rcond=1e-10)[0] / norm

    def prior(self, n_theta, play):
        """Precisions of the priors: wide for effects, none for scales and black level, the albedo's own."""
        width = np.where(play.held, _HELD, _PRIOR_RANGES)[:n_theta] * (play.high - play.low)[:n_theta]
        return np.concatenate([1.0 / width**2, np.zeros(SCALES), 1.0 / self._held_sigma**2])

    def nuisance_fit(self, play, theta, phi, lights, rounds):
        """phi refitted at fixed theta, and chi2; with rounds = 1 the model is taken to be linear in phi."""
        if rounds == 1:
            sums = self.linearise(play, theta, phi, lights, free_theta=False)
            step = self.solve(sums, phi, 0, play, theta, 1e-9)
            gram, moment = sums.gram.sum(0), sums.moment.sum(0)
            return phi + step, sums.total - 2.0 * step @ moment + step @ gram @ step
        chi2 = np.inf
        for _ in range(rounds):
            step = self.solve(self.linearise(play, theta, phi, lights, free_theta=False), phi, 0, play, theta, 0.0)
            trial = phi + step
            value = self.chi2(play, theta, trial, lights)
            if not value < chi2:
                break
            done = chi2 - value < 1e-5 * value
            phi, chi2 = trial, value
            if done:
                break
        return phi, chi2

    def refine(self, play, theta, phi, iterations, tolerance=2e-5):
        """A Solution near the start."""
        lights = self.lights(play, theta)
        damping, n = 1e-3, len(theta)
        chi2 = self.chi2(play, theta, phi, lights)
        sums = self.linearise(play, theta, phi, lights)
        for _ in range(iterations):
            step = self.solve(sums, phi, n, play, theta, damping)
            trial = np.where(play.held, play.neutral, np.where(play.given, theta, np.clip(theta + step[:n], play.low, play.high)))
            trial_phi = phi + step[n:]
            trial_lights = self.lights(play, trial) if play.in_light.any() else lights
            value = self.chi2(play, trial, trial_phi, trial_lights)
            if value >= chi2:
                damping = max(damping * 10.0, 1e-2)
                if damping > 10.0:
                    break
                continue
            done = chi2 - value < tolerance * chi2
            theta, phi, lights, chi2 = trial, trial_phi, trial_lights, value
            sums = self.linearise(play, theta, phi, lights)
            damping = max(damping / 10.0, 1e-6)
            if done:
                break
        return Solution(play, theta, phi, sums)


def signal(model, observation, light, phi):
    """Expected DN, float64 [height][width]."""
    pixels = AllPixels(observation)
    image = _with_focal(exposed(model, pixels, light, phi)[0], pixels, phi)
    return image.reshape(observation.measured.shape)


def _with_focal(image, pixels, phi):
    """Clipped where the focal length moves it: the expected image itself ends at the range's ends already."""
    view = pixels.observation.view
    focal = phi[SCALES + view.is_right]
    return np.minimum(np.maximum(image + focal * pixels.focal_slope, 0.0), view.max_dn) if focal else image
