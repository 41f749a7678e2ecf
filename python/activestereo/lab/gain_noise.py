# SPDX-License-Identifier: Apache-2.0
"""The noise at gains that no repeat has shown, from neighbours that the model expects alike."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from scipy.optimize import nnls

from activestereo.capture import Frame
from activestereo.effects import View
from activestereo.lab.noise import NoiseLaw

# Neighbours whose expected values differ by less than this share show noise alone in their difference.
_ALIKE = 0.1
# A squared difference beyond so many variances is a dot out of place.
_OUTLIER = 12.0
# What is an outlier depends on what is missing: both are told together in so many rounds.
_ROUNDS = 2


class Shot(Protocol):
    """One eye of one frame: measured DN [height][width], view.max_dn, key (frame id, eye)."""

    @property
    def frame(self) -> Frame: ...
    @property
    def view(self) -> View: ...
    @property
    def measured(self) -> np.ndarray: ...
    @property
    def key(self) -> tuple[int, str]: ...


def law_at_other_gains(
    law: NoiseLaw,
    observations: Sequence[Shot],
    images: dict[tuple[int, str], np.ndarray],
    shown_gains: set[float],
) -> NoiseLaw:
    """The law with the shot noise that frames at other gains than the repeats' show between neighbours alike in
    expected value.

    What a missing effect leaves there is the same at all gains (offsets of pixels and columns), or grows with the
    square of the signal: the shown gains tell how much.
    """
    shown = [o for o in observations if o.frame.gain in shown_gains and o.frame.projector_power > 0]
    others = [o for o in observations if o.frame.gain not in shown_gains]
    if not shown or not others:
        return law
    found = np.zeros(2)

    def missing(signal: np.ndarray) -> np.ndarray:
        return found[0] + found[1] * signal**2

    for _ in range(_ROUNDS):
        found = found + _slopes(law, shown, images, lambda o, signal: [np.ones(signal.shape), signal**2], missing)
    [shot] = _slopes(law, others, images, lambda o, signal: [o.frame.gain * signal], missing)
    return replace(law, shot=law.shot + shot)


def _slopes(
    law: NoiseLaw,
    observations: Sequence[Shot],
    images: dict[tuple[int, str], np.ndarray],
    levers_of: Callable[[Shot, np.ndarray], list[np.ndarray]],
    missing: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """By how much the variance between alike neighbours, beyond the law's and what is missing at their signal, grows
    with each of some levers; not below 0.
    """
    gram: Any = 0.0
    moment: Any = 0.0
    for o in observations:
        image = images[o.key]
        rest = o.measured - image
        mean = 0.5 * (image[:, 1:] + image[:, :-1])
        signal = np.maximum(mean - law.black_dn, 0.0)
        known = law.variance(mean, o.frame.gain) + missing(signal)
        alike = (np.abs(image[:, 1:] - image[:, :-1]) < _ALIKE * mean) & (mean < o.view.max_dn - 1)
        pair = np.minimum(0.5 * (rest[:, 1:] - rest[:, :-1]) ** 2, _OUTLIER * known)
        deviation = np.maximum(known, 1.0 / 12.0)[alike]
        levers = np.stack([lever[alike] / deviation for lever in levers_of(o, signal)])
        gram = gram + levers @ levers.T
        moment = moment + levers @ ((pair - known)[alike] / deviation)
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    size, axes = np.linalg.eigh(gram / np.outer(scale, scale))
    root = np.sqrt(np.maximum(size, 1e-12))
    return nnls(root[:, None] * axes.T, axes.T @ (moment / scale) / root)[0] / scale
