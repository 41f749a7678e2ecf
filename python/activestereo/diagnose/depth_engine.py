# SPDX-License-Identifier: Apache-2.0
"""Judges the device's own depth engine by its disparity: its faults do not show in the infrared images.

The device's matcher differs from ours, but both match the same images. We judge the device's disparity error against
the true geometry, minus the error of our engine on the model's image pair. Errors beyond a pixel are mismatches and
count as one pixel. A filter is recognised by the variance of differences between neighbours instead.

Some effects are a choice of the matcher, not a fault (EngineFault.is_matcher_choice). They are subtracted first, as
long as one of them gains more likelihood than every fault. Faults are judged on the rest.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from activestereo.capture.capture import Capture
from activestereo.capture.images import block_numbers
from activestereo.common.computed_once import computed_once
from activestereo.compare.depth_compare import model_depths
from activestereo.compare.image_errors import ImageErrors
from activestereo.diagnose.evidence import TILE_PX
from activestereo.diagnose.goodness import Z90, Interval, design_effect, within_ranges
from activestereo.diagnose.kept import FitCache, content_key, effect_content
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.ranking import entry_json
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
# An effect is named only if it improves more than this share of the frames.
_MOST_FRAMES = 0.5


@dataclass(frozen=True)
class DepthFinding:
    """An effect on disparity or depth, fitted to the device's disparity.

    limits: (value, low, high) of each parameter, [n][3]. nats: gain of log-likelihood. share: part of the squared
    disparity error that the effect explains. consistency: share of frames that the effect improves. pose_error_nats:
    the part of the gain that pose errors may explain. is_filter: whether it was fitted as a smoothing filter, by the
    roughness of errors. is_named: whether the device's depth shows it.
    """

    effect: Effect
    limits: np.ndarray
    nats: float
    share: float
    consistency: float = 1.0
    pose_error_nats: float = 0.0
    is_filter: bool = False
    is_named: bool = False

    def parameters(self) -> dict[str, Interval]:
        """Returns the effect's parameters with their intervals."""
        rows = zip(self.effect.parameters, self.limits.tolist(), strict=True)
        return within_ranges(self.effect, {p.name: (value, low, high) for p, (value, low, high) in rows})


@dataclass(frozen=True)
class Depth:
    """The judgement of a depth engine. findings: named effects first, then by gain; empty if there is no depth.
    images_agree: whether the model explains the infrared images. If not, no effect is named, because the device's
    engine matched these images."""

    findings: tuple[DepthFinding, ...]
    images_agree: bool

    def named(self, is_choice: bool) -> list[DepthFinding]:
        """Returns the named findings. is_choice: True selects choices of the matcher, False selects faults."""
        return [f for f in self.findings if f.is_named and f.effect.engine_fault.is_matcher_choice == is_choice]


def judged_depth(
    capture: Capture,
    errors: ImageErrors,
    model: Model,
    excess: float,
    effects: Sequence[Effect],
    seed: int,
    numbers: Numbers,
    memory: FitCache | None = None,
) -> Depth:
    """Fits effects on disparity and depth to the device's depth in train frames, and decides which are named. While a
    choice of the matcher gains most, it is subtracted, and the other effects are fitted again. capture: with its stated
    geometry, which the device's matcher assumes. errors: of the images that the model expects. excess: their squared
    error beyond the noise, in noise variances. effects: the effects to judge."""
    known, agree = {e.id for e, _ in model.effects}, excess < numbers.structure
    faults = [e for e in effects if e.channel is Channel.DEPTH_ENGINE and e.id not in known]
    frames = list(_frames(capture, errors, model, seed)) if faults else []
    if not frames:
        return Depth((), agree)
    judge, waiting, found = _Judge(frames, numbers, memory), list(faults), dict[str, DepthFinding]()
    chance = np.log(len(faults) / numbers.alpha)
    while waiting:
        if memory is not None:
            memory.make_ahead(judge.fit, waiting)
        now = [judge.fit(e) for e in waiting]
        found |= {f.effect.id: f for f in now}
        best = max(now, key=lambda f: f.nats)
        is_clear = best.nats > chance and best.consistency > _MOST_FRAMES
        if not (best.effect.engine_fault.is_matcher_choice and is_clear):
            break
        judge = judge.without(best)
        waiting.remove(best.effect)

    def is_named(f: DepthFinding) -> bool:
        is_clear = f.nats > chance + f.pose_error_nats and f.consistency > _MOST_FRAMES
        return bool(agree and f.share >= numbers.least_share and is_clear)

    findings = [replace(found[e.id], is_named=is_named(found[e.id])) for e in faults]
    return Depth(tuple(sorted(findings, key=lambda f: (not f.is_named, -f.nats))), agree)


@dataclass(frozen=True)
class _DepthFrame:
    """One frame with device depth; images [height][width] in pixels of disparity.

    truth: disparity of the true geometry, 0 = none. device: the device's error. engine: our engine's errors on two
    simulated exposures of the model. valid: pixels where all of these are known. inside: valid pixels where all errors
    are below a pixel. focal_baseline: focal length times baseline, px m.
    """

    view: View
    truth: np.ndarray
    device: np.ndarray
    engine: tuple[np.ndarray, np.ndarray]
    valid: np.ndarray
    inside: np.ndarray
    focal_baseline: float

    def shift(self, effect: Effect, values: np.ndarray, noise_px: float) -> np.ndarray:
        """Returns the change of disparity by an effect, px [height][width]. The effect acts on the true disparities
        plus the constant noise_px."""
        truth = np.where(self.truth > 0, np.maximum(self.truth + noise_px, 1e-3), 0.0)
        moved = self.applied(effect, values, truth)
        return (
            moved - truth
            if effect.stage is Stage.DISPARITY
            else np.where((moved > 0) & (truth > 0), moved - truth, 0.0)
        )

    def applied(self, effect: Effect, values: np.ndarray, disparity: np.ndarray) -> np.ndarray:
        """Returns a disparity image after an effect. Effects on depth act on the depth of that disparity."""
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


def _frames(capture: Capture, errors: ImageErrors, model: Model, seed: int) -> Iterator[_DepthFrame]:
    for d in model_depths(capture, errors, model, seed, "train"):
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
        view = errors.views[d.frame.id, "left"]
        yield _DepthFrame(view, truth, device, (first, second), valid, inside, d.focal_baseline)


class _Judge:
    """Fits effects to the disparity errors of frames. memory: the cache that keeps fits, or None."""

    def __init__(self, frames: Sequence[_DepthFrame], numbers: Numbers, memory: FitCache | None = None) -> None:
        self._frames, self._numbers, self._memory = frames, numbers, memory
        # A fault acts on noisy disparities: their noise is taken to be that of our engine's errors.
        squares = [np.square(frame.engine[0][frame.inside]) for frame in frames]
        count = sum(s.size for s in squares)
        self._noise_px = float(np.sqrt(sum(s.sum() for s in squares) / count)) if count else 0.0

    def without(self, found: DepthFinding) -> "_Judge":
        """Returns a _Judge of the errors that remain after a fitted effect is subtracted. For a filter it returns
        itself, since smoothing cannot be undone."""
        if found.is_filter:
            return self
        left = []
        for frame in self._frames:
            shift = self._shift(found.effect, found.limits[:, 0], frame)
            left.append(replace(frame, device=np.where(frame.valid, frame.device - shift, 0.0)))
        return _Judge(left, self._numbers, self._memory)

    def fit(self, effect: Effect) -> DepthFinding:
        """Fits an effect as a shift of the disparities and as a filter, and returns the better one."""

        def fitted() -> dict[str, np.ndarray]:
            bias, smooth = self._fit_bias(effect), self._fit_smoothness(effect)
            best = smooth if smooth is not None and smooth.nats > bias.nats else bias
            own = best.nats, best.share, best.consistency, best.pose_error_nats, best.is_filter
            return {"limits": best.limits, "own": np.array(own)}

        content = effect_content(effect)
        key = content and content_key("depth", self._content(), content)
        arrays = fitted() if self._memory is None else self._memory.once(key, fitted)
        nats, share, consistency, from_poses, is_filter = arrays["own"].tolist()
        return DepthFinding(effect, arrays["limits"], nats, share, consistency, from_poses, bool(is_filter))

    @computed_once
    def _content(self) -> str:
        return content_key(self._frames, self._numbers)

    def _shift(self, effect: Effect, values: np.ndarray, frame: _DepthFrame) -> np.ndarray:
        """Returns the shift of the true disparities by an effect, px [height][width]. It is averaged over our engine's
        noise, because the effect acts on noisy disparities."""
        shifts = [weight * frame.shift(effect, values, node * self._noise_px) for node, weight in _NODES]
        return np.sum(shifts, axis=0)

    def _squares(
        self, effect: Effect, values: np.ndarray, frames: Sequence[_DepthFrame] | None = None
    ) -> list[np.ndarray]:
        """Returns squared errors for each frame, px^2 [height][width], capped at a pixel. The error is the device's
        minus our engine's, minus an effect's shift. Invalid pixels are 0. frames: None = all."""
        out = []
        for frame in self._frames if frames is None else frames:
            rest = frame.device - 0.5 * (frame.engine[0] + frame.engine[1]) - self._shift(effect, values, frame)
            out.append(np.where(frame.valid, np.minimum(rest**2, _LARGEST_ERROR_PX**2), 0.0))
        return out

    def _fit_bias(self, effect: Effect) -> DepthFinding:
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
        return fit if fit.nats > 0.0 else self._judged(effect, neutral, neutral)

    def _judged(self, effect: Effect, neutral: np.ndarray, found: np.ndarray) -> DepthFinding:
        base, now = self._squares(effect, neutral), self._squares(effect, found)
        before, after = sum(float(s.sum()) for s in base), sum(s.sum() for s in now)
        tiles, counts = _tile_sums(now, [frame.valid for frame in self._frames])
        pixels, design = counts.sum(), design_effect(tiles, counts)
        nats = 0.5 * pixels / design * np.log(before / after) if after > 0 else 0.0
        better = np.mean([n.sum() < b.sum() for n, b in zip(now, base, strict=True)])
        pose_error_px = (
            self._numbers.poses_known_to_rad * self._frames[0].view.K[0, 0] if effect.engine_fault.displaces else 0.0
        )
        limits = np.zeros((len(found), 3))
        for i, p in enumerate(effect.parameters):
            step = 0.05 * p.typical
            here = np.arange(len(found)) == i
            moved = [np.where(here, np.clip(found[i] + side * step, p.low, p.high), found) for side in (-1, 1)]
            curve = sum(s.sum() for m in moved for s in self._squares(effect, m)) - 2 * after
            error = step * np.sqrt(2 * design * (after / pixels) / curve) if curve > 0 else p.high - p.low
            error = np.hypot(error, pose_error_px)
            ends = found[i], found[i] - Z90 * error, found[i] + Z90 * error
            limits[i] = np.clip(ends, p.low, p.high)
        from_poses = pose_error_nats(nats, found - neutral, pose_error_px)
        return DepthFinding(effect, limits, float(nats), float(1.0 - after / before), float(better), from_poses)

    def _fit_smoothness(self, effect: Effect) -> DepthFinding | None:
        """Fits the amplitude (first parameter) of a smoothing filter so that our engine's filtered errors are as rough
        as the device's. Returns None if the effect does not smooth, or if the device is not smoother."""
        first, differ = effect.parameters[0], self._numbers.engines_differ
        wanted = self._roughness([frame.device for frame in self._frames])
        ladder, others = [0.0, *_LADDER * first.typical], [p.neutral for p in effect.parameters[1:]]
        rough = [
            self._roughness([frame.filtered(effect, np.array([x, *others])) for frame in self._frames]) for x in ladder
        ]
        ratio = rough[0] / max(wanted, 1e-12)
        if ratio < differ or rough[-1] > _ROUGH_SHARE * rough[0]:
            return None
        at = lambda roughness: float(np.interp(-np.log(roughness), -np.log(np.maximum(rough, 1e-12)), ladder))  # noqa: E731
        engines = [at(wanted * factor) for factor in (differ, 1 / differ)]
        pixels = sum(frame.inside.sum() for frame in self._frames)
        nats = 0.25 * pixels / TILE_PX * (np.log(ratio / differ)) ** 2
        limits = np.array([[p.neutral] * 3 for p in effect.parameters], dtype=np.float64)
        limits[0] = at(wanted), min(engines), max(engines)
        return DepthFinding(effect, limits, float(nats), float(1.0 - 1.0 / ratio), is_filter=True)

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


def pose_error_nats(nats: float, offset_px: np.ndarray, pose_error_px: float) -> float:
    """Returns the part of a log-likelihood gain that errors of the measured poses may explain instead. offset_px:
    fitted displacement. pose_error_px: standard deviation of the displacements that pose errors cause."""
    gained = 2.0 * max(nats, 0.0) * pose_error_px**2
    return float(nats * gained / (gained + (offset_px**2).sum())) if gained > 0 else 0.0


def _tile_sums(squares: Sequence[np.ndarray], valid: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Returns (sum of squares, count of valid pixels) of every tile with a valid pixel."""
    squares_of, pixels_of = [], []
    for s, ok in zip(squares, valid, strict=True):
        index = block_numbers(s.shape, TILE_PX).ravel()
        squares_of.append(np.bincount(index, s.ravel()))
        pixels_of.append(np.bincount(index, ok.ravel()))
    sums, counts = np.concatenate(squares_of), np.concatenate(pixels_of)
    return sums[counts > 0], counts[counts > 0]


def depth_json(depth: Depth, numbers: Numbers, name_of: Callable[[int], str]) -> dict[str, Any]:
    """Returns `depth` of diagnose.json: the verdict and the fitted effects. nuisance: whether an effect is a choice of
    the matcher, no fault. added: the fault that model.json holds. name_of: returns a material's name for its index."""
    faults = depth.named(is_choice=False)[:1]
    verdict, reason = (EFFECT if faults else NONE), None
    if not depth.findings:
        verdict, reason = UNDETERMINED, "the capture has no device depth in its train frames"
    elif not depth.images_agree:
        verdict, reason = UNDETERMINED, "the model's infrared images differ from those that it matched"
    entries = [
        entry_json(
            f.effect, "depth", f.nats, numbers.credible if f.is_named else 0.0, f.share, f.parameters(), [], name_of
        )
        | {"nuisance": f.effect.engine_fault.is_matcher_choice}
        for f in depth.findings
    ]
    return {"verdict": verdict, "reason": reason, "ranking": entries, "added": [f.effect.id for f in faults]}
