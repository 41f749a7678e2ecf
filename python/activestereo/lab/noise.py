"""The noise floor of a capture: how far a perfect model would still be from the measurement, in DN.

Repeats of one static view differ by temporal noise alone, so their pixelwise unbiased variance is the floor of their frames.
Frames without repeats get it from a photon-transfer law (EMVA 1288 with a quadratic term for speckle)
    variance = q0 + q1 * gain * signal + q2 * signal^2
fitted to the repeats; signal is DN above black. Applied to measured pixels the law needs no model of the scene: the square
of a noisy signal exceeds the squared mean by the variance itself, so mean(variance) = mean(q0 + q1 g s + q2 s^2) / (1 + q2).
What is static and random (fixed pattern, static speckle) is not in the floor: it is for effects to explain.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from activestereo.capture import EYES

_BINS = 40


@dataclass(frozen=True)
class NoiseLaw:
    """variance_dn2 = offset + shot * gain * signal + relative * signal^2, signal in DN above black_dn."""

    offset: float
    shot: float
    relative: float
    black_dn: float

    def variance(self, mean_dn, gain=1.0):
        """Variance in DN^2 at an expected value."""
        signal = np.maximum(np.asarray(mean_dn, dtype=np.float64) - self.black_dn, 0.0)
        return self.offset + self.shot * gain * signal + self.relative * signal**2

    def mean_variance(self, measured_dn, gain=1.0):
        """Mean variance of one image's pixels, from the noisy image itself."""
        signal = np.asarray(measured_dn, dtype=np.float64) - self.black_dn
        raw = self.offset + self.shot * gain * signal.mean() + self.relative * (signal**2).mean()
        return raw / (1.0 + self.relative)


def repeat_statistics(capture, split=None):
    """Pixelwise mean and unbiased variance of every repeat group and eye: [(frames, eye, mean, variance)], DN."""
    statistics = []
    for frames in capture.repeats(split).values():
        for eye in EYES:
            stack = np.stack([capture.ir(frame, eye) for frame in frames]).astype(np.float64)
            statistics.append((frames, eye, stack.mean(axis=0), stack.var(axis=0, ddof=1)))
    return statistics


def fit_noise_law(statistics, black_dn, max_dn):
    """The photon-transfer law of repeats, or None without repeats. Clipped pixels are left out."""
    rows, values, weights = [], [], []
    for frames, _, mean, variance in statistics:
        gain = frames[0].gain
        inside = (mean > 0) & (mean < max_dn - 1)
        # A mean of n repeats is itself noisy: signal^2 would be too large by variance / n.
        signal, excess, var = mean[inside] - black_dn, variance[inside] / len(frames), variance[inside]
        edges = np.unique(np.quantile(signal, np.linspace(0, 1, _BINS + 1)))
        index = np.clip(np.searchsorted(edges, signal, side="right") - 1, 0, max(len(edges) - 2, 0))
        for b in np.unique(index):
            here = index == b
            rows.append([1.0, gain * signal[here].mean(), (signal[here] ** 2 - excess[here]).mean()])
            values.append(var[here].mean())
            weights.append(np.sqrt(here.sum()) / max(var[here].mean(), 1e-6))
    if not rows:
        return None
    design, value, weight = np.maximum(rows, 0.0), np.array(values), np.array(weights)
    offset, shot, relative = nnls(design * weight[:, None], value * weight)[0]
    return NoiseLaw(float(offset), float(shot), float(relative), float(black_dn))


def frame_floors(capture, black_dn):
    """({(frame id, eye): (variance in DN^2, "repeats" or "law")}, law). Without any repeats: ({}, None).

    The law is fitted on the train repeats where there are any, else on all.
    """
    statistics = repeat_statistics(capture)
    train = [entry for entry in statistics if entry[0][0].split == "train"]
    law = fit_noise_law(train or statistics, black_dn, capture.rig.max_dn)
    if law is None:
        return {}, None
    floors = {}
    for frames, eye, _, variance in statistics:
        for frame in frames:
            floors[frame.id, eye] = (float(variance.mean()), "repeats")
    for frame in capture.frames:
        for eye in EYES:
            if (frame.id, eye) not in floors:
                floors[frame.id, eye] = (law.mean_variance(capture.ir(frame, eye), frame.gain), "law")
    return floors, law
