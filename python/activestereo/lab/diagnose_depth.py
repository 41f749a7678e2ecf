"""Faults of the device's own depth engine: invisible in the infrared images, so they are judged on its disparity alone.

A device's matcher is not ours, but both are told the same images. What counts is the device's error against the true geometry
less the error that our engine makes on the model's own pair; errors beyond a pixel are mismatches and count as one pixel.
A filter shows in what neighbours have in common instead: the variance of their differences.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from activestereo.effects import Stage
from activestereo.lab.depth_compare import model_depths
from activestereo.lab.diagnose_data import TILE_PX
from activestereo.lab.diagnose_score import Z90, design_effect

_LARGEST_ERROR_PX = 1.0
_STARTS = (-1.0, 0.3, 1.0, 3.0)
_EVALUATIONS = 60
# Nodes, in deviations, and weights of Gauss and Hermite's rule for a normal mean.
_NODES = ((-np.sqrt(3.0), 1 / 6), (0.0, 2 / 3), (np.sqrt(3.0), 1 / 6))
# Effects that displace what is measured in the picture, as an error of the surveyed poses does: these are good to an eighth of a degree.
_DISPLACEMENTS = ("foreshortening_bias",)
_SURVEYED_TO_RAD = 0.0025
# Neighbouring disparities of two engines differ alike within this factor; a filter makes the device's differ less.
_ENGINES_DIFFER = 1.7


@dataclass(frozen=True)
class DepthFit:
    """nats; share: of the disparity error's mean square that goes; consistency: share of frames that get better; values: {parameter:
    (value, low, high)}; surveyed: nats of it that errors of the surveyed poses may explain."""

    nats: float
    share: float
    consistency: float
    values: dict
    surveyed: float = 0.0


class DepthEvidence:
    """Disparity errors of the train frames with device depth. predictions: {(frame id, eye): DN} of the model; views: {...: View}."""

    def __init__(self, capture, measured, predictions, views, law, model):
        self.frames = []
        for d in model_depths(capture, measured, predictions, views, law, model, split="train"):
            view = views[d.frame.id, "left"]
            device, valid = d.disparity_error(d.measured, d.truth)
            engine = []
            for depth in d.model:
                error, matched = d.disparity_error(depth, d.truth)
                engine.append(error)
                valid = valid & matched
            truth = np.where(d.truth > 0, d.focal_baseline / np.where(d.truth > 0, d.truth, 1.0), 0.0)
            inside = valid & (np.abs(device) < _LARGEST_ERROR_PX)
            for error in engine:
                inside &= np.abs(error) < _LARGEST_ERROR_PX
            self.frames.append((view, truth, device, engine, valid, inside, d.focal_baseline))
        self._noise_px = self._engines_noise()

    def _engines_noise(self):
        """Deviation of our engine's errors: a fault acts on disparities that are as noisy before it."""
        squares = [np.square(frame[3][0][frame[5]]) for frame in self.frames]
        count = sum(s.size for s in squares)
        return float(np.sqrt(sum(s.sum() for s in squares) / count)) if count else 0.0

    def fit(self, candidate):
        """A DepthFit of an effect on disparity or depth; None without device depth."""
        if not self.frames:
            return None
        bias = self._fit_bias(candidate)
        smooth = self._fit_smoothness(candidate)
        return smooth if smooth is not None and smooth.nats > bias.nats else bias

    def _shift(self, candidate, values, frame):
        """By how much the effect moves the true disparities, px: its mean over the engine's noise, which it acts on."""
        return sum(weight * self._shift_from(candidate, values, frame, node * self._noise_px) for node, weight in _NODES)

    def _shift_from(self, candidate, values, frame, noise_px):
        view, truth, *_, focal_baseline = frame
        truth = np.where(truth > 0, np.maximum(truth + noise_px, 1e-3), 0.0)
        named = {p.name: float(v) for p, v in zip(candidate.parameters, values, strict=True)}
        if candidate.stage is Stage.DISPARITY:
            return candidate.apply(truth, view, **named) - truth
        depth = candidate.apply(np.where(truth > 0, focal_baseline / np.maximum(truth, 1e-9), 0.0), view, **named)
        return np.where((depth > 0) & (truth > 0), focal_baseline / np.maximum(depth, 1e-9) - truth, 0.0)

    def _squares(self, candidate, values):
        """Capped squared errors of each frame's valid pixels."""
        out = []
        for frame in self.frames:
            _, _, device, engine, valid, _, _ = frame
            rest = device - 0.5 * (engine[0] + engine[1]) - self._shift(candidate, values, frame)
            out.append(np.where(valid, np.minimum(rest**2, _LARGEST_ERROR_PX**2), 0.0))
        return out

    def _fit_bias(self, candidate):
        neutral = np.array([p.neutral for p in candidate.parameters])
        low, high = (np.array([getattr(p, name) for p in candidate.parameters]) for name in ("low", "high"))

        def cost(values):
            return float(sum(s.sum() for s in self._squares(candidate, np.clip(values, low, high))))

        before = cost(neutral)
        trials = [neutral]
        for i, p in enumerate(candidate.parameters):
            for step in _STARTS:
                trial = neutral.copy()
                trial[i] = np.clip(p.neutral + step * p.typical, p.low, p.high)
                trials.append(trial)
        best = min(trials, key=cost)
        start = np.where(best == neutral, best + 0.1 * np.array([p.typical for p in candidate.parameters]), best)
        corners = np.where(best == neutral, start, 0.7 * best + 0.3 * neutral)
        simplex = np.vstack([best, *[np.where(np.arange(len(best)) == i, corners, best) for i in range(len(best))]])
        found = np.clip(minimize(cost, best, method="Nelder-Mead", options={"maxfev": _EVALUATIONS, "initial_simplex": simplex}).x, low, high)
        return self._judged(candidate, neutral, found, before)

    def _judged(self, candidate, neutral, found, before):
        base, now = self._squares(candidate, neutral), self._squares(candidate, found)
        after = sum(s.sum() for s in now)
        tiles, counts = _by_tile(now, [frame[4] for frame in self.frames])
        pixels, deff = counts.sum(), design_effect(tiles, counts)
        nats = 0.5 * pixels / deff * np.log(before / after) if after > 0 else 0.0
        better = np.mean([n.sum() < b.sum() for n, b in zip(now, base, strict=True)])
        survey_px = _SURVEYED_TO_RAD * self.frames[0][0].K[0, 0] if candidate.id in _DISPLACEMENTS else 0.0
        values = {}
        for i, p in enumerate(candidate.parameters):
            step = 0.05 * p.typical
            moved = [np.where(np.arange(len(found)) == i, np.clip(found[i] + side * step, p.low, p.high), found) for side in (-1, 1)]
            curve = sum(s.sum() for m in moved for s in self._squares(candidate, m)) - 2 * after
            error = step * np.sqrt(2 * deff * (after / pixels) / curve) if curve > 0 else p.high - p.low
            error = np.hypot(error, survey_px)
            values[p.name] = tuple(float(np.clip(v, p.low, p.high)) for v in (found[i], found[i] - Z90 * error, found[i] + Z90 * error))
        surveyed = _surveyed(nats, found - neutral, survey_px)
        return DepthFit(float(nats), float(1.0 - after / before), float(better), values, surveyed)

    def _fit_smoothness(self, candidate):
        """For effects with one leading amplitude: the engine's errors under the effect, their differences against the device's."""
        first = candidate.parameters[0]
        wanted = self._roughness([frame[2] for frame in self.frames])
        ladder = [0.0, *np.linspace(0.4, 2.0, 5) * first.typical]
        rough = [self._roughness([self._through(candidate, x, frame) for frame in self.frames]) for x in ladder]
        ratio = rough[0] / max(wanted, 1e-12)
        if ratio < _ENGINES_DIFFER or rough[-1] > 0.7 * rough[0]:
            return None
        value = float(np.interp(-np.log(wanted), -np.log(np.maximum(rough, 1e-12)), ladder))
        engines = [float(np.interp(-np.log(wanted * f), -np.log(np.maximum(rough, 1e-12)), ladder)) for f in (_ENGINES_DIFFER, 1 / _ENGINES_DIFFER)]
        pixels = sum(frame[5].sum() for frame in self.frames)
        nats = 0.25 * pixels / TILE_PX * (np.log(ratio / _ENGINES_DIFFER)) ** 2
        values = {p.name: (p.neutral,) * 3 for p in candidate.parameters} | {first.name: (value, min(engines), max(engines))}
        return DepthFit(float(nats), float(1.0 - 1.0 / ratio), 1.0, values)

    def _through(self, candidate, value, frame):
        view, truth, _, engine, valid, _, focal_baseline = frame
        named = {p.name: p.neutral for p in candidate.parameters} | {candidate.parameters[0].name: float(value)}
        matched = np.where(valid, truth + engine[0], 0.0)
        if candidate.stage is Stage.DISPARITY:
            return np.where(valid, candidate.apply(matched, view, **named) - truth, 0.0)
        depth = candidate.apply(np.where(matched > 0, focal_baseline / np.maximum(matched, 1e-9), 0.0), view, **named)
        return np.where(valid & (depth > 0), focal_baseline / np.maximum(depth, 1e-9) - truth, 0.0)

    def _roughness(self, errors):
        """Mean square difference of neighbours along rows and columns, well-matched pixels only."""
        total = count = 0.0
        for error, frame in zip(errors, self.frames, strict=True):
            inside = frame[5]
            for axis in (0, 1):
                both = inside & np.roll(inside, 1, axis)
                total += (((error - np.roll(error, 1, axis)) ** 2)[both]).sum()
                count += both.sum()
        return total / max(count, 1)


def _surveyed(nats, offset_px, survey_px):
    """What the best displacement that the poses' errors, normal with this deviation, explain gains: of quadratic log-likelihoods."""
    gained = 2.0 * max(nats, 0.0) * survey_px**2
    return float(nats * gained / (gained + (offset_px**2).sum())) if gained > 0 else 0.0


def _by_tile(squares, valid):
    sums, counts = [], []
    for s, ok in zip(squares, valid, strict=True):
        rows, columns = np.arange(s.shape[0]) // TILE_PX, np.arange(s.shape[1]) // TILE_PX
        index = (rows[:, None] * (columns[-1] + 1) + columns[None]).ravel()
        sums.append(np.bincount(index, s.ravel()))
        counts.append(np.bincount(index, ok.ravel()))
    sums, counts = np.concatenate(sums), np.concatenate(counts)
    return sums[counts > 0], counts[counts > 0]
