# SPDX-License-Identifier: Apache-2.0
"""The noise floor of every image of a capture, from the best evidence that there is: repeats, the noise model that they
tell, or the difference of a frame's own two cameras."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from activestereo.capture.capture import SIDES, Capture, Frame, ImageKey
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.gain_noise import noise_model_at_other_gains
from activestereo.compare.noise import NoiseModel, frame_noise_variances
from activestereo.compare.pair_noise import pair_noise_model
from activestereo.effects.core.view import View


@dataclass(frozen=True)
class _Shot:
    frame: Frame
    view: View
    measured: np.ndarray
    key: ImageKey


def noise_variances_of(
    capture: Capture,
    views: Mapping[ImageKey, View],
    measured: Mapping[ImageKey, np.ndarray],
    predicted: Mapping[ImageKey, np.ndarray],
    black_dn: float,
    no_noise: Mapping[ImageKey, np.ndarray],
) -> tuple[dict[ImageKey, tuple[float, str]], NoiseModel | None]:
    """({(frame id, side): (variance in DN^2, 'repeats', 'noise model' or 'pair')}, noise model). Empty and None where
    not even the pairs tell: nothing in them is smooth. predicted: expected DN; no_noise: what is known to differ
    between repeats, DN."""
    noise_variances, noise_model = frame_noise_variances(capture, black_dn, no_noise)
    if noise_model is None:
        frames = capture.split("train") or capture.frames
        pairs = [
            (views[f.id, "left"], views[f.id, "right"], measured[f.id, "left"], measured[f.id, "right"]) for f in frames
        ]
        noise_model = pair_noise_model(pairs, black_dn)
        if noise_model is None:
            return {}, None
        return {
            key: (_variance(noise_model, measured[key], views[key].frame.gain), "pair") for key in measured
        }, noise_model
    # As a diagnosis has it: at gains that no repeat shows the noise model is what neighbours tell.
    train = [_Shot(f, views[f.id, e], measured[f.id, e], (f.id, e)) for f in capture.split("train") for e in SIDES]
    shown = {f.gain for f in capture.split("train") if f.repeat_group is not None}
    noise_model = noise_model_at_other_gains(noise_model, train, dict(predicted), shown)
    others = {key: view.frame.gain for key, view in views.items() if view.frame.gain not in shown}
    at_others = {key: (_variance(noise_model, measured[key], gain), "noise model") for key, gain in others.items()}
    return {
        key: (max(v, ROUNDING_VARIANCE), source) for key, (v, source) in noise_variances.items()
    } | at_others, noise_model


def _variance(noise_model: NoiseModel, image: np.ndarray, gain: float) -> float:
    return max(noise_model.mean_variance(image, gain), ROUNDING_VARIANCE)
