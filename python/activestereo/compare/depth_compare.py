# SPDX-License-Identifier: Apache-2.0
"""Compares the device's depth with the model's and with the true geometry: error in metres and in pixels of disparity,
fill, and noise floor.

Both the device's and the model's depth are single noisy measurements. Two repeats of one of them differ as much as a
perfect model would from the device. The floor comes from repeated device frames with depth, else from the model's own
repeats.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.capture.capture import SIDES, SPLITS, Frame
from activestereo.compare.depth_model import DepthModel, expose
from activestereo.compare.noise import NoiseModel

if TYPE_CHECKING:
    from activestereo.capture.capture import Capture
    from activestereo.effects.core.model import Model
    from activestereo.effects.core.view import View

# Frames of a view until a filter over time has settled: librealsense's takes 0.4 of each new frame, so that after 12
# frames (1 - 0.4)^12 = 0.2 % of its start are left.
SETTLING_FRAMES = 12
_MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True)
class DepthFrame:
    """Depths of one frame, metres [height][width], 0 = none: the device's (measured), two exposures of the model, and
    the true geometry. focal_baseline: pixels x metres, disparity = focal_baseline / depth."""

    frame: Frame
    measured: np.ndarray
    model: tuple[np.ndarray, ...]
    truth: np.ndarray
    focal_baseline: float

    def disparity_error(self, depth_m: np.ndarray, reference_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns (disparity of depth_m minus that of reference_m, pixels [height][width], and a mask of the pixels at
        which both are valid)."""
        both = (depth_m > 0) & (reference_m > 0)
        safe = lambda z: np.where(both, z, 1.0)  # noqa: E731
        return np.where(both, self.focal_baseline * (1.0 / safe(depth_m) - 1.0 / safe(reference_m)), 0.0), both


def model_depths(
    capture: Capture, measured: Mapping[tuple[int, str], np.ndarray], predictions: Mapping[tuple[int, str], np.ndarray],
    views: Mapping[tuple[int, str], View], noise_model: NoiseModel | None, model: Model, seed: int = 0,
    split: str | None = None,
) -> list[DepthFrame]:  # fmt: skip
    """Computes a DepthFrame for each frame that has the device's depth. measured, predictions: {(frame id, side): DN},
    measured and expected images; views: {(frame id, side): View}.

    noise_model: the noise of the images that are matched; None: estimated from the residuals. model: its effects on
    disparity and depth change simsense's depth. split: only frames of this split; None: all.
    """
    frames = [frame for frame in capture.frames if frame.depth_path is not None and split in (None, frame.split)]
    if not frames:
        return []
    engine = DepthModel(capture)
    focal_baseline = float(capture.rig.left.K[0, 0]) * capture.rig.baseline_m
    out = []
    for frame in frames:
        view, draws = views[frame.id, "left"], []
        device = capture.depth(frame)
        assert device is not None  # it has a depth_path
        expected = {side: predictions[frame.id, side].astype(np.float64) for side in SIDES}
        noise = {}
        for side, image in expected.items():
            # Without repeats the noise variance comes from the residual's median absolute deviation, as if normal.
            rest = measured[frame.id, side] - image
            deviation = _MAD_TO_SIGMA * np.median(np.abs(rest - np.median(rest)))
            noise[side] = noise_model or NoiseModel(float(deviation**2), 0.0, 0.0, 0.0)
        for draw in range(2):
            keys = {side: [seed, 4 * frame.id + 2 * draw + index] for index, side in enumerate(SIDES)}
            rngs = {side: np.random.Generator(np.random.Philox(key=key)) for side, key in keys.items()}
            stream: dict[str, np.ndarray] = {}
            for _ in range(SETTLING_FRAMES if model.remembers else 1):
                pair = [expose(expected[s], frame.gain, noise[s], capture.rig.max_dn, rngs[s]) for s in SIDES]
                depth = model.depth(engine.depth(*pair), view, stream)
            draws.append(depth)
        out.append(DepthFrame(frame, device, tuple(draws), view.depth_m, focal_baseline))
    return out


def depth_scores(depths: Sequence[DepthFrame]) -> dict[str, dict[str, Any]]:
    """Returns compare.json's `depth`: {split: scores}; a split without device depth is left out."""
    scores = {}
    for split in SPLITS:
        chosen = [d for d in depths if d.frame.split == split]
        if chosen:
            # Pairs of the device's own depths of one static view.
            groups: dict[int, list[DepthFrame]] = {}
            for d in chosen:
                if d.frame.repeat_group is not None:
                    groups.setdefault(d.frame.repeat_group, []).append(d)
            repeats = [(a, a.measured, b.measured) for g in groups.values() for a, b in zip(g, g[1:], strict=False)]
            truth = {
                "measured": _error([(d, d.measured, d.truth) for d in chosen]),
                "model": _error([(d, d.model[0], d.truth) for d in chosen]),
            }
            frames = [{"id": d.frame.id} | _against_model([d]) | _floor([d], []) for d in chosen]
            scores[split] = _against_model(chosen) | _floor(chosen, repeats) | {"truth": truth, "frames": frames}
    return scores


def _against_model(depths: Sequence[DepthFrame]) -> dict[str, Any]:
    pairs = [(d, d.measured, d.model[0]) for d in depths]
    measured = np.concatenate([(d.measured > 0).ravel() for d in depths])
    model = np.concatenate([(d.model[0] > 0).ravel() for d in depths])
    return _error(pairs) | {
        "fill_measured": float(measured.mean()),
        "fill_model": float(model.mean()),
        "validity_iou": _overlap(measured, model),
    }


def _floor(depths: Sequence[DepthFrame], repeats: Sequence[Any]) -> dict[str, Any]:
    pairs = repeats or [(d, d.model[0], d.model[1]) for d in depths]
    error = _error(pairs)
    return {
        "noise_floor_px": error["rmse_px"],
        "noise_floor_median_abs_px": error["median_abs_px"],
        "noise_floor_validity_iou": _overlap(*(np.concatenate([(p[k] > 0).ravel() for p in pairs]) for k in (1, 2))),
        "noise_floor_from": "repeats" if repeats else "model",
    }


def _error(pairs: Sequence[Any]) -> dict[str, Any]:
    """Returns the errors of (DepthFrame, depth, reference), pooled over pixels at which both are valid; each is None
    without such pixels."""
    in_metres, in_pixels = [], []
    for d, depth, reference in pairs:
        error, both = d.disparity_error(depth, reference)
        in_pixels.append(error[both])
        in_metres.append((depth.astype(np.float64) - reference)[both])
    metres, pixels = np.concatenate(in_metres), np.concatenate(in_pixels)
    if not metres.size:
        return dict.fromkeys(("rmse_m", "bias_m", "rmse_px", "median_abs_px"))
    return {
        "rmse_m": float(np.sqrt(np.mean(metres**2))),
        "bias_m": float(metres.mean()),
        "rmse_px": float(np.sqrt(np.mean(pixels**2))),
        "median_abs_px": float(np.median(np.abs(pixels))),
    }


def _overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Returns the intersection over union of two masks; 1 if both are empty."""
    union = np.count_nonzero(a | b)
    return float(np.count_nonzero(a & b) / union) if union else 1.0
