# SPDX-License-Identifier: Apache-2.0
"""Judges the device's own depth engine by its disparity: its faults do not show in the infrared images.

The device's matcher is not ours, but both get the same images. Judged is the device's disparity error against the true
geometry, less the error of our engine on the model's own pair. Errors beyond a pixel are mismatches and count as one
pixel. A filter is recognised by the variance of differences between neighbours instead.

Differences that depend on the matcher alone (EngineFault.is_matcher_choice) are removed first as long as they explain
most of the error; faults are judged on the rest.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from activestereo.common.computed_once import computed_once
from activestereo.compare.depth_compare import model_depths
from activestereo.diagnose.evidence import TILE_PX, Evidence
from activestereo.diagnose.fitter import ImageResidual
from activestereo.diagnose.goodness import Z90, Interval, Limits, design_effect, within_ranges
from activestereo.diagnose.kept import FitCache, content_key, effect_content
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.ranking import parameter_json
from activestereo.diagnose.verdict import EFFECT, NONE, UNDETERMINED
from activestereo.effects import Effect, Model, Stage, View
from activestereo.effects.core.descriptor import Channel

_LARGEST_ERROR_PX = 1.0
# Fits start at these multiples of a parameter's typical value, use so many frames and at most so many evaluations.
# They end when a step is below a share of the typical value and its gain below a share of the cost.
_STARTS = (-1.0, 0.3, 1.0, 3.0)
_FIT_FRAMES, _EVALUATIONS = 3, 60
_STEP_ENDS, _GAIN_ENDS = 0.02, 1e-5
# Amplitudes of a filter to try, in typical values.
_LADDER = np.linspace(0.4, 2.0, 5)
# A filter that leaves more than this share of the neighbours' differences explains nothing.
_ROUGH_SHARE = 0.7
# Nodes, in deviations, and weights of Gauss and Hermite's rule for a normal mean.
_NODES = ((-np.sqrt(3.0), 1 / 6), (0.0, 2 / 3), (np.sqrt(3.0), 1 / 6))
# A fault improves more than this share of the frames.
_MOST_FRAMES = 0.5


@dataclass(frozen=True)
class DepthEvidence:
    """How well an effect explains the device's disparity. nats: gain of log-likelihood. share: of the squared error of
    disparity that the effect explains. consistency: share of the frames that get better. pose_error_nats: the part of
    the gain that errors of the measured poses may explain."""

    nats: float
    share: float
    consistency: float = 1.0
    pose_error_nats: float = 0.0

    def is_clear(self, tried: int, numbers: Numbers) -> bool:
        """Returns whether the gain exceeds chance among `tried` effects and errors of the poses, in most frames."""
        chance = np.log(max(tried, 1) / numbers.alpha)
        return bool(self.nats > chance + self.pose_error_nats and self.consistency > _MOST_FRAMES)


@dataclass(frozen=True)
class DepthFinding:
    """An effect on disparity or depth with its fitted parameters and its evidence (own). is_named: whether the device's
    depth shows it."""

    effect: Effect
    parameters: dict[str, Interval]
    own: DepthEvidence
    is_named: bool


@dataclass(frozen=True)
class Depth:
    """The judgement of a depth engine. findings: named effects first, then by gain; empty if there is no depth.
    images_agree: whether the infrared images lack nothing; if they do, no effect is named, because the engine matched
    these images."""

    findings: tuple[DepthFinding, ...]
    images_agree: bool

    def faults(self) -> list[DepthFinding]:
        """Returns the named findings that do not depend on the choice of the matcher."""
        return [f for f in self.findings if f.is_named and not f.effect.engine_fault.is_matcher_choice]

    def choices(self) -> list[DepthFinding]:
        """Returns the named findings that depend on the matcher alone."""
        return [f for f in self.findings if f.is_named and f.effect.engine_fault.is_matcher_choice]


def judged_depth(
    evidence: Evidence,
    model: Model,
    rows: Sequence[ImageResidual],
    effects: Sequence[Effect],
    numbers: Numbers,
    workers: int,
    memory: FitCache | None = None,
) -> Depth:
    """Fits effects on disparity and depth to the device's depth on the train frames, and judges which it shows. rows:
    residuals of the train images under the model. effects: those to judge."""
    pixels = sum(row.observation.pixels for row in rows)
    left = sum(float((row.observation.weight * row.residual**2).sum()) for row in rows) / pixels - 1.0
    known, agree = {e.id for e, _ in model.effects}, left < numbers.structure
    faults = [e for e in effects if e.channel is Channel.DEPTH_ENGINE and e.id not in known]
    frames = list(_frames(evidence, model, rows)) if faults else []
    if not frames:
        return Depth((), agree)
    fits = _fits(_Judge(frames, numbers, memory), faults, numbers, workers, memory)
    findings = [
        DepthFinding(e, within_ranges(e, fit.limits), fit.own,
                     agree and fit.own.share >= numbers.least_share and fit.own.is_clear(len(faults), numbers))
        for e, fit in ((e, fits[e.id]) for e in faults)
    ]  # fmt: skip
    return Depth(tuple(sorted(findings, key=lambda f: (not f.is_named, -f.own.nats))), agree)


def _fits(
    judge: "_Judge", effects: Sequence[Effect], numbers: Numbers, workers: int, memory: FitCache | None
) -> dict[str, "_DepthFit"]:
    """Fits every effect to the device's disparity errors; returns {effect: fit}. While an effect that only depends on
    the choice of the matcher gains most, it is subtracted first, and the others are fitted again."""
    fits: dict[str, _DepthFit] = {}
    waiting = list(effects)
    while waiting:
        if memory is not None:
            memory.make_ahead(judge.fit, waiting, workers)
        now = {e.id: judge.fit(e) for e in waiting}
        best = max(waiting, key=lambda e: now[e.id].own.nats)
        own = replace(now[best.id].own, pose_error_nats=0.0)
        if not (best.engine_fault.is_matcher_choice and own.is_clear(len(effects), numbers)):
            return fits | now
        fits[best.id] = now[best.id]
        judge = judge.without(best, now[best.id])
        waiting.remove(best)
    return fits


@dataclass(frozen=True)
class _DepthFit:
    """The fit of one effect to the device's disparity errors. values: its parameters in the effect's order.

    limits: {parameter: (value, low, high)}. is_filter: whether it was fitted as a smoothing filter, by the roughness of
    the errors.
    """

    own: DepthEvidence
    values: np.ndarray
    limits: dict[str, Limits]
    is_filter: bool = False

    def as_arrays(self) -> dict[str, np.ndarray]:
        """Returns the fit as named arrays, for a FitCache."""
        limits = np.array(list(self.limits.values()))
        own = np.array(astuple(self.own))
        return {"own": own, "values": self.values, "limits": limits, "is_filter": np.array(self.is_filter)}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, np.ndarray], effect: Effect) -> "_DepthFit":
        """Makes the fit of an effect from the arrays of as_arrays()."""
        rows = zip(effect.parameters, arrays["limits"].tolist(), strict=True)
        limits: dict[str, Limits] = {p.name: (value, low, high) for p, (value, low, high) in rows}
        return cls(DepthEvidence(*arrays["own"].tolist()), arrays["values"], limits, bool(arrays["is_filter"]))


@dataclass(frozen=True)
class _DepthFrame:
    """One frame with device depth; images [height][width] in pixels of disparity.

    truth: disparity of the geometry, 0 = none. device: the device's error. engine: our engine's errors on two simulated
    exposures of the model. valid: where all are known. inside: where all errors are below a pixel. focal_baseline:
    focal length times baseline, px m.
    """

    view: View
    truth: np.ndarray
    device: np.ndarray
    engine: tuple[np.ndarray, np.ndarray]
    valid: np.ndarray
    inside: np.ndarray
    focal_baseline: float

    def shift(self, effect: Effect, values: np.ndarray, noise_px: float) -> np.ndarray:
        """Returns the change that an effect makes to the true disparities plus a constant noise_px, px
        [height][width]."""
        truth = np.where(self.truth > 0, np.maximum(self.truth + noise_px, 1e-3), 0.0)
        moved = self.applied(effect, values, truth)
        return (
            moved - truth
            if effect.stage is Stage.DISPARITY
            else np.where((moved > 0) & (truth > 0), moved - truth, 0.0)
        )

    def applied(self, effect: Effect, values: np.ndarray, disparity: np.ndarray) -> np.ndarray:
        """Returns a disparity image after an effect on disparity, or after an effect on the depth of that disparity."""
        named = {p.name: float(v) for p, v in zip(effect.parameters, values, strict=True)}
        if effect.stage is Stage.DISPARITY:
            return effect.apply(disparity, self.view, **named)
        return self._inverse(effect.apply(self._inverse(disparity), self.view, **named))

    def _inverse(self, image: np.ndarray) -> np.ndarray:
        return np.where(image > 0, self.focal_baseline / np.maximum(image, 1e-9), 0.0)

    def filtered(self, effect: Effect, values: np.ndarray) -> np.ndarray:
        """Returns our engine's errors after an effect, px [height][width]."""
        moved = self.applied(effect, values, np.where(self.valid, self.truth + self.engine[0], 0.0))
        known = self.valid if effect.stage is Stage.DISPARITY else self.valid & (moved > 0)
        return np.where(known, moved - self.truth, 0.0)


def _frames(evidence: Evidence, model: Model, rows: Sequence[ImageResidual]) -> Iterator[_DepthFrame]:
    if not any(o.frame.depth_path is not None for o in evidence.train):
        return
    measured, views = {o.key: o.measured for o in evidence.train}, {o.key: o.view for o in evidence.train}
    predictions = {row.observation.key: row.expected for row in rows}
    for d in model_depths(
        evidence.capture, measured, predictions, views, evidence.noise_model, model, evidence.seed, "train"
    ):
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
        first, second = engine
        yield _DepthFrame(views[d.frame.id, "left"], truth, device, (first, second), valid, inside, d.focal_baseline)


class _Judge:
    """Fits effects to the disparity errors of frames. memory: the cache that keeps fits, or None."""

    def __init__(self, frames: Sequence[_DepthFrame], numbers: Numbers, memory: FitCache | None = None) -> None:
        self._frames, self._numbers, self._memory = frames, numbers, memory
        # A fault acts on noisy disparities: their noise is taken to be that of our engine's errors.
        squares = [np.square(frame.engine[0][frame.inside]) for frame in frames]
        count = sum(s.size for s in squares)
        self._noise_px = float(np.sqrt(sum(s.sum() for s in squares) / count)) if count else 0.0

    def without(self, effect: Effect, fit: _DepthFit) -> "_Judge":
        """Subtracts a fitted effect from the device's errors; returns a _Judge of the remaining ones. For a filter it
        returns itself, since smoothing cannot be undone."""
        if fit.is_filter:
            return self
        shifts = [self._shift(effect, fit.values, frame) for frame in self._frames]
        moved = zip(self._frames, shifts, strict=True)
        left = [replace(f, device=np.where(f.valid, f.device - s, 0.0)) for f, s in moved]
        return _Judge(left, self._numbers, self._memory)

    def fit(self, effect: Effect) -> _DepthFit:
        content = effect_content(effect)
        if self._memory is None or content is None:
            return self._fit(effect)
        key = content_key("depth", self._content(), content)
        return _DepthFit.of_arrays(self._memory.once(key, lambda: self._fit(effect).as_arrays()), effect)

    @computed_once
    def _content(self) -> str:
        return content_key(self._frames, self._numbers)

    def _fit(self, effect: Effect) -> _DepthFit:
        bias, smooth = self._fit_bias(effect), self._fit_smoothness(effect)
        return smooth if smooth is not None and smooth.own.nats > bias.own.nats else bias

    def _shift(self, effect: Effect, values: np.ndarray, frame: _DepthFrame) -> np.ndarray:
        """Returns how an effect moves the true disparities, px: the mean over the engine's noise, on which it acts."""
        shifts = [weight * frame.shift(effect, values, node * self._noise_px) for node, weight in _NODES]
        return np.sum(shifts, axis=0)

    def _squares(
        self, effect: Effect, values: np.ndarray, frames: Sequence[_DepthFrame] | None = None
    ) -> list[np.ndarray]:
        """Returns, for each frame, the squared difference between the device's and our engine's disparity errors less
        an effect's shift, px^2 [height][width], capped. Invalid pixels are 0. frames: None = all."""
        out = []
        for frame in self._frames if frames is None else frames:
            rest = frame.device - 0.5 * (frame.engine[0] + frame.engine[1]) - self._shift(effect, values, frame)
            out.append(np.where(frame.valid, np.minimum(rest**2, _LARGEST_ERROR_PX**2), 0.0))
        return out

    def _fit_bias(self, effect: Effect) -> _DepthFit:
        neutral, typical, low, high = (
            np.array([getattr(p, n) for p in effect.parameters]) for n in ("neutral", "typical", "low", "high")
        )

        few = self._frames[:: -(-len(self._frames) // _FIT_FRAMES)]

        def cost(values: np.ndarray) -> float:
            return float(sum(s.sum() for s in self._squares(effect, np.clip(values, low, high), few)))

        trials = [neutral]
        for i, p in enumerate(effect.parameters):
            for step in _STARTS:
                trial = neutral.copy()
                trial[i] = np.clip(p.neutral + step * p.typical, p.low, p.high)
                trials.append(trial)
        best = min(trials, key=cost)
        corners = np.where(best == neutral, best + 0.1 * typical, 0.7 * best + 0.3 * neutral)
        simplex = np.vstack([best, *[np.where(np.arange(len(best)) == i, corners, best) for i in range(len(best))]])
        ends = {"xatol": _STEP_ENDS * typical.min(), "fatol": _GAIN_ENDS * cost(best)}
        options = {"maxfev": _EVALUATIONS, "initial_simplex": simplex, **ends}
        found = np.clip(minimize(cost, best, method="Nelder-Mead", options=options).x, low, high)
        fit = self._judged(effect, neutral, found)
        return fit if fit.own.nats > 0.0 else self._judged(effect, neutral, neutral)

    def _judged(self, effect: Effect, neutral: np.ndarray, found: np.ndarray) -> _DepthFit:
        base, now = self._squares(effect, neutral), self._squares(effect, found)
        before, after = sum(float(s.sum()) for s in base), sum(s.sum() for s in now)
        tiles, counts = _tile_sums(now, [frame.valid for frame in self._frames])
        pixels, design = counts.sum(), design_effect(tiles, counts)
        nats = 0.5 * pixels / design * np.log(before / after) if after > 0 else 0.0
        better = np.mean([n.sum() < b.sum() for n, b in zip(now, base, strict=True)])
        pose_error_px = (
            self._numbers.poses_known_to_rad * self._frames[0].view.K[0, 0] if effect.engine_fault.displaces else 0.0
        )
        limits = {}
        for i, p in enumerate(effect.parameters):
            step = 0.05 * p.typical
            here = np.arange(len(found)) == i
            moved = [np.where(here, np.clip(found[i] + side * step, p.low, p.high), found) for side in (-1, 1)]
            curve = sum(s.sum() for m in moved for s in self._squares(effect, m)) - 2 * after
            error = step * np.sqrt(2 * design * (after / pixels) / curve) if curve > 0 else p.high - p.low
            error = np.hypot(error, pose_error_px)
            ends = found[i], found[i] - Z90 * error, found[i] + Z90 * error
            value, low, high = (float(np.clip(v, p.low, p.high)) for v in ends)
            limits[p.name] = value, low, high
        from_poses = pose_error_nats(nats, found - neutral, pose_error_px)
        return _DepthFit(
            DepthEvidence(float(nats), float(1.0 - after / before), float(better), from_poses), found, limits
        )

    def _fit_smoothness(self, effect: Effect) -> _DepthFit | None:
        """Fits the amplitude of a smoothing filter (the first parameter): our engine's filtered errors become as rough
        as the device's. Returns None if the effect does not smooth, or the device is not smoother."""
        first, differ = effect.parameters[0], self._numbers.engines_differ
        wanted = self._roughness([frame.device for frame in self._frames])
        ladder = [0.0, *_LADDER * first.typical]
        rough = [
            self._roughness([frame.filtered(effect, _leading(effect, x)) for frame in self._frames]) for x in ladder
        ]
        ratio = rough[0] / max(wanted, 1e-12)
        if ratio < differ or rough[-1] > _ROUGH_SHARE * rough[0]:
            return None
        at = lambda roughness: float(np.interp(-np.log(roughness), -np.log(np.maximum(rough, 1e-12)), ladder))  # noqa: E731
        engines = [at(wanted * factor) for factor in (differ, 1 / differ)]
        pixels = sum(frame.inside.sum() for frame in self._frames)
        nats = 0.25 * pixels / TILE_PX * (np.log(ratio / differ)) ** 2
        limits: dict[str, Limits] = {p.name: (p.neutral, p.neutral, p.neutral) for p in effect.parameters}
        limits[first.name] = at(wanted), min(engines), max(engines)
        own = DepthEvidence(float(nats), float(1.0 - 1.0 / ratio))
        return _DepthFit(own, _leading(effect, at(wanted)), limits, is_filter=True)

    def _roughness(self, errors: Sequence[np.ndarray]) -> float:
        """Returns the mean squared difference between neighbours along rows and columns, px^2. Only pixels with errors
        below one pixel count."""
        total = count = 0.0
        for error, frame in zip(errors, self._frames, strict=True):
            for axis in (0, 1):
                both = frame.inside & np.roll(frame.inside, 1, axis)
                total += (((error - np.roll(error, 1, axis)) ** 2)[both]).sum()
                count += both.sum()
        return total / max(count, 1)


def _leading(effect: Effect, value: float) -> np.ndarray:
    """Returns neutral parameters except for the first one, which gets the value."""
    return np.array([value, *(p.neutral for p in effect.parameters[1:])])


def pose_error_nats(nats: float, offset_px: np.ndarray, pose_error_px: float) -> float:
    """Returns the part of a log-likelihood gain that errors of the measured poses may explain instead. offset_px:
    fitted displacement. pose_error_px: standard deviation of the displacements that pose errors cause."""
    gained = 2.0 * max(nats, 0.0) * pose_error_px**2
    return float(nats * gained / (gained + (offset_px**2).sum())) if gained > 0 else 0.0


def _tile_sums(squares: Sequence[np.ndarray], valid: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Returns (sum of squares, count of valid pixels) of every tile with a valid pixel."""
    squares_of, pixels_of = [], []
    for s, ok in zip(squares, valid, strict=True):
        rows, columns = np.arange(s.shape[0]) // TILE_PX, np.arange(s.shape[1]) // TILE_PX
        index = (rows[:, None] * (columns[-1] + 1) + columns[None]).ravel()
        squares_of.append(np.bincount(index, s.ravel()))
        pixels_of.append(np.bincount(index, ok.ravel()))
    sums, counts = np.concatenate(squares_of), np.concatenate(pixels_of)
    return sums[counts > 0], counts[counts > 0]


def depth_json(depth: Depth, numbers: Numbers, name_of: Callable[[int], str]) -> dict[str, Any]:
    """Returns the verdict on a depth engine and its fitted effects. nuisance: the effect depends on the matcher alone
    and is no fault. added: the fault that model.json holds. name_of: returns a material's name by its number."""
    faults = depth.faults()[:1]
    verdict, reason = (EFFECT if faults else NONE), None
    if not depth.findings:
        verdict, reason = UNDETERMINED, "the capture has no device depth in its train frames"
    elif not depth.images_agree:
        verdict, reason = UNDETERMINED, "the model's infrared images differ from those that it matched"
    entries = [
        {
            "effect": f.effect.id,
            "family": f.effect.family,
            "finding": f.effect.finding,
            "channel": "depth",
            "score_nats": f.own.nats,
            "confidence": numbers.credible if f.is_named else 0.0,
            "explained_share": f.own.share,
            "parameters": {p.name: parameter_json(p, f.parameters[p.name], name_of) for p in f.effect.parameters},
            "equivalent": [],
            "nuisance": f.effect.engine_fault.is_matcher_choice,
        }
        for f in depth.findings
    ]
    return {"verdict": verdict, "reason": reason, "ranking": entries, "added": [f.effect.id for f in faults]}
