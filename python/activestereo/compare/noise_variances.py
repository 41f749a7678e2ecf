# SPDX-License-Identifier: Apache-2.0
"""The noise floor of every image of a capture, from the best evidence that there is: repeats, the law that they tell,
or the difference of a frame's own two eyes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from activestereo.capture.capture import EYES, Capture, Frame, ImageKey
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.gain_noise import law_at_other_gains
from activestereo.compare.noise import NoiseLaw, frame_noise_variances
from activestereo.compare.pair_noise import pair_law
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
) -> tuple[dict[ImageKey, tuple[float, str]], NoiseLaw | None]:
    """({(frame id, eye): (variance in DN^2, 'repeats', 'law' or 'pair')}, law). Empty and None where not even the pairs
    tell: nothing in them is smooth. predicted: expected DN; no_noise: what is known to differ between repeats, DN."""
    noise_variances, law = frame_noise_variances(capture, black_dn, no_noise)
    if law is None:
        frames = capture.split("train") or capture.frames
        pairs = [
            (views[f.id, "left"], views[f.id, "right"], measured[f.id, "left"], measured[f.id, "right"]) for f in frames
        ]
        law = pair_law(pairs, black_dn)
        if law is None:
            return {}, None
        return {key: (_variance(law, measured[key], views[key].frame.gain), "pair") for key in measured}, law
    # As a diagnosis has it: at gains that no repeat shows the law is what neighbours tell.
    train = [_Shot(f, views[f.id, e], measured[f.id, e], (f.id, e)) for f in capture.split("train") for e in EYES]
    shown = {f.gain for f in capture.split("train") if f.repeat_group is not None}
    law = law_at_other_gains(law, train, dict(predicted), shown)
    others = {key: view.frame.gain for key, view in views.items() if view.frame.gain not in shown}
    at_others = {key: (_variance(law, measured[key], gain), "law") for key, gain in others.items()}
    return {key: (max(v, ROUNDING_VARIANCE), source) for key, (v, source) in noise_variances.items()} | at_others, law


def _variance(law: NoiseLaw, image: np.ndarray, gain: float) -> float:
    return max(law.mean_variance(image, gain), ROUNDING_VARIANCE)
