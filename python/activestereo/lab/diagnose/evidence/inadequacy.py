"""What a measured scene is never known to exactly: the places of its edges, and the noise at gains that no repeat
has shown.

A tape measure errs by a millimetre or so: where materials or surfaces meet, the image is off by the local slope times
that. This error is estimated on static frames alone and never believed beyond a limit, so that what moves edges in
earnest stays to be explained.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from activestereo.lab.noise import NoiseLaw

if TYPE_CHECKING:
    from activestereo.lab.diagnose.evidence.observation import Observation

# Largest survey error of a place that is believed, metres; beyond it something else is missing.
_LARGEST_PLACE_ERROR_M = 1.5e-3
_DEPTH_STEP = 0.03
# Neighbours whose expected values differ by less than this share show noise alone in their difference.
_ALIKE = 0.1
# A squared difference beyond so many variances is a dot out of place.
_OUTLIER = 12.0


def edges(o: "Observation") -> np.ndarray:
    """Pixels next to an edge of a material or a surface, bool [height][width]: what they show depends on its place."""
    return o.view.once("edges", lambda: _edges(o.view.depth_m, np.asarray(o.layers.material)))


def _edges(z: np.ndarray, material: np.ndarray) -> np.ndarray:
    edge = maximum_filter(material, 3) != minimum_filter(material, 3)
    return edge | (maximum_filter(z, 3) - minimum_filter(z, 3) > _DEPTH_STEP * z)


def edge_slopes(o: "Observation", image: np.ndarray) -> np.ndarray:
    """Change of the expected image in DN per metre of misplacement, at pixels next to an edge, else 0; float32
    [height][width].
    """
    z, edge = o.view.depth_m, edges(o)
    down, right = np.gradient(image)
    per_m = np.where(z > 0, o.view.K[0, 0] / np.where(z > 0, z, 1.0), 0.0)
    return np.where(edge, np.hypot(down, right) * per_m, 0.0).astype(np.float32)


def place_error(
    observations: Sequence["Observation"], images: dict[tuple[int, str], np.ndarray], law: NoiseLaw
) -> float:
    """Deviation of the edges' places in metres, from the static frames' excess at edges; 0 where there is none."""
    excess = slopes = 0.0
    for o in observations:
        if not o.frame.is_moving and o.frame.projector_power > 0:
            slope = edge_slopes(o, images[o.key])
            edge = slope > 0
            variance = law.variance(images[o.key], o.frame.gain)
            excess += ((o.measured - images[o.key]) ** 2 - variance)[edge].sum()
            slopes += (slope[edge].astype(np.float64) ** 2).sum()
    return float(np.sqrt(np.clip(excess / slopes, 0.0, _LARGEST_PLACE_ERROR_M**2))) if slopes > 0 else 0.0


def law_at_other_gains(
    law: NoiseLaw,
    observations: Sequence["Observation"],
    images: dict[tuple[int, str], np.ndarray],
    shown_gains: set[float],
) -> NoiseLaw:
    """The law with the shot noise that frames at other gains than the repeats' show between neighbours alike in
    expected value.

    What a missing effect leaves there grows with the square of the signal, at all gains alike: the shown gains tell
    how much.
    """
    shown = [o for o in observations if o.frame.gain in shown_gains and o.frame.projector_power > 0]
    others = [o for o in observations if o.frame.gain not in shown_gains]
    if not shown or not others:
        return law
    missing = max(_slope(law, shown, images, lambda o, signal: signal**2, 0.0), 0.0)
    return replace(
        law, shot=law.shot + max(_slope(law, others, images, lambda o, signal: o.frame.gain * signal, missing), 0.0)
    )


def _slope(
    law: NoiseLaw,
    observations: Sequence["Observation"],
    images: dict[tuple[int, str], np.ndarray],
    lever_of: Callable,
    missing: float,
) -> float:
    """By how much the variance between alike neighbours, beyond the law's and missing x signal^2, grows with a
    lever.
    """
    top = bottom = 0.0
    for o in observations:
        image = images[o.key]
        rest = o.measured - image
        mean = 0.5 * (image[:, 1:] + image[:, :-1])
        signal = np.maximum(mean - law.black_dn, 0.0)
        known = law.variance(mean, o.frame.gain) + missing * signal**2
        alike = (np.abs(image[:, 1:] - image[:, :-1]) < _ALIKE * mean) & (mean < o.view.max_dn - 1)
        pair = np.minimum(0.5 * (rest[:, 1:] - rest[:, :-1]) ** 2, _OUTLIER * known)
        lever, weight = lever_of(o, signal), 1.0 / np.maximum(known, 1.0 / 12.0) ** 2
        top += (weight * lever * (pair - known))[alike].sum()
        bottom += (weight * lever**2)[alike].sum()
    return top / bottom if bottom > 0 else 0.0
