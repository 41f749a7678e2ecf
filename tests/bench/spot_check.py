# SPDX-License-Identifier: Apache-2.0
"""Estimates a quick sensor's distance from the path-traced one over a training run, from a small share of its
frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

MEASURES = ("bias, px", "noise ratio", "hole IoU")
_FALSE_STOPS = 0.05  # share of runs that keep their bounds
_STREAM = 0x53504F54  # stream of random numbers that no other part of a run uses
_LEAST_FRAMES = 3  # of a material, for an interval


class BoundExceededError(RuntimeError):
    """A measure of a material lies outside of the range that the run was given, with its whole interval."""


class Traced(Protocol):
    """The path-traced sensor, such as StereoDepthSensor, on a scene of its own."""

    def take_picture(self, infrared_only: bool = False) -> Any: ...
    def compute_depth(self) -> Any: ...
    def get_disparity(self) -> NDArray[np.float32]: ...


@dataclass(frozen=True)
class Estimate:
    """A measure and its 95 % interval for the whole run; NaN where too few frames were seen."""

    value: float
    low: float
    high: float


class SpotCheck:
    """Path-traces a share of a quick sensor's frames, and estimates the difference over all of them.

        check = SpotCheck(traced, show, config.focal_baseline_px_m, share=0.01)
        out = fast(depth=depth_m, material=material)  # a GBufferStereo, at each step
        check.see(out["disparity"], depth_m, material)
        print(check)

    sensor: traces one environment. show(n): places environment n in that sensor's scene, as it stands now. share: of
    frames, drawn under the seed regardless of their content. focal_baseline_px_m: of the rectified pair. names: of
    material numbers. bounds: {measure: (low, high)}; see() raises BoundExceededError once the whole interval of a
    material lies outside. Intervals are of the ratio estimator with whole frames as clusters (Cochran, Sampling
    Techniques, 1977, ch. 6.3). The k-th look at the bounds has a level of 1 - 0.05 / (k (k + 1)), so that all looks
    together stop at most 5 % of the runs that keep them.
    """

    def __init__(
        self,
        sensor: Traced,
        show: Callable[[int], object],
        focal_baseline_px_m: float,
        *,
        share: float = 0.01,
        seed: int = 0,
        names: Mapping[int, str] | None = None,
        bounds: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        if not 0.0 < share <= 1.0:
            raise ValueError(f"a spot check sees a share above 0 and up to 1 of the frames, not {share}")
        for name, (low, high) in (bounds or {}).items():
            if name not in MEASURES or not low <= high:
                raise ValueError(
                    f"bound '{name}' ({low} to {high}): the measures are {', '.join(MEASURES)}, low to high"
                )
        self._sensor, self._show, self._fb = sensor, show, focal_baseline_px_m
        self._share, self._seed, self._names = share, seed, dict(names or {})
        self._bounds = dict(bounds or {})
        self._steps = self._looks = 0
        self._sums: dict[
            int, list[NDArray[np.float64]]
        ] = {}  # by material, of each frame: over and under of the measures
        self.frames = self.traced = 0

    def see(
        self, disparity: NDArray[Any], depth_m: NDArray[Any], material: NDArray[Any] | None = None
    ) -> NDArray[np.intp]:
        """Adds one step of all environments, [environments, height, width]: disparity in px (0 = none), true planar
        depth in metres (0 = no surface) and material numbers. Returns the environments that were traced."""
        disparity, depth_m = np.asarray(disparity), np.asarray(depth_m)
        kinds = np.zeros(depth_m.shape, int) if material is None else np.asarray(material)
        if disparity.ndim != 3 or not disparity.shape == depth_m.shape == kinds.shape:
            raise ValueError(
                f"disparity, depth and material are [environments, height, width] of one size, not {disparity.shape}, "
                f"{depth_m.shape} and {kinds.shape}"
            )
        drawn = np.random.default_rng([_STREAM, self._seed, self._steps]).random(len(disparity))
        chosen = np.flatnonzero(drawn < self._share)
        self._steps += 1
        self.frames += len(disparity)
        for environment in chosen:
            self._show(int(environment))
            self._sensor.take_picture(infrared_only=True)
            self._sensor.compute_depth()
            traced = np.asarray(self._sensor.get_disparity())
            if traced.shape != disparity.shape[1:]:
                raise ValueError(f"the traced sensor has {traced.shape} pixels, the quick one {disparity.shape[1:]}")
            self._add(disparity[environment], traced, depth_m[environment], kinds[environment])
            self.traced += 1
        if len(chosen) and self._bounds:
            self._look()
        return chosen

    def report(self) -> dict[str, dict[str, Estimate]]:
        """{material: {measure: estimate}}. bias: mean of quick minus traced disparity. noise ratio: mean absolute error
        beside the true disparity, about its mean in the frame, quick over traced. hole IoU: of pixels where something
        stands."""
        return {self._names.get(kind, str(kind)): self._estimates(kind, 0.95) for kind in sorted(self._sums)}

    def __str__(self) -> str:
        lines = [f"{self.traced} of {self.frames} frames traced"]
        for name, estimates in self.report().items():
            words = (f"{measure} {e.value:.3f} ({e.low:.3f} to {e.high:.3f})" for measure, e in estimates.items())
            lines.append(f"{name}: {', '.join(words)}")
        return "\n".join(lines)

    def _add(self, quick: NDArray[Any], traced: NDArray[Any], depth_m: NDArray[Any], kinds: NDArray[Any]) -> None:
        there = depth_m > 0
        truth = np.divide(self._fb, depth_m, out=np.zeros(depth_m.shape), where=there)
        for kind in np.unique(kinds[there]):
            here = there & (kinds == kind)
            holes = [image[here] <= 0 for image in (quick, traced)]
            both = here & (quick > 0) & (traced > 0)
            errors = [image[both] - truth[both] for image in (quick, traced)]
            noise = [float(np.abs(e - e.mean()).sum()) if e.size else 0.0 for e in errors]
            over = [float((errors[0] - errors[1]).sum()), noise[0], float((holes[0] & holes[1]).sum())]
            under = [float(both.sum()), noise[1], float((holes[0] | holes[1]).sum())]
            self._sums.setdefault(int(kind), []).append(np.array([over, under]))

    def _estimates(self, kind: int, level: float) -> dict[str, Estimate]:
        over, under = np.moveaxis(np.array(self._sums[kind]), 1, 0)
        out = {}
        for name, y, x in zip(MEASURES, over.T, under.T, strict=True):
            if not x.sum() > 0:
                out[name] = Estimate(float("nan"), float("nan"), float("nan"))
                continue
            value, frames = y.sum() / x.sum(), int((x > 0).sum())
            half = float("nan")
            if frames >= _LEAST_FRAMES:
                variance = frames / (frames - 1) * ((y - value * x) ** 2).sum() * (1.0 - self._share) / x.sum() ** 2
                half = float(t.ppf(0.5 + 0.5 * level, frames - 1) * np.sqrt(variance))
            out[name] = Estimate(float(value), float(value - half), float(value + half))
        return out

    def _look(self) -> None:
        self._looks += 1
        level = 1.0 - _FALSE_STOPS / (self._looks * (self._looks + 1) * len(self._sums) * len(self._bounds))
        for kind in self._sums:
            for name, found in self._estimates(kind, level).items():
                low, high = self._bounds.get(name, (-np.inf, np.inf))
                if found.low > high or found.high < low:
                    raise BoundExceededError(
                        f"{self._names.get(kind, f'material {kind}')}: {name} is {found.value:.3f} ({found.low:.3f} to "
                        f"{found.high:.3f}) after {self.traced} traced of {self.frames} frames, and shall be {low} to "
                        f"{high}"
                    )
