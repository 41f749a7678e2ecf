"""Fits a model with one candidate effect to the train frames: weighted least squares in effect parameters and nuisances jointly.

Free are the parameters of every effect in play, projector scale, ambient scale, black level, focal lengths and albedos under
their priors. Gauss-Newton with Levenberg's damping from several starts; images are recomputed, never extrapolated.
"""

from dataclasses import dataclass, replace

import numpy as np

from activestereo.effects import Randomness, Stage
from activestereo.lab.diagnose_data import BLOCK_PX, FOLDS
from activestereo.lab.fit import Nuisances

_STEP = 0.02
# Of the nuisances phi: projector scale, ambient scale, black level; then those with priors: focal length by eye, albedos.
_SCALES, _DENSE = 3, 5
# Parameters are held by a prior this many ranges wide: it only breaks ties.
_PRIOR_RANGES = 3.0
# Those that are held, by one so many ranges wide.
_HELD = 1e-7


class Play:
    """The effects in play, and which of their parameters are free; held: those that stay neutral."""

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
class Sums:
    """Normal equations of one linearisation, by fold: gram [folds][n][n], moment [folds][n], chi2 [folds]; and chi2 by tile."""

    gram: np.ndarray
    moment: np.ndarray
    chi2: np.ndarray
    tile_chi2: np.ndarray

    @property
    def total(self):
        return float(self.chi2.sum())


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
    def nuisances(self):
        return Nuisances(*map(float, self.phi[:_SCALES]))

    @property
    def albedo(self):
        return self.phi[_DENSE:]


class Fitter:
    """Fits over given observations. held_sigma: prior deviations of the nuisances that have one. fine=False: warps on pixels alone."""

    def __init__(self, observations, held_sigma, tiles, fine=True):
        self.observations = observations
        self._fine = fine
        self._held_sigma = held_sigma
        self._tiles = tiles

    def phi0(self, nuisances):
        return np.concatenate([nuisances.vector(), np.zeros(len(self._held_sigma))])

    def lights(self, play, theta):
        """The Light of every observation."""
        model = play.model(theta)
        return [self._light(model, o) for o in self.observations]

    def _light(self, model, o, fine=True):
        return model.light(o.layers, o.view, fine=self._fine and fine)

    def predictions(self, play, theta, phi, lights):
        model = play.model(theta)
        return [signal(model, o, light, phi) for o, light in zip(self.observations, lights, strict=True)]

    def chi2(self, play, theta, phi, lights):
        images = self.predictions(play, theta, phi, lights)
        total = sum(float((o.picked(o.weight) * (o.picked(o.measured) - o.picked(m)) ** 2).sum()) for o, m in zip(self.observations, images, strict=True))
        return total + float(((phi[_SCALES:] / self._held_sigma) ** 2).sum())

    def linearise(self, play, theta, phi, lights, free_theta=True):
        """Sums at (theta, phi). Columns: theta (if free), then phi."""
        n_theta = len(theta) if free_theta else 0
        size = n_theta + len(phi)
        sums = Sums(np.zeros((FOLDS, size, size)), np.zeros((FOLDS, size)), np.zeros(FOLDS), np.zeros(self._tiles))
        for o, columns, residual in self.slopes(play, theta, phi, lights, n_theta):
            _accumulate(sums, o, columns, residual, n_theta, phi)
        return sums

    def slopes(self, play, theta, phi, lights, n_theta):
        """Yields (observation, derivatives by the first n_theta of theta, scales and black level, residual)."""
        steps = play.steps(theta)
        models = []
        for j in range(n_theta):
            moved = theta.copy()
            moved[j] += steps[j]
            models.append(play.model(moved))
        here, scales = play.model(theta), Nuisances(*phi[:_SCALES])
        # The slope of a warp is known well enough from the pixels alone; what is fitted are the fine images.
        coarse = self._fine and bool(play.in_camera[:n_theta].any())
        for o, light in zip(self.observations, lights, strict=True):
            graded = _graded(o, light, phi)
            image = here.signal(graded, o.view, scales)
            focal = phi[_SCALES + o.view.is_right] * o.focal_slope
            near = _graded(o, self._light(here, o, fine=False), phi) if coarse else graded
            from_there = here.signal(near, o.view, scales) if coarse else image
            columns = []
            for j in range(n_theta):
                in_light = play.in_light[j]
                moved = _graded(o, self._light(models[j], o, fine=not coarse), phi) if in_light else graded
                columns.append((models[j].signal(moved, o.view, scales) - (from_there if in_light else image)) / steps[j])
            columns += _nuisance_columns(here, o, graded, phi, image)
            columns += [np.zeros(image.shape), o.focal_slope] if o.view.is_right else [o.focal_slope, np.zeros(image.shape)]
            yield o, columns, o.measured - image - focal

    def covariance(self, solution):
        """Of theta, [n][n]: the sandwich over clusters that share errors (Liang and Zeger 1986): blocks of an eye's image, repeats and
        settings of one pose together. None of it asks for independent pixels."""
        play, theta, phi, n = solution.play, solution.theta, solution.phi, len(solution.theta)
        gram = solution.sums.gram.sum(0) + np.diag(self.prior(n, play))
        norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        rows = (np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-12, hermitian=True) / np.outer(norm, norm))[:n]
        dense, clusters = n + _DENSE, {}
        for o, columns, residual in self.slopes(play, theta, phi, self.lights(play, theta), n):
            A = np.stack(columns)
            pull = np.einsum("kj,jyx->kyx", rows[:, :dense], A)
            if rows.shape[1] > dense:
                share = np.append(rows[:, dense:], np.zeros((n, 1)), axis=1)[:, o.material]
                pull += share * (A[n] * phi[0] + A[n + 1] * phi[1])
            pull *= o.weight * residual
            height, width = residual.shape
            block = np.add.outer(np.arange(height) // BLOCK_PX * (width // BLOCK_PX + 1), np.arange(width) // BLOCK_PX).ravel()
            key = o.eye, o.frame.camera_to_world.tobytes(), o.frame.is_moving
            clusters[key] = clusters.get(key, 0.0) + np.stack([np.bincount(block, p.ravel()) for p in pull])
        return sum(sums @ sums.T for sums in clusters.values())

    def solve(self, sums, phi, n_theta, play, theta, damping):
        """The damped Gauss-Newton step in (theta, phi)."""
        prior = self.prior(n_theta, play)
        offset = np.concatenate([theta[:n_theta] - play.neutral[:n_theta], np.zeros(_SCALES), phi[_SCALES:]])
        gram, moment = sums.gram.sum(0) + np.diag(prior), sums.moment.sum(0) - prior * offset
        norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        scaled = gram / np.outer(norm, norm) + damping * np.eye(len(norm))
        return np.linalg.lstsq(scaled, moment / norm, rcond=1e-10)[0] / norm

    def prior(self, n_theta, play):
        """Precisions of the priors: wide for effects, none for scales and black level, the albedo's own."""
        width = np.where(play.held, _HELD, _PRIOR_RANGES)[:n_theta] * (play.high - play.low)[:n_theta]
        return np.concatenate([1.0 / width**2, np.zeros(_SCALES), 1.0 / self._held_sigma**2])

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
            trial = np.where(play.held, play.neutral, np.clip(theta + step[:n], play.low, play.high))
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
    view = observation.view
    image = model.signal(_graded(observation, light, phi), view, Nuisances(*map(float, phi[:_SCALES])))
    focal = phi[_SCALES + view.is_right]
    return np.clip(image + focal * observation.focal_slope, 0.0, view.max_dn) if focal else image


def _graded(observation, light, phi):
    """The light with each material's relative albedo correction: it scales all light that the material sends."""
    albedo = phi[_DENSE:]
    if not albedo.any():
        return light
    gain = np.append(1.0 + albedo, 1.0)[observation.material]
    return replace(light, direct=light.direct * gain, indirect=light.indirect * gain, ambient=light.ambient * gain)


def _nuisance_columns(model, o, graded, phi, image):
    """Derivatives by projector scale, ambient scale and black level, by small relative steps."""
    columns = []
    for j in range(_SCALES):
        step = 1e-3 * max(abs(phi[j]), 1.0)
        moved = phi[:_SCALES].copy()
        moved[j] += step
        columns.append((model.signal(graded, o.view, Nuisances(*moved)) - image) / step)
    return columns


def _accumulate(sums, o, columns, residual, n_theta, phi):
    """Adds one observation. The columns are images; albedo columns live on their own material's pixels: a material's column is the
    light it sends, projector and ambient columns times their scales."""
    dense = len(columns)
    A = np.stack([o.picked(c) for c in columns])
    r, weight, fold, material = (o.picked(image) for image in (residual, o.weight, o.fold, o.material))
    squares = weight * r**2
    sums.tile_chi2 += np.bincount(o.picked(o.tile), squares, minlength=len(sums.tile_chi2))
    glow = A[n_theta] * phi[0] + A[n_theta + 1] * phi[1]
    materials = sums.moment.shape[1] - dense
    label = np.where(material >= 0, material, materials) + (materials + 1) * fold
    bins = FOLDS * (materials + 1)

    def by_material(values):
        return np.bincount(label, values, minlength=bins).reshape(FOLDS, -1)[:, :materials]

    for f in range(FOLDS):
        here = fold == f
        part = A[:, here]
        weighted = part * weight[here]
        sums.gram[f, :dense, :dense] += weighted @ part.T
        sums.moment[f, :dense] += weighted @ r[here]
        sums.chi2[f] += squares[here].sum()
    if materials:
        shining = weight * glow
        diagonal = np.arange(dense, dense + materials)
        sums.gram[:, diagonal, diagonal] += by_material(shining * glow)
        sums.moment[:, dense:] += by_material(shining * r)
        for i in range(dense):
            cross = by_material(shining * A[i])
            sums.gram[:, i, dense:] += cross
            sums.gram[:, dense:, i] += cross
