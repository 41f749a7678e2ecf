# SPDX-License-Identifier: Apache-2.0
"""Computes the model's depth. Compares the device's depth with it and with the scene's geometry: error in metres and in
pixels of disparity, fill, and noise floor.

simsense matches the expected pair after noise is added. The noise floor is the difference between two depth images of
one view. These are repeated frames of the device, or, without repeats, two noisy runs of the model."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from activestereo.capture.capture import DEPTH_ENGINE, SIDES, SPLITS, Capture, CaptureWarning, Frame
from activestereo.capture.capture_json import CaptureError
from activestereo.common.lens import lens_fields
from activestereo.common.parameter import MATCHER
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.image_errors import ImageErrors
from activestereo.compare.noise import NoiseModel, by_repeats
from activestereo.effects.core.model import Model

# Farther than the engine's default, because a device's 16 bits of depth in millimetres reach this far.
_DEFAULT_MAX_DEPTH_M = 65.0
_MAX_DISPARITY = next(p for p in MATCHER if p.name == "max_disparity")


def expose(
    expected_dn: np.ndarray, gain: float, noise_model: NoiseModel, max_dn: float, rng: np.random.Generator
) -> np.ndarray:
    """Draws a noisy image from the expected image, DN [height][width]; returns whole DN in float32, 0..max_dn. The
    noise model's quadratic term becomes gamma-distributed speckle, the other terms normal noise."""
    signal = np.maximum(expected_dn - noise_model.black_dn, 0.0)
    variance = np.maximum(noise_model.offset - ROUNDING_VARIANCE + noise_model.shot * gain * signal, 0.0)
    noise = np.sqrt(variance) * rng.standard_normal(signal.shape)
    if noise_model.relative > 0:
        noise += signal * (rng.gamma(1.0 / noise_model.relative, noise_model.relative, signal.shape) - 1.0)
    return np.clip(np.rint(expected_dn + noise), 0, max_dn).astype(np.float32)


class DepthModel:
    """Computes depth from image pairs by simsense, with a capture's calibration. Depth is z in the left camera's frame,
    metres, 0 = no match.

    The capture's depth_engine hints set the engine's parameters of the same names. The other parameters keep the
    engine's defaults, because the device's matcher is unknown. Hints that the engine refuses are ignored, with a
    CaptureWarning.
    """

    def __init__(self, capture: Capture) -> None:
        import simsense

        rig = capture.rig
        left, right = (
            simsense.Camera(c.width, c.height, c.K, **lens_fields(c.distortion)) for c in (rig.left, rig.right)
        )
        shift, same_size = rig.left_to_right.copy(), (left.width, left.height) == (right.width, right.height)
        shift[0, 3] = 0.0
        is_ideal = same_size and np.allclose(rig.left.K, rig.right.K) and np.allclose(shift, np.eye(4))
        is_ideal = is_ideal and rig.left.is_pinhole and rig.right.is_pinhole
        registered: dict[str, Any] = {} if is_ideal else {"rgb": left, "left_to_rgb": np.eye(4)}

        def engine(parameters: Mapping[str, Any]) -> simsense.Engine:
            device, bits = simsense.Device("host"), max(8, rig.bit_depth)
            return simsense.Engine(
                device, left, right, rig.left_to_right, rectified=is_ideal, bit_depth=bits, **registered, **parameters
            )

        self.parameters = _followed(capture.depth_engine)
        try:
            self._engine = engine(self.parameters)
        except simsense.ArgumentError as error:
            text = f"{capture.path}: depth_engine hints cannot be followed: {error}"
            warnings.warn(text, CaptureWarning, stacklevel=2)
            self.parameters = _followed({})
            try:
                self._engine = engine(self.parameters)
            except simsense.ArgumentError as again:
                raise CaptureError(f"{capture.path / 'capture.json'}: rig: depth cannot be judged: {again}") from again
        self._output = "depth" if is_ideal else "depth_rgb"
        self._dtype = np.uint8 if rig.bit_depth <= 8 else np.uint16

    def depth(self, left_dn: np.ndarray, right_dn: np.ndarray) -> np.ndarray:
        """Returns the depth of a pair in whole DN, float32 [height][width] metres."""
        left, right = left_dn.astype(self._dtype), right_dn.astype(self._dtype)
        return self._engine.compute(left, right, outputs=(self._output,))[self._output].copy()


def _followed(hints: Mapping[str, Any]) -> dict[str, Any]:
    """Returns simsense's parameters: defaults, replaced by the capture's depth_engine hints that are known."""
    known = {name: hints[name] for name in DEPTH_ENGINE if hints.get(name) is not None}
    return {"max_disparity": _MAX_DISPARITY.default, "max_depth_m": _DEFAULT_MAX_DEPTH_M} | known


# Number of frames after which a temporal filter has settled. librealsense's weighs each new frame by 0.4, so that
# (1 - 0.4)^12 = 0.2 % of the first frame is left after 12 frames.
SETTLING_FRAMES = 12
_MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True)
class DepthFrame:
    """Depth images of one frame, metres [height][width], 0 = none. measured: the device's. model: the model's, with two
    independent draws of noise. truth: the scene's. focal_baseline: px x m; disparity = focal_baseline / depth."""

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
    capture: Capture, errors: ImageErrors, model: Model, seed: int = 0, split: str | None = None
) -> list[DepthFrame]:
    """Computes a DepthFrame for each frame that has the device's depth. errors: of the images that are matched; without
    a noise model their noise is estimated from the residuals. model: its effects on disparity and depth change
    simsense's depth. split: only frames of this split; None: all."""
    frames = [frame for frame in capture.frames if frame.depth_path is not None and split in (None, frame.split)]
    if not frames:
        return []
    engine = DepthModel(capture)
    focal_baseline = float(capture.rig.left.K[0, 0]) * capture.rig.baseline_m
    out = []
    for frame in frames:
        view, draws = errors.views[frame.id, "left"], []
        device = capture.depth(frame)
        assert device is not None  # it has a depth_path
        expected = {side: errors.predictions[frame.id, side].astype(np.float64) for side in SIDES}
        noise = {}
        for side, image in expected.items():
            # Without repeats the noise variance comes from the residual's median absolute deviation, as if normal.
            rest = errors.measured[frame.id, side] - image
            deviation = _MAD_TO_SIGMA * np.median(np.abs(rest - np.median(rest)))
            noise[side] = errors.noise_model or NoiseModel(float(deviation**2), 0.0, 0.0, 0.0)
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
            groups = by_repeats((d.frame, "left", d) for d in chosen)
            # Pairs of consecutive depth images of the device, of one static view.
            repeats = [(a, a.measured, b.measured) for g in groups for a, b in zip(g, g[1:], strict=False)]
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
    """Computes error statistics of depth maps. pairs: (DepthFrame, depth, reference) in metres; the pixels of all
    frames that have both are pooled. A statistic is None without such pixels."""
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
