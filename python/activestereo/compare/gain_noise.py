# SPDX-License-Identifier: Apache-2.0
"""The noise at gains that no repeat has shown, from neighbours that the model expects alike."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.noise import NoiseModel
from activestereo.effects import View

# Neighbours whose expected values differ by less than this share show noise alone in their difference.
_ALIKE = 0.1
# A squared difference beyond so many variances is a dot out of place.
_OUTLIER = 12.0


class ObservedImage(Protocol):
    """One camera of one frame: measured DN [height][width], view.max_dn, key (frame id, side)."""

    @property
    def frame(self) -> Frame: ...
    @property
    def view(self) -> View: ...
    @property
    def measured(self) -> np.ndarray: ...
    @property
    def key(self) -> tuple[int, str]: ...


def noise_model_at_other_gains(
    noise_model: NoiseModel,
    observations: Sequence[ObservedImage],
    images: dict[tuple[int, str], np.ndarray],
    shown_gains: set[float],
) -> NoiseModel:
    """The noise model with the shot noise that frames at other gains than the repeats' show between neighbours alike in
    expected value.

    What a missing effect leaves there grows with the square of the signal, at all gains alike: the shown gains tell
    how much.
    """
    shown = [o for o in observations if o.frame.gain in shown_gains and o.frame.projector_power > 0]
    others = [o for o in observations if o.frame.gain not in shown_gains]
    if not shown or not others:
        return noise_model
    missing = max(_slope(noise_model, shown, images, lambda o, signal: signal**2, 0.0), 0.0)
    return replace(
        noise_model,
        shot=noise_model.shot
        + max(_slope(noise_model, others, images, lambda o, signal: o.frame.gain * signal, missing), 0.0),
    )


def _slope(
    noise_model: NoiseModel,
    observations: Sequence[ObservedImage],
    images: dict[tuple[int, str], np.ndarray],
    lever_of: Callable,
    missing: float,
) -> float:
    """By how much the variance between alike neighbours, beyond the noise model's and missing x signal^2, grows with a
    lever.
    """
    top = bottom = 0.0
    for o in observations:
        image = images[o.key]
        rest = o.measured - image
        mean = 0.5 * (image[:, 1:] + image[:, :-1])
        signal = np.maximum(mean - noise_model.black_dn, 0.0)
        known = noise_model.variance(mean, o.frame.gain) + missing * signal**2
        alike = (np.abs(image[:, 1:] - image[:, :-1]) < _ALIKE * mean) & (mean < o.view.max_dn - 1)
        if (scene := o.view.known) is not None:
            alike &= scene[:, 1:] & scene[:, :-1]
        pair = np.minimum(0.5 * (rest[:, 1:] - rest[:, :-1]) ** 2, _OUTLIER * known)
        lever, weight = lever_of(o, signal), 1.0 / np.maximum(known, ROUNDING_VARIANCE) ** 2
        top += (weight * lever * (pair - known))[alike].sum()
        bottom += (weight * lever**2)[alike].sum()
    return top / bottom if bottom > 0 else 0.0
