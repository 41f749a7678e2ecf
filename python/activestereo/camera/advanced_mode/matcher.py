# SPDX-License-Identifier: Apache-2.0
"""Matches recorded pairs under advanced-mode settings, and searches for better settings key by key."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

import simsense
from activestereo.camera.advanced_mode.settings import AdvancedSettings, DepthTable, depth_table, matcher_parameters

_DISPARITY_STEPS = 32  # of a pixel, the step of disparities in images
_IN_COUNTS_OF_8_BITS = ("p2_full_gradient_dn", "min_texture_dn", "low_texture_dn", "census_noise_dn")


class PairMatcher:
    """Matches rectified pairs of one image size. K: 3x3 of the left and the right image, px; only cx may differ. first:
    an image with the pairs' size and dtype. base: simsense's matcher parameters at the camera's default settings, for
    8-bit images. overrides: parameters of simsense's rig and matcher that replace those from the settings."""

    def __init__(
        self,
        K: tuple[NDArray[np.float64], NDArray[np.float64]],
        baseline_m: float,
        first: NDArray[np.generic],
        settings: AdvancedSettings,
        base: Mapping[str, Any],
        overrides: Mapping[str, Any],
        device: simsense.Device,
    ) -> None:
        height, width = first.shape
        self._bits = 8 * first.itemsize
        self._base, self._overrides = dict(base), dict(overrides)
        self.table: DepthTable = depth_table(settings)
        left, right = (simsense.Camera(width, height, own) for own in K)
        left_to_right = np.eye(4)
        left_to_right[0, 3] = -baseline_m
        self._engine = simsense.Engine(
            device, left, right, left_to_right, rectified=True, bit_depth=self._bits, **self._parameters(settings)
        )

    def _parameters(self, settings: AdvancedSettings) -> dict[str, Any]:
        out = matcher_parameters(settings, self._base)
        out["min_depth_m"], out["max_depth_m"] = self.table.min_depth_m, self.table.max_depth_m
        for name in _IN_COUNTS_OF_8_BITS:
            out[name] <<= self._bits - 8
        return out | self._overrides

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters of the engine by name."""
        return dict(self._engine.parameters)

    def set_settings(self, settings: AdvancedSettings) -> None:
        """Sets the matcher's parameters for the next pairs from these settings; the depth table stays."""
        matcher = self._parameters(settings)
        self._engine.set_parameters(**{name: matcher[name] for name in self._engine.parameters if name in matcher})

    def disparity(self, left: NDArray[np.generic], right: NDArray[np.generic]) -> NDArray[np.float32]:
        """Computes the left image's disparity in pixels, float32 [height, width], -1 = not measured."""
        return np.array(self._engine.compute(left, right, ("disparity",))["disparity"], np.float32)

    def image(self, left: NDArray[np.generic], right: NDArray[np.generic]) -> NDArray[np.uint16]:
        """Computes the depth image in the camera's format, 0 = no measurement. Values are depths in units of the depth
        table, or disparities in 1/32 pixel if the table says so."""
        if self.table.is_disparity:
            values = _DISPARITY_STEPS * np.maximum(self.disparity(left, right), 0.0).astype(np.float64)
        else:
            depth = self._engine.compute(left, right, ("depth",))["depth"]
            values = np.asarray(depth, np.float64) / self.table.unit_m
        return np.clip(np.rint(values), 0, np.iinfo(np.uint16).max).astype(np.uint16)


Goal = Literal["fill", "noise", "truth"]
# Values to try for each key, in order of their effect, coarse to fine.
_CHOICES: dict[str, tuple[float, ...]] = {
    "param-secondpeakdelta": (0, 110, 222, 325, 480, 647),
    "param-leftrightthreshold": (10, 24, 64),
    "param-scanlinep2": (170, 240, 342, 480, 680),
    "param-scanlinep1": (30, 60, 90, 120),
    "param-regionshrinku": (1, 2, 3, 4),
    "param-regionshrinkv": (0, 1, 2),
    "param-censususize": (5, 7, 9),
    "param-censusvsize": (5, 7, 9),
    "param-rsmremovethreshold": (0.1, 0.375, 0.8),
}
ROUNDS = 2
# A better setting has at most this share of the start's noise, and at least this share of its fill.
_MOST_NOISE, _LEAST_FILL = 1.1, 0.98
_WINDOW_PX = 11
_FLAT_PX = 1.0  # a larger residual from a plane means an edge in the window
_WRONG_PX = 2.0


@dataclass(frozen=True)
class Score:
    """Quality of disparity images, averaged over the pairs. fill: share of measured pixels. noise_px: RMS deviation
    from a fitted plane, as the median over flat windows. wrong: share of the pixels with truth that are unmeasured or
    off by more than 2 px; NaN without truth."""

    fill: float
    noise_px: float
    wrong: float


def score(disparities: Sequence[NDArray[np.float32]], truths: Sequence[NDArray[np.float32]] = ()) -> Score:
    """Computes the Score of disparity images [height, width] in pixels, -1 = no measurement. truths: true disparities
    of the same images, NaN = unknown; () = none."""
    fill = float(np.mean([np.mean(disparity > 0) for disparity in disparities]))
    # RMS about the fitted plane in each window that is measured throughout and holds no edge.
    noise = []
    for d in (np.asarray(disparity, np.float64) for disparity in disparities):
        x = np.arange(d.shape[1]) - 0.5 * d.shape[1]
        y = (np.arange(d.shape[0]) - 0.5 * d.shape[0])[:, None]
        middle, of_x, of_y, square, measured = (
            uniform_filter(values, _WINDOW_PX)[::3, ::3] for values in (d, d * x, d * y, d * d, (d > 0).astype(float))
        )
        slope_x, slope_y, spread = of_x - middle * x[::3], of_y - middle * y[::3], (_WINDOW_PX**2 - 1) / 12.0
        variance = square - middle**2 - (slope_x**2 + slope_y**2) / spread
        rms = np.sqrt(np.maximum(variance, 0.0))[measured > 1.0 - 0.5 / _WINDOW_PX**2]
        flat = rms[rms < _FLAT_PX]
        noise.append(flat if flat.size else np.array([np.nan]))
    wrong = [
        np.mean(~(np.abs(disparity - truth) <= _WRONG_PX)[np.isfinite(truth)])
        for disparity, truth in zip(disparities, truths, strict=bool(truths))
    ]
    return Score(fill, float(np.median(np.concatenate(noise))), float(np.mean(wrong)) if wrong else float("nan"))


def search(
    goal: Goal,
    start: AdvancedSettings,
    evaluate: Callable[[AdvancedSettings], Score],
    progress: Callable[[float], object] = lambda fraction: None,
) -> tuple[AdvancedSettings, Score, Score]:
    """Improves settings towards a goal by trying the values of one key after another. Returns (best settings, score of
    `start`, score of the best). evaluate: computes the Score of settings."""
    first = best_score = evaluate(start)
    best, done = start, 0
    total = ROUNDS * sum(len(choices) for choices in _CHOICES.values())
    for _ in range(ROUNDS):
        for name, choices in _CHOICES.items():
            for choice in choices:
                done += 1
                progress(done / total)
                if choice == best.number(name):
                    continue
                tried = AdvancedSettings({**best.values, name: choice})
                found = evaluate(tried)
                # Fill is not bought with noise, nor less noise with holes.
                is_better = {
                    "truth": found.wrong < best_score.wrong,
                    "fill": found.fill > best_score.fill and found.noise_px <= _MOST_NOISE * first.noise_px,
                    "noise": found.noise_px < best_score.noise_px and found.fill >= _LEAST_FILL * first.fill,
                }[goal]
                if is_better:
                    best, best_score = tried, found
    return best, first, best_score
